"""The choice of the next position: the attitudes to choose from, and the best of them.

That is the one that lowers the mean variance of roll and pitch most or, while some parameters are
not determined, brings most information on the parameters. For that the typical size in a cheap
sensor is what is known of each beforehand. Both are designs of one step at a time.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from accelstudy.basics.arrays import Array
from accelstudy.basics.errors import InputError
from accelstudy.basics.units import GON
from accelstudy.design.information import Information
from accelstudy.design.spaces import find_attitudes
from accelstudy.leveling.error import TiltError
from accelstudy.sensors.sensor import SensorModel
from accelstudy.sequential.promise import Promise

EQUAL_GAIN = 0.99
"""Candidates whose gain is above this fraction of the largest are equally good, and the first is
taken. So neither rounding nor noise decides, and simple attitudes can come first."""
MAX_FORECAST = 500
"""Largest number of further positions that is forecast."""
SETS = {"cube": "faces, edges and corners of a cube", "grid": "roll and pitch in steps of 25 gon"}
DEFAULTS = {"gravity": "cube", "robot": "grid"}
"""Default set of attitudes of an approach: a block on a table, a grid for a robot."""
SAME_ATTITUDE = 5 * GON
"""A position within this angle of another counts as the same attitude. To repeat an attitude at
once would repeat its errors too."""


def candidate_positions(
    name: str,
    pole_distance: float | None = None,
    max_roll: float | None = None,
    max_pitch: float | None = None,
) -> Array:
    """Directions of gravity in the body frame, (k, 3), of the attitudes to choose from.

    Parameters
    ----------
    name : str
        One of `SETS`, or a scheme, by its name or its file.
    pole_distance : float, rad, optional, least angle between the x axis and the vertical
    max_roll, max_pitch : float, rad, optional, largest roll and pitch either way

    Raises
    ------
    InputError
        If there is no such set, the file cannot be read, or nothing is left.
    """
    roll, pitch = (None if most is None else (-most, most) for most in (max_roll, max_pitch))
    chosen = find_attitudes(name, SETS)
    left = replace(chosen, roll=roll, pitch=pitch, pole_distance=pole_distance).sample(0)
    if not len(left):
        raise InputError(f"attitudes: none of {name} is within the limits that are given")
    # Simple attitudes first: with vertical axes, then with horizontal ones.
    axes = np.count_nonzero(np.abs(left) > 1e-9, axis=1)
    return left[np.argsort(axes, kind="stable")]


def typical_sizes(model: SensorModel, unknowns: int) -> Array:
    """Sizes in cheap equipment of the parameters, (u',), SI; infinite for other unknowns."""
    sizes = [effect.typical[1] for effect in model.effects for _ in effect.parameters]
    return np.array([*sizes, *[np.inf] * (unknowns - len(sizes))])


@dataclass(frozen=True)
class Knowledge:
    """What a session tells of the parameters so far, together with what was known beforehand.

    Attributes
    ----------
    information : Information, at unit weight, on u' unknowns: the parameters, and what is estimated
        with them
    omega : float, Ω; NaN if they are not determined
    redundancy : int, conditions, with what was known beforehand, less unknowns; negative at first
    """

    information: Information
    omega: float
    redundancy: int

    @property
    def determined(self) -> bool:
        """Whether all parameters are determined."""
        return not np.isnan(self.omega)


@dataclass(frozen=True)
class Chooser:
    """Chooses positions until a promise is kept.

    Attributes
    ----------
    directions : (k, 3) array, attitudes to choose from
    rows : (k, c, u') array, their rows of the design matrix, at unit weight
    error : TiltError
    promise : Promise
    variance : function of Ω and the redundancy: the variance of unit weight
    sizes : (u',) array, of the parameters in a cheap sensor
    """

    directions: Array
    rows: Array
    error: TiltError
    promise: Promise
    variance: Callable[[float, int], Array]
    sizes: Array

    def rms(self, known: Knowledge) -> Array:
        """Rms of roll and of pitch so far, (2,), rad; infinite where it is not known."""
        variance = float(self.variance(known.omega, known.redundancy))
        if not (known.determined and np.isfinite(variance)):
            return np.full(2, np.inf)
        u = len(self.error.reference)
        return self.error.rms_of_all(variance * known.information.covariance[:u, :u])

    def choose(self, known: Knowledge, rms: Array, last: Array | None) -> int:
        """Choose the next position, an index of `directions`: the first of those that are best.

        Parameters
        ----------
        known : Knowledge
        rms : (2,) array, so far; ignored while not all is determined
        last : (3,) array, direction of the last position, which is not repeated; None before the
            first
        """
        if known.determined:
            weight = self.promise.weight(self.error, rms)
            gain = known.information.gain(self.rows, weight)
        else:
            with_sizes = Information.of(known.information.rows, np.diag(1 / self.sizes))
            gain = with_sizes.gain(self.rows)
        if last is not None and len(self.directions) > 1:
            gain = np.where(self.directions @ last < np.cos(SAME_ATTITUDE), gain, 0.0)
        return int(np.argmax(gain >= EQUAL_GAIN * gain.max()))

    def positions_to_go(
        self, known: Knowledge, variance: float, rms: Array, last: Array | None
    ) -> int | None:
        """Positions, each the best next one, until the promise is kept; None beyond `MAX_FORECAST`.

        Parameters
        ----------
        known, rms, last : as in `choose`
        variance : float, of unit weight, assumed to stay as it is
        """
        for n in range(1, MAX_FORECAST + 1):
            chosen = self.choose(known, rms, last)
            last, information = self.directions[chosen], known.information
            information = Information.of(information.rows, self.rows[chosen])
            redundancy = known.redundancy + self.rows.shape[1]
            determined = known.determined or information.determined
            omega = variance * max(redundancy, 0) if determined else np.nan
            known = Knowledge(information, omega, redundancy)
            rms = self.rms(known)
            if self.promise.is_kept(rms):
                return n
        return None
