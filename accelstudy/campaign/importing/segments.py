"""Runs of windows at rest, and the segments of the samples that they are."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy import special

from accelstudy.campaign.importing.allan import AllanMoments, allan_moments
from accelstudy.campaign.importing.recording import Samples
from accelstudy.campaign.importing.resolution import noise_before_rounding
from accelstudy.campaign.importing.windows import Threshold, Windows

Array = NDArray[np.float64]

SPANS = 1200
"""Spans of time of an envelope, about as many as a page can show."""
LONGEST_RECORD = 2**20
"""Samples of a hold that are used for the Allan deviation; later ones count for the mean only."""
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
    segments : mapping of int to Segment, by the numbers that figures and options use
    saturated, wandering : int, runs at rest that are no holds: the sensor is saturated, or it turns
        slowly
    short : tuple of float, s, lengths of the rests that are too short to be holds
    envelope : Envelope, of the log, for its figure
    left_out : mapping of int to str, segments that are no positions, and why
    size : int, samples of each, or of the shortest, if the log consists of blocks
    """

    segments: Mapping[int, Segment]
    saturated: int
    wandering: int
    short: tuple[float, ...]
    envelope: Envelope
    left_out: Mapping[int, str] = field(default_factory=dict)
    size: int | None = None


def segment_logs(
    windows: Sequence[Windows],
    thresholds: Sequence[Threshold],
    trim: float,
    shortest: float,
    full_range: float,
    one_each: bool,
) -> list[Segmentation]:
    """Segments in which all sensors rest, of logs with simultaneous samples.

    Parameters
    ----------
    windows, thresholds : sequences, one for each sensor
    trim : float, s, cut off at both ends of a run
    shortest : float, s, least length of what is left
    full_range : float, m/s², the sensors measure ± this
    one_each : bool, whether the logs have several recordings with one position each: the longest
        segment, which gets the number of the recording
    """
    step = windows[0].log.step
    cut, least = round(trim / step), max(2, round(shortest / step))
    still = np.all([w.at_rest(t.sd) for w, t in zip(windows, thresholds, strict=True)], axis=0)
    edges = np.flatnonzero(np.diff(still, prepend=False, append=False)).reshape(-1, 2)
    rests = [slice(first + cut, end - cut) for first, end in edges.tolist()]
    rested = [rest.stop - rest.start for rest in rests]
    holds = [rest for rest, n in zip(rests, rested, strict=True) if n >= least]
    lost = 2 * cut + windows[0].width
    short = tuple((n + lost) * step for n in rested if SHORTEST <= n < least)
    kept, counts = [], []
    for each, threshold in zip(windows, thresholds, strict=True):
        samples = each.log.samples
        segments: list[Segment | None] = [Segment.of(samples, hold) for hold in holds]
        full = find_saturated(each, holds, full_range)
        # A sensor that turns slowly is nearly still in each window, yet has no constant attitude:
        # its force changes over the run by more than within each of them.
        limit = (WANDERING * threshold.sd) ** 2
        wanders = [not f and s.variance > limit for f, s in zip(full, segments, strict=True) if s]
        counts.append((sum(full), sum(wanders)))
        out = np.logical_or(full, wanders)
        kept.append([None if none else s for none, s in zip(out, segments, strict=True)])
    recordings = [int(windows[0].log.samples.recording[hold.start]) for hold in holds]
    groups = [
        (recording, group)
        for recording, group in zip(recordings, map(list, zip(*kept, strict=True)), strict=True)
        if any(group)
    ]
    numbered = _numbered(groups, one_each)
    return [
        Segmentation(
            {n: part for n, group in numbered.items() if (part := group[i]) is not None},
            *counts[i],
            short,
            Envelope(each),
        )
        for i, each in enumerate(windows)
    ]


def _numbered(
    groups: Sequence[tuple[int, list[Segment | None]]], one_each: bool
) -> dict[int, list[Segment | None]]:
    """Number the holds: in order, or the longest of each recording by the recording's number."""
    if not one_each:
        return {number: group for number, (_, group) in enumerate(groups, 1)}
    by_length = sorted(groups, key=lambda group: max(part.n for part in group[1] if part))
    longest = {recording + 1: group for recording, group in by_length}
    return dict(sorted(longest.items()))


@dataclass(frozen=True)
class Segment:
    """The samples of one hold.

    Attributes
    ----------
    start, end : int, first sample, and the one after the last
    t0, t1 : float, s, times of the first and of the last sample
    n : int, samples
    mean : (3,) array, m/s², mean specific force
    products : (3, 3) array, (m/s²)², sums of products of the deviations from the mean
    conditions : (3, k) array, number, sum and sum of squares of what else was measured
    noise : tuple of AllanMoments, of the forces, one for each uninterrupted part
    """

    start: int
    end: int
    t0: float
    t1: float
    n: int
    mean: Array
    products: Array
    conditions: Array
    noise: tuple[AllanMoments, ...]

    @classmethod
    def of(cls, samples: Samples, chosen: slice) -> Segment:
        """Segment of neighbouring samples."""
        time, forces, conditions, *_ = (values[chosen] for values in samples)
        mean = forces.mean(axis=0)
        centred = forces - mean
        measured = np.isfinite(conditions)
        values = np.where(measured, conditions, 0.0)
        return cls(
            chosen.start,
            chosen.stop,
            float(time[0]),
            float(time[-1]),
            len(time),
            mean,
            centred.T @ centred,
            np.array([measured.sum(axis=0), values.sum(axis=0), (values**2).sum(axis=0)]),
            (allan_moments(forces[:LONGEST_RECORD]),),
        )

    @property
    def covariance(self) -> Array:
        """Covariance of the samples of the axes, (3, 3), (m/s²)²."""
        return self.products / (self.n - 1)

    @property
    def sd(self) -> Array:
        """Standard deviation of the samples of the axes, (3,), m/s²."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def variance(self) -> float:
        """Norm of the variances of the axes, the measure of the detector, (m/s²)²."""
        return float(np.linalg.norm(np.diag(self.covariance)))

    def __add__(self, later: Segment) -> Segment:
        """Both holds as one, without the samples between them (Chan, Golub and LeVeque 1979)."""
        n, step = self.n + later.n, later.mean - self.mean
        return Segment(
            self.start,
            later.end,
            self.t0,
            later.t1,
            n,
            self.mean + step * later.n / n,
            self.products + later.products + np.outer(step, step) * self.n * later.n / n,
            self.conditions + later.conditions,
            self.noise + later.noise,
        )


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
