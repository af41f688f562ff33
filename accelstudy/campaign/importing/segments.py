"""Runs of windows at rest, collected into the segments of a log while it is read a second time.

Of the samples of a hold only sums are kept, so that its length does not matter.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy import special

from accelstudy.basics.progress import stage
from accelstudy.campaign.importing.allan import AllanMoments, allan_moments
from accelstudy.campaign.importing.recording import Recording
from accelstudy.campaign.importing.resolution import noise_before_rounding
from accelstudy.campaign.importing.windows import Survey, Threshold, Windows

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
_NONE = np.empty((0, 1))  # rows


@dataclass(frozen=True)
class Segmentation:
    """What one of several sensors shows in the second reading.

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
    logs: Sequence[Recording],
    surveys: Sequence[tuple[Survey, Threshold]],
    trim: float,
    shortest: float,
    full_range: float,
    one_each: bool,
) -> list[Segmentation]:
    """Segments in which all sensors rest, of logs with simultaneous samples.

    Parameters
    ----------
    logs, surveys : sequences, one for each sensor, as of `surveyed`
    trim : float, s, cut off at both ends of a run
    shortest : float, s, least length of what is left
    full_range : float, m/s², the sensors measure ± this
    one_each : bool, whether the logs have several recordings with one position each: the longest
        segment, which gets the number of the recording
    """
    step = logs[0].step
    cut, least = round(trim / step), max(2, round(shortest / step))
    envelopes = [Envelope(survey.span, survey.total) for survey, _ in surveys]
    streams = [
        envelope.along(survey.kept.again())
        for envelope, (survey, _) in zip(envelopes, surveys, strict=True)
    ]
    groups: list[tuple[int, list[Segment | None]]] = []
    short: list[float] = []
    runs: list[tuple[list[GrowingHold], list[Segment]]] = []
    with stage("holds", surveys[0][0].total) as advance:
        for run in runs_at_rest(streams, surveys, cut, full_range, advance):
            if run[0].n >= least:
                runs.append((run, [hold.finish() for hold in run]))
            elif run[0].n >= SHORTEST:
                short.append((run[0].n + 2 * cut + surveys[0][0].width) * step)
    saturated, wandering = [0] * len(logs), [0] * len(logs)
    noise = [
        noise_before_rounding(survey.steps, np.median([s[i].sd for _, s in runs], axis=0))
        for i, (survey, _) in enumerate(surveys if runs else [])
    ]
    for holds, segments in runs:
        kept: list[Segment | None] = []
        for i, (hold, segment) in enumerate(zip(holds, segments, strict=True)):
            full = hold.saturated(surveys[i][0].steps, noise[i])
            # A sensor that turns slowly is nearly still in each window, yet has no constant
            # attitude: its force changes over the run by more than within each of them.
            wanders_off = not full and segment.variance > (WANDERING * surveys[i][1].sd) ** 2
            saturated[i] += full
            wandering[i] += wanders_off
            kept.append(None if full or wanders_off else segment)
        if any(kept):
            groups.append((holds[0].recording, kept))
    numbered = _numbered(groups, one_each)
    return [
        Segmentation(
            {n: part for n, group in numbered.items() if (part := group[i]) is not None},
            saturated[i],
            wandering[i],
            tuple(short),
            envelope,
        )
        for i, envelope in enumerate(envelopes)
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
class Moments:
    """Number, mean, and products of deviations from the mean of rows of c numbers.

    Attributes
    ----------
    n : int
    mean : (c,) array
    products : (c, c) array, sums over the rows
    """

    n: int
    mean: Array
    products: Array

    @classmethod
    def of(cls, rows: Array) -> Moments:
        """Moments of rows (n, c), n > 0."""
        mean = rows.mean(axis=0)
        centred = rows - mean
        return cls(len(rows), mean, centred.T @ centred)

    def __add__(self, other: Moments) -> Moments:
        """Both parts together (Chan, Golub and LeVeque 1979)."""
        n = self.n + other.n
        step = other.mean - self.mean
        return Moments(
            n,
            self.mean + step * other.n / n,
            self.products + other.products + np.outer(step, step) * self.n * other.n / n,
        )


@dataclass(frozen=True)
class Segment:
    """The samples of one hold.

    Attributes
    ----------
    start, end : int, first sample, and the one after the last
    t0, t1 : float, s, times of the first and of the last sample
    moments : Moments, of time and forces, c = 4, s and m/s²
    conditions : (3, k) array, number, sum and sum of squares of what else was measured
    noise : tuple of AllanMoments, of the forces, one for each uninterrupted part
    """

    start: int
    end: int
    t0: float
    t1: float
    moments: Moments
    conditions: Array
    noise: tuple[AllanMoments, ...]

    @property
    def n(self) -> int:
        """Number of samples."""
        return self.moments.n

    @property
    def mean(self) -> Array:
        """Mean specific force, (3,), m/s²."""
        return self.moments.mean[1:]

    @property
    def covariance(self) -> Array:
        """Covariance of the samples of the axes, (3, 3), (m/s²)²."""
        return self.moments.products[1:, 1:] / (self.n - 1)

    @property
    def sd(self) -> Array:
        """Standard deviation of the samples of the axes, (3,), m/s²."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def variance(self) -> float:
        """Norm of the variances of the axes, the measure of the detector, (m/s²)²."""
        return float(np.linalg.norm(np.diag(self.covariance)))

    def __add__(self, later: Segment) -> Segment:
        """Both holds as one, without the samples between them."""
        return Segment(
            self.start,
            later.end,
            self.t0,
            later.t1,
            self.moments + later.moments,
            self.conditions + later.conditions,
            self.noise + later.noise,
        )


class GrowingHold:
    """A hold while it grows.

    Its first `cut` samples are dropped. The latest `cut` samples wait until later ones arrive,
    since they are dropped if the hold ends.

    Parameters
    ----------
    start : int, first sample
    cut : int
    extremes : (2, 2, 3) array, the lowest and the highest value of each axis in the log, and the
        ones next to them
    full_range : float, m/s², the sensor measures ± this; infinite if unknown
    recording : int, in which of several recordings it lies
    """

    def __init__(
        self, start: int, cut: int, extremes: Array, full_range: float, recording: int
    ) -> None:
        self.start, self.n, self.recording = start + cut, 0, recording
        self.t0 = self.t1 = np.nan
        self._moments: Moments | None = None
        self._conditions = np.zeros((3, 0))
        self._extremes, self._at_extremes = extremes, np.zeros((2, 2, 3), dtype=int)
        # Conversion from counts or g rounds.
        self._range, self._beyond = full_range * (1 - 1e-9), np.zeros(3, dtype=int)
        self._cut, self._to_drop = cut, cut
        self._waiting = _NONE
        self._record: list[Array] = []
        self._recorded = 0

    def grow(self, batch: Windows, chosen: slice) -> None:
        """Add the samples that follow."""
        time = batch.time[chosen]
        dropped = min(self._to_drop, len(time))
        self._to_drop -= dropped
        columns = [time, *batch.forces[chosen].T, *batch.conditions[chosen].T]
        before = len(self._waiting)
        rows = np.empty((before + len(time) - dropped, len(columns)), order="F")
        rows[:before] = self._waiting
        for i, column in enumerate(columns):
            rows[before:, i] = column[dropped:]
        sure = max(0, len(rows) - self._cut)
        self._waiting = rows[sure:]
        if sure:
            self.keep(rows[:sure])

    def keep(self, rows: Array) -> None:
        """Keep samples (k, 4 + c) at once."""
        self.t0, self.t1 = (rows[0, 0] if not self.n else self.t0), rows[-1, 0]
        new = Moments.of(rows[:, :4])
        self._moments = new if self._moments is None else self._moments + new
        others = rows[:, 4:]
        measured = np.isfinite(others)
        values = np.where(measured, others, 0.0)
        sums = np.array([measured.sum(axis=0), values.sum(axis=0), (values**2).sum(axis=0)])
        self._conditions = self._conditions + sums if self.n else sums
        self.n += len(rows)
        forces = rows[:, 1:4]
        low, high = forces.min(axis=0), forces.max(axis=0)
        if np.any(low <= self._extremes[0, 1]) or np.any(high >= self._extremes[1, 1]):
            self._at_extremes += np.sum(forces == self._extremes[:, :, None, :], axis=2)
        if max(high.max(), -low.min()) >= self._range:
            self._beyond += np.sum(np.abs(forces) >= self._range, axis=0)
        kept = rows[: max(0, LONGEST_RECORD - self._recorded), :4]
        if len(kept):  # an empty part would hold on to all rows
            self._record.append(kept)
        self._recorded += len(kept)

    def finish(self) -> Segment:
        """Reduce the hold to its sums; the samples of all holds may not fit into memory."""
        assert self._moments is not None
        record, self._record, self._waiting = np.concatenate(self._record), [], _NONE
        moments = allan_moments(record)
        forces = np.eye(4)[:, 1:]
        return Segment(
            self.start,
            self.start + self.n,
            self.t0,
            self.t1,
            self._moments,
            self._conditions,
            (moments.turned(forces),),
        )

    def saturated(self, step: Array, noise: Array) -> bool:
        """Whether samples lie at the sensor's range or, if it is unknown, pile up at the extreme.

        In a hold of n samples of which none lies beyond the last step, the mean may be so high that
        `BEYOND` of them were expected there. Those above the last edge but one are as many as the
        step, and the noise before rounding, explain.

        Parameters
        ----------
        step, noise : (3,) arrays, m/s², of the axes; a step of 0 is none
        """
        if np.isfinite(self._range):
            return bool(np.any(self._beyond > SATURATED * self.n))
        end, beside = self._at_extremes[:, 0], self._at_extremes[:, 1]
        beyond = min(BEYOND / self.n, 0.5)
        with np.errstate(divide="ignore", invalid="ignore"):
            steps = np.where(step > 0, step / noise, 0.0)
        steps[noise == 0] = np.inf  # every reading is the same in most holds
        share = special.ndtr(steps + special.ndtri(beyond))
        explained = self.n * share + SURE * np.sqrt(self.n * share * (1 - share))
        piled = (end > np.maximum(SATURATED * self.n, explained)) & (end > beside)
        return bool(np.any(piled))


def runs_at_rest(
    streams: Sequence[Iterator[Windows]],
    surveys: Sequence[tuple[Survey, Threshold]],
    cut: int,
    full_range: float,
    advance: Callable[[float], None],
) -> Iterator[list[GrowingHold]]:
    """Runs of windows in which all sensors rest, cut at both ends; a run may have no samples left.

    Parameters
    ----------
    streams : sequence of iterators of Windows, of sensors that moved together; their samples are
        simultaneous
    surveys : of each sensor, as of `surveyed`
    cut : int, samples cut off at both ends
    full_range : float, m/s², the sensors measure ± this
    advance : callable, gets the number of windows that were processed
    """
    holds: list[GrowingHold] | None = None
    piece = 0
    for batches in zip(*streams, strict=True):
        first_batch = batches[0]
        advance(len(first_batch.time))
        if holds is not None and first_batch.piece != piece:
            yield holds
            holds = None
        piece = first_batch.piece
        still = np.all(
            [
                (batch.variance <= threshold.sd**2) & (survey.coarse | ~batch.frozen)
                for batch, (survey, threshold) in zip(batches, surveys, strict=True)
            ],
            axis=0,
        )
        edges = np.flatnonzero(np.diff(still, prepend=False, append=False))
        for first, end in edges.reshape(-1, 2).tolist():
            if holds is not None and first > 0:
                yield holds
                holds = None
            if holds is None:
                start = first_batch.index + first
                # The largest reading of a converter is a step less than its range.
                holds = [
                    GrowingHold(
                        start,
                        cut,
                        survey.extremes,
                        full_range - survey.steps.max(),
                        first_batch.recording,
                    )
                    for survey, _ in surveys
                ]
            for hold, batch in zip(holds, batches, strict=True):
                hold.grow(batch, slice(first, end))
            if end < len(still):
                yield holds
                holds = None
        if holds is not None and len(still) and not still[-1]:
            yield holds
            holds = None
    if holds is not None:
        yield holds


class Envelope:
    """Least and largest values of a log in spans of time, collected as its windows go by.

    Parameters
    ----------
    span : (float, float), s, times of the first and of the last window
    total : int, windows of the log

    Attributes
    ----------
    edges : (k + 1,) array, s, of the spans
    low, high : (k, 4) arrays, of fx, fy, fz and of the standard deviation of the windows, m/s²;
        NaN in a gap
    """

    def __init__(self, span: tuple[float, float], total: int) -> None:
        count = max(1, min(SPANS, total // 4))
        self.edges = np.linspace(*span, count + 1)
        self.low, self.high = np.full((2, count, 4), np.nan)

    def along(self, batches: Iterator[Windows]) -> Iterator[Windows]:
        """Pass windows on, and widen the envelope to hold them."""
        for batch in batches:
            values = np.column_stack([batch.forces, np.sqrt(batch.variance)])
            span = np.searchsorted(self.edges, batch.time, side="right") - 1
            span = np.clip(span, 0, len(self.low) - 1)
            first = np.flatnonzero(np.diff(span, prepend=-1))  # time goes on
            of = span[first]
            self.low[of] = np.fmin(self.low[of], np.fmin.reduceat(values, first))
            self.high[of] = np.fmax(self.high[of], np.fmax.reduceat(values, first))
            yield batch

    def less(self, offset: Array) -> Envelope:
        """Envelope of the forces less an offset, (3,), m/s²."""
        shifted = copy(self)
        shifted.low, shifted.high = (values - [*offset, 0.0] for values in (self.low, self.high))
        return shifted
