"""Windows of a log: the noise about each sample, and the threshold that separates rest from motion.

The detector is that of Tedaldi, Pretto and Menegatti (ICRA 2014): it compares the norm of the
variances of the three axes in a window with a threshold, which comes from the data.
"""

from __future__ import annotations

from dataclasses import dataclass

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
_DECADES, _PER_DECADE = 40, 50
"""Bins of the histogram of variances: decades on both sides of 1 (m/s²)², and bins of each."""


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

    Parameters
    ----------
    log : Recording
    width : int, samples of a window; odd

    Attributes
    ----------
    log, width
    steps : (3,) array, m/s², in which the axes are read; 0 where there are none
    rounding : float, m/s², noise of a window by rounding alone
    variance : (n,) array, (m/s²)², norm of the variances of the axes in the window about each
        sample; NaN about those too near to a gap or an end for a window, and if it is frozen
    centred : slice or (n,) bool array, of the samples about which there is a window
    warnings : list of str

    Raises
    ------
    InputError
        If the log is too short for a window.
    """

    def __init__(self, log: Recording, width: int) -> None:
        self.log, self.width, half = log, width, width // 2
        jumps = np.diff(log.time) > GAP_RATIO * log.step
        joints = np.cumsum(log.lengths)[:-1] - 1
        gaps = int(jumps.sum() - jumps[joints].sum())
        jumps[joints] = True
        self.variance, frozen = window_variance(log.forces, width)
        if jumps.any():
            piece = np.concatenate([[0], np.cumsum(jumps)])
            apart = piece[2 * half :] != piece[: -2 * half]
            self.variance[half : len(piece) - half][apart] = np.nan
        centred = np.isfinite(self.variance)
        if not centred.any():
            raise InputError(
                f"{log.path}: too few samples for a window of {width}, or gaps all over"
                f"{log.unit_hint()}"
            )
        # A part of an array is no copy of it.
        whole = slice(half, len(centred) - half)
        self.centred = whole if centred[whole].all() else centred
        self.steps = np.array([step_in(force[self.centred]) for force in log.forces.T])
        self.rounding = float(np.sqrt(np.linalg.norm(self.steps**2 / 12)))
        self.warnings = [f"{plural(gaps, 'gap')} in time; no hold spans one"] if gaps else []
        floor = _noise_floor(self.variance) if self.rounding else 0.0
        # If all windows that change are motion, nothing else explains that others do not.
        if (
            0 < floor <= MAX_COARSE_RATIO * self.rounding
            or floor > MAX_REST_NOISE * STANDARD_GRAVITY
        ):
            np.maximum(self.variance, self.rounding**2, out=self.variance)
        elif (share := np.sum(frozen & centred) / centred.sum()) > 0:
            self.variance[frozen] = np.nan
            self.warnings.append(
                f"a channel does not change over a window in {100 * share:.2g} % of the log; left "
                "out"
            )

    @classmethod
    def lasting(cls, log: Recording, seconds: float | None = None) -> Windows:
        """Windows of a length in s, by default the usual one.

        Raises
        ------
        InputError
            If their samples are too few for a variance, or so many that the rate must be wrong.
        """
        window = seconds or usual_window(log)
        samples = window / log.step
        if not MIN_SAMPLES <= samples <= MAX_SAMPLES:
            raise InputError(
                f"{log.path}: a window of {window:g} s holds {samples:.3g} samples, at "
                f"{1 / log.step:.6g} per second"
                f"{log.unit_hint() or '; is the rate (`rate`) right?'}"
            )
        return cls(log, round(samples) | 1)

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
        # Rounding may hide a variance of zero, so readings that do not change are counted.
        same = np.diff(block, axis=0, prepend=block[:1]) == 0
        if np.count_nonzero(same, axis=0).max() >= width:
            alike = np.cumsum(same, axis=0)
            constant[middle] = np.any(alike[ends] - alike[:count] == width - 1, axis=1)
    return variance, constant


def _noise_floor(variance: Array) -> float:
    """Noise around which windows at rest crowd, m/s²; infinite without a window that changes.

    Otsu's method finds the valley between rest and motion in the histogram of the logarithmic
    variances: it divides them into two classes with the largest variance between these. At rest
    they crowd around one value; in motion they spread over decades.
    """
    decades = np.log10(variance, where=variance > 0, out=np.full(len(variance), np.nan))
    bins = 2 * _DECADES * _PER_DECADE
    counts, edges = np.histogram(decades, bins, (-_DECADES, _DECADES))
    if not counts.any():
        return np.inf
    middle = (edges[:-1] + edges[1:]) / 2
    below, moment = np.cumsum(counts)[:-1].astype(float), np.cumsum(counts * middle)
    above = counts.sum() - below
    # An empty class has no mean, and no weight.
    low = moment[:-1] / np.maximum(below, 1)
    high = (moment[-1] - moment[:-1]) / np.maximum(above, 1)
    between = below * above * (high - low) ** 2
    best = np.flatnonzero(between >= between.max() * (1 - 1e-9))
    valley = middle[best[len(best) // 2]] if between.max() > 0 else middle[np.argmax(counts)]
    quiet = np.where(middle <= valley, counts, 0)
    # Smoothed over a tenth of a decade, so that a short log with few windows has a peak, too.
    mode = middle[np.argmax(np.convolve(quiet, np.ones(5), "same"))]
    crowd = np.where(np.abs(middle - mode) <= np.log10(2), counts, 0)
    return float(np.sqrt(10.0 ** middle[np.searchsorted(np.cumsum(crowd), crowd.sum() / 2)]))
