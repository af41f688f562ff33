"""The choice of the next position: the attitudes to choose from, and the gain of each.

The gain is one for leveling or, while some parameters are unknown, for the parameters. A position
with the whitened rows A turns the covariance Q of the parameters into
Q − Q Aᵀ (I + A Q Aᵀ)⁻¹ A Q. So the mean variance of roll and pitch, tr(W Q), falls by

    tr[(I + A Q Aᵀ)⁻¹ A Q W Q Aᵀ],

the I criterion (W is the quadratic form of `TiltError`). As long as some parameters are not
determined there is no Q. Then the log-determinant of the information counts (D criterion), with the
typical size in a cheap sensor as prior information of each parameter. It grows by
log det (I + A Q₀ Aᵀ), where Q₀ follows from the positions so far and these sizes.

Both are sequential designs of one step at a time: Fedorov (1972), Theory of optimal experiments,
chapter 4.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.errors import InputError, UnknownNameError
from accelstudy.basics.units import GON
from accelstudy.design.spaces import Constraints, by_eye, cube, listed_in
from accelstudy.leveling.error import TiltError
from accelstudy.sensors.sensor import SensorModel
from accelstudy.sequential.estimate import Estimate, has_full_rank
from accelstudy.sequential.promise import Promise, rms_of

Array = NDArray[np.float64]

EQUAL_GAIN = 0.99
"""Candidates whose gain is above this fraction of the largest are equally good, and the first is
taken. So neither rounding nor noise decides, and simple attitudes can come first."""
MAX_FORECAST = 500
"""Largest number of further positions that is forecast."""
GRID_STEP = 25 * GON
"""Step of roll and pitch in the grid."""
SETS = {"cube": "faces, edges and corners of a cube", "grid": "roll and pitch in steps of 25 gon"}
DEFAULTS = {"gravity": "cube", "robot": "grid"}
"""Default set of attitudes of an approach: a block on a table, a grid for a robot."""
SAME_ATTITUDE = 5 * GON
"""A position within this angle of another counts as the same attitude."""


def candidates(
    name: str,
    pole_distance: float | None = None,
    max_roll: float | None = None,
    max_pitch: float | None = None,
) -> Array:
    """Directions of gravity in the body frame, (k, 3), of the attitudes to choose from.

    Parameters
    ----------
    name : str
        One of `SETS`, or the path of a CSV file with the columns x, y, z or roll and pitch.
    pole_distance : float, rad, optional, least angle between the x axis and the vertical
    max_roll, max_pitch : float, rad, optional, largest roll and pitch either way

    Raises
    ------
    InputError
        If there is no such set, the file cannot be read, or nothing is left.
    """
    if name == "cube":
        directions = cube().directions(0)
    elif name == "grid":
        directions = by_eye(GRID_STEP).directions(0)
    elif name.endswith(".csv"):
        directions = listed_in(Path(name)).directions(0)
    else:
        raise UnknownNameError("set of attitudes", name, (*SETS, "FILE.csv"))
    roll, pitch = (None if most is None else (-most, most) for most in (max_roll, max_pitch))
    left = Constraints(roll, pitch, pole_distance).keep(directions)
    if not len(left):
        raise InputError(f"attitudes: none of {name} is within the limits that are given")
    # Simple attitudes first: with vertical axes, then with horizontal ones.
    axes = np.count_nonzero(np.abs(left) > 1e-9, axis=1)
    return left[np.argsort(axes, kind="stable")]


def apart_from(directions: Array, last: Array) -> NDArray[np.bool_]:
    """Whether directions (k, 3) are other attitudes than the last of each session (R, 3); (R, k).

    To repeat an attitude at once would repeat its errors too.
    """
    return np.asarray(last @ directions.T < np.cos(SAME_ATTITUDE))


def typical_sizes(model: SensorModel, unknowns: int) -> Array:
    """Sizes of the parameters in cheap equipment, (u',), SI; infinite for observed gravity."""
    sizes = [effect.typical[1] for effect in model.effects for _ in effect.parameters]
    return np.array([*sizes, *[np.inf] * (unknowns - len(sizes))])


def gains(cofactors: Array, rows: Array, weight: Array | None = None) -> Array:
    """Gain of each candidate, for leveling or, without a weight, for the parameters.

    Parameters
    ----------
    cofactors : (R, u', u') array, Q
    rows : (k, c, u') array, A of k candidates
    weight : (R, u, u) array, W; without gravity, even where that is estimated

    Returns
    -------
    (R, k) array, rad², at unit weight, or growth of a logarithm
    """
    spread = rows @ cofactors[:, None]
    with_noise = np.eye(rows.shape[1]) + spread @ np.swapaxes(rows, 1, 2)
    if weight is None:
        return np.asarray(np.linalg.slogdet(with_noise)[1])
    spread = spread[..., : weight.shape[-1]]
    part = spread @ weight[:, None] @ np.swapaxes(spread, -1, -2)
    return np.trace(np.linalg.solve(with_noise, part), axis1=-2, axis2=-1)


def best(gains: Array) -> NDArray[np.int_]:
    """First candidate of each session (R,) whose gain, of (R, k), is as good as the best."""
    return np.asarray(np.argmax(gains >= EQUAL_GAIN * gains.max(axis=1, keepdims=True), axis=1))


@dataclass(frozen=True)
class Chooser:
    """Chooses positions until a promise is kept.

    Attributes
    ----------
    directions : (k, 3) array, attitudes to choose from
    rows : (k, c, u') array, their rows of the design matrix, at unit weight
    error : TiltError
    promise : Promise
    variance : function of Ω (R,) and the redundancy: the variance of unit weight, (R,)
    sizes : (u',) array, of the parameters in a cheap sensor
    """

    directions: Array
    rows: Array
    error: TiltError
    promise: Promise
    variance: Callable[[Array, int], Array]
    sizes: Array

    def rms(self, cofactors: Array, omega: Array, redundancy: int) -> Array:
        """Rms of roll and of pitch so far, (R, 2), rad; infinite where it is not known."""
        variance = self.variance(omega, redundancy)
        finite = np.isfinite(variance)
        rms = rms_of(self.error, cofactors, np.where(finite, variance, 1.0))
        return np.where(finite[:, None], rms, np.inf)

    def choose(
        self, information: Array, solved: NDArray[np.bool_], rms: Array, last: Array | None
    ) -> NDArray[np.int_]:
        """Choose the next position of each session, (R,), an index of `directions`.

        Parameters
        ----------
        information : (R, u', u') array
        solved : (R,) bool array, whether all parameters are determined
        rms : (R, 2) array, so far; ignored where they are not
        last : (R, 3) array, directions of the last positions; None before the first
        """
        gained = np.empty((len(solved), len(self.directions)))
        with_sizes = information[~solved] + np.diag(self.sizes**-2.0)
        gained[~solved] = gains(np.asarray(np.linalg.inv(with_sizes)), self.rows)
        weight = self.promise.weight(self.error, rms[solved])
        cofactors = np.asarray(np.linalg.inv(information[solved]))
        gained[solved] = gains(cofactors, self.rows, weight)
        if last is not None and len(self.directions) > 1:
            gained = np.where(apart_from(self.directions, last), gained, 0.0)
        return best(gained)

    def positions_to_go(
        self, so_far: Estimate, variance: float, rms: Array, last: Array | None
    ) -> int | None:
        """Positions, each the best next one, until the promise is kept; None beyond `MAX_FORECAST`.

        Parameters
        ----------
        so_far : Estimate, of one session
        variance : float, of unit weight, assumed to stay as it is
        rms : (2,) array, so far, rad
        last : (3,) array, direction of the last position; None before the first
        """
        information, solved, rms = so_far.information, so_far.solved, rms[None]
        last = None if last is None else last[None]
        for n in range(1, MAX_FORECAST + 1):
            chosen = self.choose(information, solved, rms, last)
            last, rows = self.directions[chosen], self.rows[chosen]
            information = information + np.swapaxes(rows, 1, 2) @ rows
            redundancy = so_far.redundancy + n * self.rows.shape[1]
            solved = solved | has_full_rank(information)
            if solved[0]:
                cofactors = np.asarray(np.linalg.inv(information), dtype=float)
                rms = self.rms(cofactors, np.array([variance * max(redundancy, 0)]), redundancy)
                if self.promise.reached(rms)[0]:
                    return n
        return None
