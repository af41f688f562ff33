"""Runs of windows at rest, and the segments of the samples that they are."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy import special

from accelstudy.campaign.importing.recording import Samples
from accelstudy.campaign.importing.resolution import noise_before_rounding
from accelstudy.campaign.importing.settings import ImportSettings
from accelstudy.campaign.importing.windows import Threshold, Windows, threshold_of

Array = NDArray[np.float64]

SPANS = 1200
"""Spans of time of an envelope, about as many as a page can show."""
SATURATED = 0.05
"""A hold is useless if more than this share of its samples is at the end of the scale."""
BEYOND, SURE = 5.0, 3.0
"""Samples that rounding alone would hardly leave out beyond the largest one (e⁻⁵), and standard
deviations by which those at the largest one may exceed what it then explains."""
SHORTEST = 8
"""Samples left of a rest from which on it is told; a sensor that turns back is still for fewer."""
WANDERING = 2.0
"""A hold whose standard deviation is more than this many thresholds of a window is none."""


@dataclass(frozen=True)
class Segmentation:
    """What one of several sensors shows.

    Attributes
    ----------
    windows, threshold : Windows, Threshold, by which it was judged
    segments : mapping of int to Segment, by the numbers that figures and options use
    saturated, wandering : int, runs at rest that are no holds: the sensor is saturated, or it turns
        slowly
    short : tuple of float, s, lengths of the rests that are too short to be holds
    left_out : mapping of int to str, segments that are no positions, and why
    size : int, samples of each, or of the shortest, if the log consists of blocks
    """

    windows: Windows
    threshold: Threshold
    segments: Mapping[int, Segment]
    saturated: int = 0
    wandering: int = 0
    short: tuple[float, ...] = ()
    left_out: Mapping[int, str] = field(default_factory=dict)
    size: int | None = None


def segment_logs(
    windows: Sequence[Windows], settings: ImportSettings, one_each: bool
) -> list[Segmentation]:
    """Segments in which all sensors rest, of logs with simultaneous samples.

    Parameters
    ----------
    windows : sequence of Windows, one for each sensor
    settings : ImportSettings, of which those of the holds count
    one_each : bool, whether the logs have several recordings with one position each: the longest
        segment, which gets the number of the recording
    """
    step = windows[0].log.step
    cut, least = round(settings.trim_s / step), max(2, round(settings.shortest_s / step))
    thresholds = [threshold_of(each, settings.threshold_mps2) for each in windows]
    still = np.all([w.at_rest(t.sd) for w, t in zip(windows, thresholds, strict=True)], axis=0)
    edges = np.flatnonzero(np.diff(still, prepend=False, append=False)).reshape(-1, 2)
    rests = [slice(first + cut, end - cut) for first, end in edges.tolist()]
    rested = [rest.stop - rest.start for rest in rests]
    holds = [rest for rest, n in zip(rests, rested, strict=True) if n >= least]
    lost = 2 * cut + windows[0].width
    short = tuple((n + lost) * step for n in rested if SHORTEST <= n < least)
    kept: list[dict[int, Segment]] = []
    counts = []
    for each, threshold in zip(windows, thresholds, strict=True):
        full = find_saturated(each, holds, settings.full_range)
        segments = {
            i: Segment.of(each.log.samples, hold) for i, hold in enumerate(holds) if not full[i]
        }
        # A sensor that turns slowly is nearly still in each window, yet has no constant attitude:
        # its force changes over the run by more than within each of them.
        limit = (WANDERING * threshold.sd) ** 2
        kept.append({i: s for i, s in segments.items() if s.variance <= limit})
        counts.append((sum(full), len(segments) - len(kept[-1])))
    places = sorted(set().union(*kept))
    numbers = dict(enumerate(places, 1))
    if one_each:
        recording = windows[0].log.samples.recording
        by_length = sorted(places, key=lambda i: holds[i].stop - holds[i].start)
        longest = {int(recording[holds[i].start]) + 1: i for i in by_length}
        numbers = dict(sorted(longest.items()))
    return [
        Segmentation(
            windows[k],
            thresholds[k],
            {n: segments[i] for n, i in numbers.items() if i in segments},
            *counts[k],
            short,
        )
        for k, segments in enumerate(kept)
    ]


@dataclass(frozen=True)
class Segment:
    """The samples of one hold.

    Attributes
    ----------
    parts : tuple of slices of the samples of the log, each uninterrupted
    t0, t1 : float, s, times of the first and of the last sample
    n : int, samples
    mean : (3,) array, m/s², mean specific force
    covariance : (3, 3) array, (m/s²)², of the samples
    conditions : (2, k) array, mean and rms of what else was measured, NaN where nothing was
    records : tuple of (n, 3) arrays, m/s², the forces of each part
    """

    parts: tuple[slice, ...]
    t0: float
    t1: float
    n: int
    mean: Array
    covariance: Array
    conditions: Array
    records: tuple[Array, ...]

    @classmethod
    def of(cls, samples: Samples, *parts: slice) -> Segment:
        """Segment of the samples in some parts of a log, in their order."""
        records = tuple(samples.forces[part] for part in parts)
        forces = np.concatenate(records)
        conditions = np.concatenate([samples.conditions[part] for part in parts])
        measured = np.isfinite(conditions)
        values = np.where(measured, conditions, 0.0)
        with np.errstate(invalid="ignore"):
            known = [values.sum(axis=0), (values**2).sum(axis=0)] / measured.sum(axis=0)
        return cls(
            parts,
            float(samples.time[parts[0].start]),
            float(samples.time[parts[-1].stop - 1]),
            len(forces),
            forces.mean(axis=0),
            np.cov(forces, rowvar=False),
            np.array([known[0], np.sqrt(known[1])]),
            records,
        )

    @property
    def start(self) -> int:
        """First sample."""
        return int(self.parts[0].start)

    @property
    def end(self) -> int:
        """Sample after the last."""
        return int(self.parts[-1].stop)

    @property
    def sd(self) -> Array:
        """Standard deviation of the samples of the axes, (3,), m/s²."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def variance(self) -> float:
        """Norm of the variances of the axes, the measure of the detector, (m/s²)²."""
        return float(np.linalg.norm(np.diag(self.covariance)))


def find_saturated(windows: Windows, holds: Sequence[slice], full_range: float) -> list[bool]:
    """Tell whether samples of holds lie at the sensor's range or, if it is unknown, at the extreme.

    In a hold of n samples of which none lies beyond the last step, the mean may be so high that
    `BEYOND` of them were expected there. Those above the last edge but one are as many as the
    step, and the noise before rounding, explain.

    Parameters
    ----------
    windows : Windows
    holds : sequence of slices of the samples of the log
    full_range : float, m/s², the sensor measures ± this; infinite if unknown
    """
    forces = [windows.log.samples.forces[hold] for hold in holds]
    if np.isfinite(full_range) or not forces:
        # The largest reading of a converter is a step less than its range.
        return [at_range(each, full_range - windows.steps.max()) for each in forces]
    step, extremes = windows.steps, windows.extremes[:, :, None, :]
    noise = noise_before_rounding(step, np.median([f.std(axis=0, ddof=1) for f in forces], axis=0))
    with np.errstate(divide="ignore", invalid="ignore"):
        steps = np.where(step > 0, step / noise, 0.0)
    steps[noise == 0] = np.inf  # every reading is the same in most holds
    result = []
    for each in forces:
        n = len(each)
        end, beside = np.sum(each == extremes, axis=2).transpose(1, 0, 2)
        share = special.ndtr(steps + special.ndtri(min(BEYOND / n, 0.5)))
        explained = n * share + SURE * np.sqrt(n * share * (1 - share))
        piled = (end > np.maximum(SATURATED * n, explained)) & (end > beside)
        result.append(bool(np.any(piled)))
    return result


def at_range(forces: Array, full_range: float) -> bool:
    """Whether samples (n, 3) of a hold, m/s², lie at the sensor's range ±`full_range`."""
    # Conversion from counts or g rounds.
    beyond = np.abs(forces) >= full_range * (1 - 1e-9)
    return bool(np.any(beyond.sum(axis=0) > SATURATED * len(forces)))


class Envelope:
    """Least and largest values of the windows of a log in spans of time.

    Attributes
    ----------
    edges : (k + 1,) array, s, of the spans
    low, high : (k, 4) arrays, of fx, fy, fz and of the standard deviation of the windows, m/s²;
        NaN in a gap
    """

    def __init__(self, windows: Windows) -> None:
        time = windows.log.samples.time[windows.centred]
        count = max(1, min(SPANS, len(time) // 4))
        self.edges = np.linspace(time[0], time[-1], count + 1)
        self.low, self.high = np.full((2, count, 4), np.nan)
        span = np.clip(np.searchsorted(self.edges, time, side="right") - 1, 0, count - 1)
        first = np.flatnonzero(np.diff(span, prepend=-1))  # time goes on
        for i, values in enumerate([*windows.log.samples.forces.T, np.sqrt(windows.variance)]):
            self.low[span[first], i] = np.minimum.reduceat(values[windows.centred], first)
            self.high[span[first], i] = np.maximum.reduceat(values[windows.centred], first)

    def less(self, offset: Array) -> Envelope:
        """Envelope of the forces less an offset, (3,), m/s²."""
        shifted = copy(self)
        shifted.low, shifted.high = (values - [*offset, 0.0] for values in (self.low, self.high))
        return shifted
