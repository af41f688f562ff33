"""The advice after each position of a running session, in SI."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Agreement(Enum):
    """Whether a position agrees with those before it."""

    AGREES = "agrees"
    CONFLICT = "conflict"
    UNTESTED = "untested"


@dataclass(frozen=True)
class LastPosition:
    """The last position, tested before it was used.

    Attributes
    ----------
    index : int, in the session
    agreement : Agreement
    p_value : float, probability that noise alone makes it disagree so much; NaN if untested
    repeats : bool, whether it repeats a position in conflict and is in conflict as well
    """

    index: int
    agreement: Agreement
    p_value: float
    repeats: bool


@dataclass(frozen=True)
class NoiseTaken:
    """Noise of a position by which the accuracy is judged, m/s².

    Attributes
    ----------
    stated : float or None, by the campaign
    seen : float or None, from the residuals; None without redundancy
    taken : float or None, the one that is used; None as long as it is unknown
    refuted : bool, whether the residuals are larger than the stated noise allows
    redundancy : int
    """

    stated: float | None
    seen: float | None
    taken: float | None
    refuted: bool
    redundancy: int


@dataclass(frozen=True)
class NextPosition:
    """The position to take next.

    Attributes
    ----------
    direction : (3,) array, of gravity in the body frame
    repeats : int or None, number of the position that it repeats
    """

    direction: Array
    repeats: int | None


@dataclass(frozen=True)
class Advice:
    """The whole advice.

    Attributes
    ----------
    positions : (n,) int array, numbers of the positions, without those that the campaign leaves out
    last : LastPosition or None
    set_aside : tuple of int, numbers of positions that disagree with the others and are not used
    undetermined : tuple of str, parameters that the positions do not determine yet
    vague : tuple of str, parameters known less well than the typical size in a cheap sensor
    noise : NoiseTaken
    rms : (2,) array, rad, of roll and of pitch; None as long as it is not known
    next : NextPosition
    to_go : int or None, positions still needed; None if unknown or too many
    foreseeable : bool, whether `to_go` can be known
    enough : bool, whether the promise is kept
    """

    positions: NDArray[np.int_]
    last: LastPosition | None
    set_aside: tuple[int, ...]
    undetermined: tuple[str, ...]
    vague: tuple[str, ...]
    noise: NoiseTaken
    rms: Array | None
    next: NextPosition
    to_go: int | None
    foreseeable: bool
    enough: bool
