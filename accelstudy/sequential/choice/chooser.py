"""The choice of the next position for a given set-up."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from accelstudy.leveling.error import TiltError
from accelstudy.sequential.choice.attitudes import apart_from
from accelstudy.sequential.choice.choosing import best, gain_of_leveling, gain_of_parameters
from accelstudy.sequential.choice.promise import Promise, rms_of
from accelstudy.sequential.choice.stopping import get_rule

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Chooser:
    """Chooses positions until a promise is kept.

    Attributes
    ----------
    directions : (k, 3) array, attitudes to choose from
    rows : (k, c, u') array, their rows of the design matrix, at unit weight
    error : TiltError
    promise : Promise
    rule : str, what the variance of unit weight is taken for
    sizes : (u',) array, of the parameters in a cheap sensor
    """

    directions: Array
    rows: Array
    error: TiltError
    promise: Promise
    rule: str
    sizes: Array

    def rms(self, root_information: Array, omega: Array, redundancy: int) -> Array:
        """Rms of roll and of pitch so far, (R, 2), rad; infinite where it is not known."""
        root = np.asarray(np.linalg.inv(root_information), dtype=float)
        variance = get_rule(self.rule)(omega, redundancy)
        finite = np.isfinite(variance)
        rms = rms_of(self.error, root @ np.swapaxes(root, 1, 2), np.where(finite, variance, 1.0))
        return np.where(finite[:, None], rms, np.inf)

    def choose(
        self, root_information: Array, solved: NDArray[np.bool_], rms: Array, last: Array | None
    ) -> NDArray[np.int_]:
        """Choose the next position of each session, (R,), an index of `directions`.

        Parameters
        ----------
        root_information : (R, u', u') array
        solved : (R,) bool array, whether all parameters are determined
        rms : (R, 2) array, so far; ignored where they are not
        last : (R, 3) array, directions of the last positions; None before the first
        """
        gains = np.empty((len(solved), len(self.directions)))
        if not solved.all():
            open_ = root_information[~solved]
            gains[~solved] = gain_of_parameters(open_, self.sizes, self.rows)
        if solved.any():
            weight = self.promise.weight(self.error, rms[solved])
            gains[solved] = gain_of_leveling(root_information[solved], weight, self.rows)
        if last is not None and len(self.directions) > 1:
            gains = np.where(apart_from(self.directions, last), gains, 0.0)
        return best(gains)
