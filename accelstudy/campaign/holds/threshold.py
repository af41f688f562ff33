"""The threshold that separates rest from motion, chosen from the noise of the log itself."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.errors import InputError
from accelstudy.basics.progress import track
from accelstudy.basics.units import STANDARD_GRAVITY
from accelstudy.basics.wording import counted
from accelstudy.campaign.holds.windows import Windows, windows
from accelstudy.campaign.logs.recording import Recording

Array = NDArray[np.float64]

FACTOR = 3.0
"""Threshold over noise floor; it leaves room for noise that differs between attitudes."""
QUIET_FACTOR, QUIET = 10.0, 0.003 * STANDARD_GRAVITY
"""The same for a quiet sensor, and the largest threshold that it may give, m/s²."""

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


class Survey:
    """Noise and extremes of a log, collected in a first pass over its windows."""

    def __init__(self) -> None:
        self.counts = np.zeros(len(_BINS) - 1, dtype=int)
        self.total = self.frozen = self.gaps = 0
        self.span = (np.nan, np.nan)
        # Per axis the lowest and the highest value, and the ones next to them.
        self.extremes = np.array([[[np.inf] * 3] * 2, [[-np.inf] * 3] * 2])

    def add(self, batch: Windows) -> None:
        """Add windows, in their order."""
        self.gaps = batch.piece - batch.recording
        if not len(batch.time):
            return
        self.span = (batch.time[0] if np.isnan(self.span[0]) else self.span[0], batch.time[-1])
        self.total += len(batch.time)
        self.frozen += int(batch.frozen.sum())
        alive = batch.variance[~batch.frozen & (batch.variance > 0)]
        self.counts += np.histogram(np.log10(alive), _BINS)[0]
        self.extremes[0] = _two_lowest(self.extremes[0], batch.forces)
        self.extremes[1] = -_two_lowest(-self.extremes[1], -batch.forces)

    def quietest(self, share: float = 0.01) -> float:
        """Standard deviation that this share of the windows does not exceed, m/s²."""
        rank = np.searchsorted(np.cumsum(self.counts), share * self.counts.sum())
        return float(10.0 ** (_BINS[min(rank, len(_BINS) - 2) + 1] / 2))

    def warnings(self) -> Iterator[str]:
        """What the user should know about the log."""
        if self.gaps:
            yield f"{counted(self.gaps, 'gap')} in time; no hold spans one"
        if self.frozen:
            share = 100 * self.frozen / self.total
            yield f"a channel does not change over a window in {share:.2g} % of the log; left out"


def _two_lowest(before: Array, forces: Array) -> Array:
    """Lowest value of each axis and the one next to it, (2, 3), with those before."""
    candidates = np.vstack([before, forces])
    lowest = candidates.min(axis=0)
    return np.array([lowest, np.where(candidates > lowest, candidates, np.inf).min(axis=0)])


def survey_log(log: Recording, width: int) -> Survey:
    """Read a log once, in windows of `width` samples."""
    survey = Survey()
    for batch in track(windows(log, width), f"noise of {log.path.name}"):
        survey.add(batch)
    if not survey.total:
        raise InputError(
            f"{log.path}: too few samples for a window of {width}, or gaps all over"
            f"{log.likely_unit()}"
        )
    return survey


def given_threshold(sd: float) -> Threshold:
    """Threshold that a person chose, m/s²."""
    if not (np.isfinite(sd) and sd > 0):
        raise InputError(f"threshold: must be positive, not {sd:g}")
    return Threshold(sd, np.nan, "as given")


def choose_threshold(survey: Survey, log: Recording) -> Threshold:
    """Choose a multiple of the noise floor, which is the usual noise of windows at rest.

    Otsu's method finds the valley between rest and motion in the histogram of the logarithmic
    variances. At rest they crowd around one value, the noise floor; in motion they spread over
    decades.

    The multiple is 3, since noise differs between attitudes. It is up to 10 as long as the
    threshold is below 0.003 g: a quiet sensor feels footsteps and pumps, and whatever moves less
    than that in a second is not being turned.
    """
    counts = survey.counts
    if not counts.any():
        raise InputError(f"{log.path}: a channel does not change in any window; is it frozen?")
    middle = (_BINS[:-1] + _BINS[1:]) / 2
    quiet = np.where(middle <= _otsu(counts, middle), counts, 0)
    # Smoothed over a tenth of a decade, so that a short log with few windows has a peak, too.
    mode = middle[np.argmax(np.convolve(quiet, np.ones(5), "same"))]
    crowd = np.where(np.abs(middle - mode) <= np.log10(2), counts, 0)
    floor = 10.0 ** middle[np.searchsorted(np.cumsum(crowd), crowd.sum() / 2)]
    noise = float(np.sqrt(floor))
    sd = max(FACTOR * noise, min(QUIET_FACTOR * noise, QUIET))
    return Threshold(
        sd,
        noise,
        f"{sd / noise:.3g} times the noise floor of {noise:.3g} m/s², "
        "around which windows at rest crowd",
    )


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
