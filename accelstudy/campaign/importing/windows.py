"""Windows of a log: the noise about each sample, and the threshold that separates rest from motion.

The detector is that of Tedaldi, Pretto and Menegatti (ICRA 2014): it compares the norm of the
variances of the three axes in a window with a threshold, which comes from the data.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from accelstudy.basics.arrays import Array
from accelstudy.basics.errors import InputError
from accelstudy.basics.units import STANDARD_GRAVITY
from accelstudy.basics.wording import plural
from accelstudy.campaign.importing.columns import AXES
from accelstudy.campaign.importing.log import GAP_RATIO, Log
from accelstudy.campaign.importing.noise import step_in

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


class Windows(NamedTuple):
    """Windows that slide over the samples of a log by one sample; none spans a gap.

    A channel that does not change in a window is frozen, unless the steps in which it is read
    explain it: then no window has less noise than that of rounding.

    Attributes
    ----------
    width : int, samples of a window; odd
    variance : (n,) array, (m/s²)², norm of the variances of the axes in the window about each
        sample; NaN about those too near to a gap or an end for a window, and if it is frozen
    about : slice or (n,) bool array, samples about which there is a window
    steps : (3,) array, m/s², in which the axes are read; 0 where there are none
    warnings : list of str
    threshold : float, m/s²; a window with at most this standard deviation (the root of the norm of
        the variances of its axes) is at rest
    floor : float, m/s², standard deviation of the noise by the same measure; NaN if not needed
    reason : str, how the threshold was chosen
    """

    width: int
    variance: Array
    about: slice | NDArray[np.bool_]
    steps: Array
    warnings: list[str]
    threshold: float = np.nan
    floor: float = np.nan
    reason: str = ""


def usual_window(log: Log) -> float:
    """Length of a window, s: 1 s, or 9 samples of a slow log if its unit of time is plausible."""
    return 1.0 if log.unit_hint() else max(1.0, (MIN_SAMPLES + 1) * log.step)


def windows_at_rest(log: Log, seconds: float | None = None, given: float | None = None) -> Windows:
    """Windows of a length in s, with the threshold, m/s², that separates rest from motion.

    Unless it is given it is a multiple of the noise floor: 3, since noise differs between
    attitudes; up to 10 as long as it is below 0.003 g. A quiet sensor feels footsteps and pumps,
    and whatever moves less than that in a second is not being turned.

    Raises
    ------
    InputError
        If the samples of a window are too few for a variance, or so many that the rate must be
        wrong, or a channel is frozen.
    """
    window = seconds or usual_window(log)
    samples = window / log.step
    if not MIN_SAMPLES <= samples <= MAX_SAMPLES:
        raise InputError(
            f"{log.path}: a window of {window:g} s holds {samples:.3g} samples, at "
            f"{1 / log.step:.6g} per second{log.unit_hint() or '; is the rate (`rate`) right?'}"
        )
    windows = slide_windows(log, round(samples) | 1)
    if given is not None:
        return windows._replace(threshold=given, reason="as given")
    floor = _noise_floor(windows.variance)
    if not np.isfinite(floor):
        raise InputError(f"{log.path}: a channel does not change in any window; is it frozen?")
    threshold = max(THRESHOLD_FACTOR * floor, min(QUIET_FACTOR * floor, QUIET))
    reason = f"{threshold / floor:.3g} times the noise floor of {floor:.3g} m/s²"
    reason += ", the sd of most windows at rest"
    return windows._replace(threshold=threshold, floor=floor, reason=reason)


def slide_windows(log: Log, width: int) -> Windows:
    """Windows of so many samples; raises `InputError` if the log is too short for one."""
    half, part = width // 2, log.part
    piece = np.cumsum((np.diff(log.time) > GAP_RATIO * log.step) | (np.diff(part) > 0))
    gaps = int(piece[-1]) - int(part[-1])
    variance, frozen = window_variance(log.forces, width)
    if piece[-1]:
        piece = np.concatenate([[0], piece])
        variance[half : len(piece) - half][piece[2 * half :] != piece[: -2 * half]] = np.nan
    covered = np.isfinite(variance)
    if not covered.any():
        raise InputError(
            f"{log.path}: too few samples for a window of {width} samples, or gaps all over"
            f"{log.unit_hint()}"
        )
    # A part of an array is no copy of it.
    whole = slice(half, len(covered) - half)
    about = whole if covered[whole].all() else covered
    steps = np.array([step_in(force[about]) for force in log.forces.T])
    warnings = [f"{plural(gaps, 'gap')} in time; no hold spans one"] if gaps else []
    rounding = noise_of_steps(steps)
    floor = _noise_floor(variance) if rounding else 0.0
    # If all windows that change are motion, nothing else explains that others do not.
    if 0 < floor <= MAX_COARSE_RATIO * rounding or floor > MAX_REST_NOISE * STANDARD_GRAVITY:
        np.maximum(variance, rounding**2, out=variance)
    elif (share := np.sum(frozen & covered) / covered.sum()) > 0:
        variance[frozen] = np.nan
        first = int(np.argmax(frozen & covered))
        readings = log.layout.axes.from_frd(log.forces[first - half : first + half + 1])
        axis = int(np.argmin(np.ptp(readings, axis=0)))
        name = log.raw.names[log.places[AXES[axis]]]
        warnings.append(
            f"a channel does not change over a window in {100 * share:.2g} % of the log; left out, "
            f"as stuck or saturated; the first: {name}, {readings[0, axis]:.4g} m/s² at "
            f"{log.time[first]:.1f} s"
        )
    return Windows(width, variance, about, steps, warnings)


def noise_of_steps(steps: Array) -> float:
    """Noise of a window by rounding alone, m/s²."""
    return float(np.sqrt(np.linalg.norm(steps**2 / 12)))


def window_variance(forces: Array, width: int) -> tuple[Array, NDArray[np.bool_]]:
    """Norm of the variances of the axes about each sample, (n,), and where an axis is constant."""
    variance, constant = np.full(len(forces), np.nan), np.zeros(len(forces), dtype=bool)
    for first in range(0, len(forces) - width + 1, _TOGETHER):
        block = forces[first : first + _TOGETHER + width - 1]
        middle = slice(first + width // 2, first + len(block) - width // 2)
        of_axes = pd.DataFrame(block).rolling(width).var(ddof=0).to_numpy()[width - 1 :]
        variance[middle] = np.sqrt(np.sum(of_axes**2, axis=1))
        # Rounding may hide a variance of zero, so readings that do not change are counted.
        same = np.diff(block, axis=0, prepend=block[:1]) == 0
        if np.count_nonzero(same, axis=0).max() >= width:
            alike = np.cumsum(same, axis=0)
            still = alike[width - 1 :] - alike[: 1 - width] == width - 1
            constant[middle] = np.any(still, axis=1)
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
