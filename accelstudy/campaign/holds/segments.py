"""Runs of windows at rest, collected into holds while a log is read.

Of the samples of a hold only sums are kept, so that its length does not matter.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from accelstudy.campaign.holds.allan import AllanMoments, allan_moments
from accelstudy.campaign.holds.windows import Windows

Array = NDArray[np.float64]

LONGEST_RECORD = 2**20
"""Samples of a hold that are used for the Allan deviation; later ones count for the mean only."""
SATURATED = 0.05
"""A hold is useless if more than this share of its samples is at the end of the scale."""


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
    noise, wobble : tuples of AllanMoments, of the forces, and of their residuals about a straight
        line in time; one for each uninterrupted part
    """

    start: int
    end: int
    t0: float
    t1: float
    moments: Moments
    conditions: Array
    noise: tuple[AllanMoments, ...]
    wobble: tuple[AllanMoments, ...]

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
    def slope(self) -> Array:
        """Slope of the forces over time by least squares, (3,), m/s²/s."""
        return self.moments.products[0, 1:] / self.moments.products[0, 0]

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
            self.wobble + later.wobble,
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
        self._range, self._beyond = full_range, np.zeros(3, dtype=int)
        self._cut, self._to_drop = cut, cut
        self._waiting: list[Array] = []
        self._record: list[Array] = []
        self._recorded = 0

    def grow(self, batch: Windows, chosen: slice) -> None:
        """Add the samples that follow, (k, 4 + c): time, forces, conditions."""
        rows = np.column_stack([batch.time, batch.forces, batch.conditions])[chosen]
        dropped = min(self._to_drop, len(rows))
        self._to_drop -= dropped
        rows = np.concatenate([*self._waiting, rows[dropped:]])
        sure = max(0, len(rows) - self._cut)
        self._waiting = [rows[sure:]]
        if sure:
            self._keep(rows[:sure])

    def _keep(self, rows: Array) -> None:
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
        self._at_extremes += np.sum(forces == self._extremes[:, :, None, :], axis=2)
        # Conversion from counts or g rounds.
        self._beyond += np.sum(np.abs(forces) >= self._range * (1 - 1e-9), axis=0)
        kept = rows[: max(0, LONGEST_RECORD - self._recorded), :4]
        self._record.append(kept.copy())
        self._recorded += len(kept)

    def finish(self) -> Segment:
        """Reduce the hold to its sums; the samples of all holds may not fit into memory."""
        assert self._moments is not None
        record, self._record, self._waiting = np.concatenate(self._record), [], []
        time, forces = record[:, 0], record[:, 1:]
        slope = self._moments.products[0, 1:] / self._moments.products[0, 0]
        about_line = forces - (time - time.mean())[:, None] * slope
        return Segment(
            self.start,
            self.start + self.n,
            self.t0,
            self.t1,
            self._moments,
            self._conditions,
            (allan_moments(forces),),
            (allan_moments(about_line),),
        )

    def saturated(self) -> bool:
        """Whether samples pile up at the end of the scale, or lie at the sensor's range.

        A coarse sensor that is not saturated reaches its largest value, too, but less often than
        the next one.
        """
        end, beside = self._at_extremes[:, 0], self._at_extremes[:, 1]
        piled = (end > SATURATED * self.n) & (end > beside)
        return bool(np.any(piled) or np.any(self._beyond > SATURATED * self.n))


def runs_at_rest(
    streams: Sequence[Iterator[Windows]],
    largest: Sequence[float],
    cut: int,
    extremes: Sequence[Array],
    full_range: float = np.inf,
    advance: Callable[[float], None] = lambda done: None,
) -> Iterator[list[GrowingHold]]:
    """Runs of windows in which all sensors rest, cut at both ends; a run may have no samples left.

    Parameters
    ----------
    streams : sequence of iterators of Windows, of sensors that moved together; their samples are
        simultaneous
    largest : variance up to which a window of each sensor is at rest, (m/s²)²
    cut : int, samples cut off at both ends
    extremes, full_range : as of `GrowingHold`, `extremes` for each sensor
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
                (batch.variance <= most) & ~batch.frozen
                for batch, most in zip(batches, largest, strict=True)
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
                holds = [
                    GrowingHold(start, cut, ends, full_range, first_batch.recording)
                    for ends in extremes
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
