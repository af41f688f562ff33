"""Windows that slide over a log: its noise, and the threshold up to which one is at rest."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.errors import InputError
from accelstudy.basics.units import STANDARD_GRAVITY
from accelstudy.campaign.importing.recording import GAP, Recording
from accelstudy.campaign.importing.resolution import step_in

Array = NDArray[np.float64]

_SMALLEST, _LARGEST = 8, 10**6  # samples
_TOGETHER = 2**16
"""Windows of which the sums are taken together: what a processor keeps at hand is small."""
FACTOR = 3.0
"""Threshold over noise floor; it leaves room for noise that differs between attitudes."""
QUIET_FACTOR, QUIET = 10.0, 0.003 * STANDARD_GRAVITY
"""The same for a quiet sensor, and the largest threshold that it may give, m/s²."""
RESTLESS = 0.02
"""Noise of windows, as a share of gravity, from which on it may be motion and not the sensor's."""
COARSE = 1.75
"""Noise of windows, as a multiple of that of rounding, up to which a sensor at rest may read the
same number all the time: that of noise of 0.4 steps."""

_BINS = np.linspace(-40.0, 40.0, 4001)  # decades of variance


def usual_window(log: Recording) -> float:
    """Length of a window, s: 1 s, or 9 samples of a slow log if its unit of time is plausible."""
    return 1.0 if log.likely_unit() else max(1.0, (_SMALLEST + 1) * log.step)


def samples_in(log: Recording, window: float) -> int:
    """Samples in a window of `window` seconds; odd, so that it has a middle.

    Raises
    ------
    InputError
        If they are too few for a variance, or so many that the rate must be wrong.
    """
    samples = window / log.step
    if not _SMALLEST <= samples <= _LARGEST:
        raise InputError(
            f"{log.path}: a window of {window:g} s holds {samples:.3g} samples, at "
            f"{1 / log.step:.6g} per second"
            f"{log.likely_unit() or '; is the rate (`rate`) right?'}"
        )
    return round(samples) | 1


class Windows:
    """Windows that slide over the samples of a log by one sample; none spans a gap.

    Parameters
    ----------
    log : Recording
    width : int, samples of a window; odd

    Attributes
    ----------
    log, width
    gaps : int, gaps in time within a recording
    variance : (n,) array, (m/s²)², norm of the variances of the axes in the window about each
        sample; NaN about those too near to a gap or an end for a window
    frozen : (n,) bool array, whether an axis does not change in the window
    centred : (n,) bool array, where there is a window

    Raises
    ------
    InputError
        If the log cannot be read, or is too short for a window.
    """

    def __init__(self, log: Recording, width: int) -> None:
        self.log, self.width = log, width
        time, forces = log.samples.time, log.samples.forces
        another = np.diff(log.samples.recording) > 0
        jumps = (np.diff(time) > GAP * log.step) & ~another
        self.gaps = int(jumps.sum())
        self.variance = np.full(len(time), np.nan)
        self.frozen = np.zeros(len(time), dtype=bool)
        half = width // 2
        pieces = [0, *(1 + np.flatnonzero(jumps | another)).tolist(), len(time)]
        for start, end in pairwise(pieces):
            for first in range(start, end - width + 1, _TOGETHER):
                beyond = min(first + _TOGETHER + width - 1, end)
                middle = slice(first + half, beyond - half)
                spread = _spread(forces[first:beyond], width)
                self.variance[middle], self.frozen[middle] = spread
        self.centred = np.isfinite(self.variance)
        if not self.centred.any():
            raise InputError(
                f"{log.path}: too few samples for a window of {width}, or gaps all over"
                f"{log.likely_unit()}"
            )

    @cached_property
    def extremes(self) -> Array:
        """Of the lowest and of the highest readings the outermost and the next, (2, 2, 3)."""
        ends = np.array([[[np.inf] * 3] * 2, [[-np.inf] * 3] * 2])
        for axis, force in enumerate(self.log.samples.forces.T):
            centred = force[self.centred]
            for end, pick, rest in ((0, np.min, np.greater), (1, np.max, np.less)):
                ends[end, 0, axis] = pick(centred)
                others = centred[rest(centred, ends[end, 0, axis])]
                if len(others):
                    ends[end, 1, axis] = pick(others)
        return ends

    @cached_property
    def steps(self) -> Array:
        """Steps in which the axes are read, (3,), m/s²; 0 where there are none."""
        return np.array([step_in(force[self.centred]) for force in self.log.samples.forces.T])

    @property
    def rounding(self) -> float:
        """Noise of a window by rounding alone, m/s²."""
        return float(np.sqrt(np.linalg.norm(self.steps**2 / 12)))

    @cached_property
    def coarse(self) -> bool:
        """Whether the steps explain that a channel at rest does not change over a window.

        If all windows that change are motion, nothing else explains it either.
        """
        if not self.rounding > 0:
            return False
        noise = _noise_floor(_histogram(self.variance))
        return bool(noise <= COARSE * self.rounding or noise > RESTLESS * STANDARD_GRAVITY)

    @cached_property
    def counts(self) -> NDArray[np.int_]:
        """Histogram of the variances of windows in which no channel is frozen."""
        return _histogram(self.variance[~self.frozen])

    @property
    def counts_at_rest(self) -> NDArray[np.int_]:
        """Histogram of the windows that may be at rest; none has less noise than that of rounding.

        A channel that does not change is frozen, unless its steps explain it.
        """
        if not self.coarse:
            return self.counts
        counts = _histogram(self.variance)
        least = int(np.searchsorted(_BINS, 2 * np.log10(self.rounding)))
        counts[least] += counts[:least].sum() + np.sum(self.variance == 0)
        counts[:least] = 0
        return counts

    def at_rest(self, sd: float) -> NDArray[np.bool_]:
        """Whether the window about each sample is at rest, (n,), up to a standard deviation."""
        return (self.variance <= sd**2) & (self.coarse | ~self.frozen)

    def quietest(self) -> float:
        """Standard deviation that a hundredth of the windows does not exceed, m/s²."""
        rank = np.searchsorted(np.cumsum(self.counts), 0.01 * self.counts.sum())
        return float(10.0 ** (_BINS[min(rank, len(_BINS) - 2) + 1] / 2))


def _histogram(variance: Array) -> NDArray[np.int_]:
    """Numbers of windows by the logarithms of their variances."""
    counts: NDArray[np.int_] = np.histogram(np.log10(variance[variance > 0]), _BINS)[0]
    return counts


def _spread(forces: Array, width: int) -> tuple[Array, NDArray[np.bool_]]:
    """Norm of the variances of the axes in each window, and whether an axis does not change."""
    squares = np.zeros(len(forces) - width + 1)
    frozen = np.zeros(len(squares), dtype=bool)
    for force in forces.T:
        # Squares of large numbers lose digits.
        offsets = force - force.mean()
        mean = _window_sums(offsets, width)
        mean /= width
        offsets *= offsets
        variance = _window_sums(offsets, width)
        variance /= width
        mean *= mean
        variance -= mean
        np.maximum(variance, 0.0, out=variance)
        variance *= variance
        squares += variance
        # Rounding may hide a variance of zero, so changes are counted.
        changed = force[1:] != force[:-1]
        if not changed.all():
            frozen |= _window_sums(changed, width - 1) == 0
    return np.sqrt(squares, out=squares), frozen


def _window_sums(values: NDArray[Any], width: int) -> Array:
    """Sums of `width` neighbours, each of its own values: a large one costs others no digits.

    A window is the end of one part of so many values and the beginning of the next part.
    """
    parts = np.zeros((-(-len(values) // width), width))
    parts.ravel()[: len(values)] = values
    ends = np.cumsum(parts[:, ::-1], axis=1)[:, ::-1].ravel()
    result: Array = np.cumsum(parts, axis=1).ravel()[width - 1 : len(values)]
    beyond = np.arange(len(result)) % width > 0
    result[beyond] += ends[: len(result)][beyond]
    return result


@dataclass(frozen=True)
class Threshold:
    """What separates rest from motion.

    Attributes
    ----------
    sd : float, m/s²; a window with at most this standard deviation (the root of the norm of the
        variances of its axes) is at rest
    floor : float, m/s², standard deviation of the noise by the same measure; NaN if not needed
    reason : str, how the threshold was chosen
    """

    sd: float
    floor: float
    reason: str


def threshold_of(windows: Windows, given: float | None) -> Threshold:
    """Threshold that a person chose, m/s², or the one that the data tell."""
    return choose_threshold(windows) if given is None else Threshold(given, np.nan, "as given")


def choose_threshold(windows: Windows) -> Threshold:
    """Choose a multiple of the noise floor, which is the usual noise of windows at rest.

    Otsu's method finds the valley between rest and motion in the histogram of the logarithmic
    variances. At rest they crowd around one value, the noise floor; in motion they spread over
    decades.

    The multiple is 3, since noise differs between attitudes. It is up to 10 as long as the
    threshold is below 0.003 g: a quiet sensor feels footsteps and pumps, and whatever moves less
    than that in a second is not being turned.
    """
    counts = windows.counts_at_rest
    if not counts.any():
        raise InputError(
            f"{windows.log.path}: a channel does not change in any window; is it frozen?"
        )
    noise = _noise_floor(counts)
    sd = max(FACTOR * noise, min(QUIET_FACTOR * noise, QUIET))
    return Threshold(
        sd,
        noise,
        f"{sd / noise:.3g} times the noise floor of {noise:.3g} m/s², "
        "around which windows at rest crowd",
    )


def _noise_floor(counts: NDArray[np.int_]) -> float:
    """Noise around which windows at rest crowd, m/s²; infinite without a window."""
    if not counts.any():
        return np.inf
    middle = (_BINS[:-1] + _BINS[1:]) / 2
    quiet = np.where(middle <= _otsu(counts, middle), counts, 0)
    # Smoothed over a tenth of a decade, so that a short log with few windows has a peak, too.
    mode = middle[np.argmax(np.convolve(quiet, np.ones(5), "same"))]
    crowd = np.where(np.abs(middle - mode) <= np.log10(2), counts, 0)
    floor = 10.0 ** middle[np.searchsorted(np.cumsum(crowd), crowd.sum() / 2)]
    return float(np.sqrt(floor))


def _otsu(counts: NDArray[np.int_], middle: Array) -> float:
    """Value that divides a histogram into two classes with the largest variance between them."""
    below = np.cumsum(counts)[:-1].astype(float)
    above = counts.sum() - below
    moment = np.cumsum(counts * middle)
    # An empty class has no mean, and no weight.
    low = moment[:-1] / np.maximum(below, 1)
    high = (moment[-1] - moment[:-1]) / np.maximum(above, 1)
    between = below * above * (high - low) ** 2
    if not between.max() > 0:
        return float(middle[np.argmax(counts)])
    best = np.flatnonzero(between >= between.max() * (1 - 1e-9))
    return float(middle[best[len(best) // 2]])
