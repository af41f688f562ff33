"""Windows of a log: the noise about each sample, and the threshold that separates rest from motion.

The detector is that of Tedaldi, Pretto and Menegatti (ICRA 2014): it compares the norm of the
variances of the three axes in a window with a threshold, which comes from the data.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pandas as pd
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
"""Windows that are worked out together: what a processor keeps at hand is small."""
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

    A channel that does not change in a window is frozen, unless the steps in which it is read
    explain it: then no window has less noise than that of rounding.

    Attributes
    ----------
    log : Recording
    width : int, samples of a window; odd
    gaps : int, gaps in time within a recording
    centred : (n,) bool array, where there is a window
    frozen : float, share of the windows in which a channel is frozen
    steps : (3,) array, m/s², in which the axes are read; 0 where there are none
    variance : (n,) array, (m/s²)², norm of the variances of the axes in the window about each
        sample; NaN about those too near to a gap or an end for a window, and if it is frozen

    Raises
    ------
    InputError
        If the log cannot be read, or is too short for a window.
    """

    def __init__(self, log: Recording, width: int) -> None:
        self.log, self.width = log, width
        half = width // 2
        jumps = np.diff(log.time) > GAP_RATIO * log.step
        firsts = np.cumsum(log.lengths)[:-1] - 1
        jumps[firsts] = False
        self.gaps = int(jumps.sum())
        jumps[firsts] = True
        piece = np.concatenate([[0], np.cumsum(jumps)])
        self.variance, frozen = window_variance(log.forces, width)
        self.variance[half : len(piece) - half][piece[2 * half :] != piece[: -2 * half]] = np.nan
        self.centred = np.isfinite(self.variance)
        if not self.centred.any():
            raise InputError(
                f"{log.path}: too few samples for a window of {width}, or gaps all over"
                f"{log.unit_hint()}"
            )
        self.steps = np.array([step_in(force[self.centred]) for force in log.forces.T])
        self.frozen = 0.0
        if self._rounding_explains_the_least():
            np.maximum(self.variance, self.rounding**2, out=self.variance)
        else:
            self.frozen = np.sum(frozen & self.centred) / self.centred.sum()
            self.variance[frozen] = np.nan

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

    @property
    def rounding(self) -> float:
        """Noise of a window by rounding alone, m/s²."""
        return float(np.sqrt(np.linalg.norm(self.steps**2 / 12)))

    def _rounding_explains_the_least(self) -> bool:
        """Whether the steps explain that a channel at rest does not change over a window.

        If all windows that change are motion, nothing else explains it either.
        """
        if not self.rounding > 0:
            return False
        noise = _noise_floor(self.variance)
        most = MAX_COARSE_RATIO * self.rounding
        return noise <= most or noise > MAX_REST_NOISE * STANDARD_GRAVITY

    @cached_property
    def extremes(self) -> Array:
        """Two lowest and two highest readings, the outermost first, (2, 2, 3)."""
        ends = np.empty((2, 2, 3))
        for axis, force in enumerate(self.log.forces.T):
            read = force[self.centred]
            low, high = read.min(), read.max()
            ends[0, :, axis] = low, np.min(read, where=read > low, initial=np.inf)
            ends[1, :, axis] = high, np.max(read, where=read < high, initial=-np.inf)
        return ends

    def warnings(self) -> list[str]:
        """What a user should know of the log."""
        said = []
        if self.gaps:
            said.append(f"{plural(self.gaps, 'gap')} in time; no hold spans one")
        if self.frozen:
            share = f"{100 * self.frozen:.2g} %"
            said.append(f"a channel does not change over a window in {share} of the log; left out")
        return said

    def threshold(self, given: float | None = None) -> Threshold:
        """Threshold that a person chose, m/s², or a multiple of the noise floor.

        The multiple is 3, since noise differs between attitudes. It is up to 10 as long as the
        threshold is below 0.003 g: a quiet sensor feels footsteps and pumps, and whatever moves
        less than that in a second is not being turned.
        """
        if given is not None:
            return Threshold(given, np.nan, "as given")
        noise = _noise_floor(self.variance)
        if not np.isfinite(noise):
            raise InputError(
                f"{self.log.path}: a channel does not change in any window; is it frozen?"
            )
        sd = max(THRESHOLD_FACTOR * noise, min(QUIET_FACTOR * noise, QUIET))
        reason = f"{sd / noise:.3g} times the noise floor of {noise:.3g} m/s²"
        return Threshold(sd, noise, f"{reason}, the sd of most windows at rest")


def usual_window(log: Recording) -> float:
    """Length of a window, s: 1 s, or 9 samples of a slow log if its unit of time is plausible."""
    return 1.0 if log.unit_hint() else max(1.0, (MIN_SAMPLES + 1) * log.step)


def window_variance(forces: Array, width: int) -> tuple[Array, NDArray[np.bool_]]:
    """Norm of the variances of the axes about each sample, (n,), and where an axis is constant."""
    variance, constant = np.full(len(forces), np.nan), np.zeros(len(forces), dtype=bool)
    for first in range(0, len(forces) - width + 1, _TOGETHER):
        block = forces[first : first + _TOGETHER + width - 1]
        ends, count = slice(width - 1, None), len(block) - width + 1
        middle = slice(first + width // 2, first + width // 2 + count)
        of_axes = pd.DataFrame(block).rolling(width).var(ddof=0).to_numpy()[ends]
        variance[middle] = np.sqrt(np.sum(of_axes**2, axis=1))
        # Rounding may hide a variance of zero, so changes are counted.
        changes = np.cumsum(np.diff(block, axis=0, prepend=block[:1]) != 0, axis=0)
        constant[middle] = np.any(changes[ends] == changes[:count], axis=1)
    return variance, constant


def _noise_floor(variance: Array) -> float:
    """Noise around which windows at rest crowd, m/s²; infinite without a window that changes.

    Otsu's method finds the valley between rest and motion in the histogram of the logarithmic
    variances. At rest they crowd around one value; in motion they spread over decades.
    """
    decades = np.log10(variance, where=variance > 0, out=np.full(len(variance), np.nan))
    # Bins of equal width, which numpy finds faster than those of an array.
    counts, _ = np.histogram(decades, len(_BINS) - 1, (_BINS[0], _BINS[-1]))
    if not counts.any():
        return np.inf
    middle = (_BINS[:-1] + _BINS[1:]) / 2
    quiet = np.where(middle <= _otsu(counts, middle), counts, 0)
    # Smoothed over a tenth of a decade, so that a short log with few windows has a peak, too.
    mode = middle[np.argmax(np.convolve(quiet, np.ones(5), "same"))]
    crowd = np.where(np.abs(middle - mode) <= np.log10(2), counts, 0)
    return float(np.sqrt(10.0 ** middle[np.searchsorted(np.cumsum(crowd), crowd.sum() / 2)]))


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
