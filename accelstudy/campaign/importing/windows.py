"""Windows of a log: the noise about each sample, and the threshold that separates rest from motion.

The detector is that of Tedaldi, Pretto and Menegatti (ICRA 2014): it compares the norm of the
variances of the three axes in a window with a threshold, which comes from the data.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.errors import InputError
from accelstudy.basics.units import STANDARD_GRAVITY
from accelstudy.basics.wording import plural
from accelstudy.campaign.importing.noise import step_in
from accelstudy.campaign.importing.recording import GAP_RATIO, Recording

Array = NDArray[np.float64]

MIN_SAMPLES, MAX_SAMPLES = 8, 10**6
"""Samples of a window, at least and at most."""
THRESHOLD_FACTOR = 3.0
"""Threshold over noise floor; it leaves room for noise that differs between attitudes."""
QUIET_FACTOR, QUIET = 10.0, 0.003 * STANDARD_GRAVITY
"""The same for a quiet sensor, and the largest threshold that it may give, m/s²."""
MAX_REST_NOISE = 0.02
"""Noise of windows, as a share of gravity, from which on it may be motion and not the sensor's."""
MAX_COARSE_RATIO = 1.75
"""Noise of windows, as a multiple of that of rounding, up to which a sensor at rest may read the
same number all the time: that of noise of 0.4 steps."""

_TOGETHER = 2**16
"""Windows of which the sums are taken together: what a processor keeps at hand is small."""
_BINS = np.linspace(-40.0, 40.0, 4001)  # decades of variance


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


class Windows:
    """Windows that slide over the samples of a log by one sample; none spans a gap.

    Attributes
    ----------
    log : Recording
    width : int, samples of a window; odd
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
        time, forces = log.time, log.forces
        firsts = np.cumsum(log.lengths)[:-1]
        jumps = np.diff(time) > GAP_RATIO * log.step
        jumps[firsts - 1] = False
        self.gaps = int(jumps.sum())
        self.variance = np.full(len(time), np.nan)
        self.frozen = np.zeros(len(time), dtype=bool)
        half = width // 2
        pieces = sorted([0, *firsts.tolist(), *(1 + np.flatnonzero(jumps)).tolist(), len(time)])
        for start, end in pairwise(pieces):
            for first in range(start, end - width + 1, _TOGETHER):
                beyond = min(first + _TOGETHER + width - 1, end)
                middle = slice(first + half, beyond - half)
                self.variance[middle], self.frozen[middle] = window_variance(
                    forces[first:beyond], width
                )
        self.centred = np.isfinite(self.variance)
        if not self.centred.any():
            raise InputError(
                f"{log.path}: too few samples for a window of {width}, or gaps all over"
                f"{log.unit_hint()}"
            )

    @classmethod
    def lasting(cls, log: Recording, seconds: float | None = None) -> Windows:
        """Windows of a length in s, by default the usual one.

        Raises
        ------
        InputError
            If their samples are too few for a variance, or so many that the rate must be wrong.
        """
        window = usual_window(log) if seconds is None else seconds
        samples = window / log.step
        if not MIN_SAMPLES <= samples <= MAX_SAMPLES:
            raise InputError(
                f"{log.path}: a window of {window:g} s holds {samples:.3g} samples, at "
                f"{1 / log.step:.6g} per second"
                f"{log.unit_hint() or '; is the rate (`rate`) right?'}"
            )
        return cls(log, round(samples) | 1)

    @cached_property
    def counts(self) -> NDArray[np.int_]:
        """Histogram of the variances of windows in which no channel is frozen."""
        return _histogram(self.variance[self.centred & ~self.frozen])

    @cached_property
    def extremes(self) -> Array:
        """Two lowest and two highest readings, the outermost first, (2, 2, 3)."""
        ends = np.array([[[np.inf] * 3] * 2, [[-np.inf] * 3] * 2])
        for axis, force in enumerate(self.log.forces.T):
            for end, pick, rest in ((0, np.min, np.greater), (1, np.max, np.less)):
                for k in range(2):
                    others = self.centred & rest(force, ends[end, 0, axis]) if k else self.centred
                    ends[end, k, axis] = pick(force, where=others, initial=ends[end, k, axis])
        return ends

    @cached_property
    def steps(self) -> Array:
        """Steps in which the axes are read, (3,), m/s²; 0 where there are none."""
        return np.array([step_in(force[self.centred]) for force in self.log.forces.T])

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
        noise = _noise_floor(self._all_counts)
        return bool(
            noise <= MAX_COARSE_RATIO * self.rounding or noise > MAX_REST_NOISE * STANDARD_GRAVITY
        )

    @cached_property
    def _all_counts(self) -> NDArray[np.int_]:
        return self.counts + _histogram(self.variance[self.frozen])

    def are_at_rest(self, sd: float) -> NDArray[np.bool_]:
        """Whether the window about each sample is at rest, (n,), up to a standard deviation."""
        return (self.variance <= sd**2) & (self.coarse | ~self.frozen)

    def warnings(self) -> list[str]:
        """What a user should know of the log."""
        said = []
        if self.gaps:
            said.append(f"{plural(self.gaps, 'gap')} in time; no hold spans one")
        if self.frozen.any() and not self.coarse:
            share = 100 * self.frozen.sum() / self.centred.sum()
            said.append(
                f"a channel does not change over a window in {share:.2g} % of the log; left out"
            )
        return said

    def quietest(self) -> float:
        """Standard deviation that a hundredth of the windows does not exceed, m/s²."""
        rank = np.searchsorted(np.cumsum(self.counts), 0.01 * self.counts.sum())
        return float(10.0 ** (_BINS[min(rank, len(_BINS) - 2) + 1] / 2))

    def threshold(self, given: float | None = None) -> Threshold:
        """Threshold that a person chose, m/s², or a multiple of the noise floor.

        Otsu's method finds the valley between rest and motion in the histogram of the logarithmic
        variances. At rest they crowd around one value, the noise floor; in motion they spread over
        decades. A channel that does not change is frozen, unless its steps explain it; no window
        has less noise than that of rounding.

        The multiple is 3, since noise differs between attitudes. It is up to 10 as long as the
        threshold is below 0.003 g: a quiet sensor feels footsteps and pumps, and whatever moves
        less than that in a second is not being turned.
        """
        if given is not None:
            return Threshold(given, np.nan, "as given")
        counts = self.counts
        if self.coarse:
            counts = self._all_counts.copy()
            least = int(np.searchsorted(_BINS, 2 * np.log10(self.rounding)))
            counts[least] += counts[:least].sum() + np.sum(self.variance == 0)
            counts[:least] = 0
        if not counts.any():
            raise InputError(
                f"{self.log.path}: a channel does not change in any window; is it frozen?"
            )
        noise = _noise_floor(counts)
        sd = max(THRESHOLD_FACTOR * noise, min(QUIET_FACTOR * noise, QUIET))
        reason = f"{sd / noise:.3g} times the noise floor of {noise:.3g} m/s²"
        return Threshold(sd, noise, f"{reason}, the sd of most windows at rest")


def usual_window(log: Recording) -> float:
    """Length of a window, s: 1 s, or 9 samples of a slow log if its unit of time is plausible."""
    return 1.0 if log.unit_hint() else max(1.0, (MIN_SAMPLES + 1) * log.step)


def window_variance(forces: Array, width: int) -> tuple[Array, NDArray[np.bool_]]:
    """Norm of the variances of the axes in each window, and whether an axis does not change."""
    squares = np.zeros(len(forces) - width + 1)
    frozen = np.zeros(len(squares), dtype=bool)
    for force in forces.T:
        # Squares of large numbers lose digits.
        offsets = force - force.mean()
        mean = _window_sums(offsets, width) / width
        variance = _window_sums(offsets**2, width) / width - mean**2
        squares += np.maximum(variance, 0.0) ** 2
        # Rounding may hide a variance of zero, so changes are counted.
        changes = np.concatenate([[0], np.cumsum(force[1:] != force[:-1])])
        frozen |= changes[width - 1 :] == changes[: len(frozen)]
    return np.sqrt(squares), frozen


def _window_sums(values: Array, width: int) -> Array:
    """Sums of `width` neighbours, each of its own values: a large one costs others no digits.

    A window is the end of one part of so many values and the beginning of the next part.
    """
    parts = np.zeros((-(-len(values) // width), width))
    parts.ravel()[: len(values)] = values
    ends = np.cumsum(parts[:, ::-1], axis=1)[:, ::-1]
    ends[:, 0] = 0.0  # a window that is a whole part
    sums: Array = np.cumsum(parts, axis=1).ravel()[width - 1 : len(values)]
    sums += ends.ravel()[: len(sums)]
    return sums


def _histogram(variance: Array) -> NDArray[np.int_]:
    """Numbers of windows by the logarithms of their variances."""
    with np.errstate(divide="ignore"):  # what is zero has no bin
        decades = np.log10(variance)
    # Bins of equal width, which numpy finds faster than those of an array.
    counts: NDArray[np.int_] = np.histogram(decades, len(_BINS) - 1, (_BINS[0], _BINS[-1]))[0]
    return counts


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
