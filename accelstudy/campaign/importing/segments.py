"""Runs of windows at rest, collected into holds while a log is read, and left out or joined.

Of the samples of a hold only sums are kept, so that its length does not matter.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.errors import InputError
from accelstudy.campaign.importing.allan import AllanMoments, allan_moments
from accelstudy.campaign.importing.windows import Windows

Array = NDArray[np.float64]

LONGEST_RECORD = 2**20
"""Samples of a hold that are used for the Allan deviation; later ones count for the mean only."""
SATURATED = 0.05
"""A hold is useless if more than this share of its samples is at the end of the scale."""

_BY_NUMBER = re.compile(r"\s*(\d{1,9})\s*:\s*(\S.*?)\s*")
_SPAN = re.compile(r"\s*(\d+(?:\.\d*)?)\s*s?\s*-\s*(\d+(?:\.\d*)?)\s*s\s*")
_BY_TIME = re.compile(_SPAN.pattern + r":\s*(\S.*?)\s*")


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


@dataclass(frozen=True)
class Selection:
    """Holds to leave out and to join, by the numbers that the detector gave them.

    Attributes
    ----------
    numbers : mapping of int to str, holds that are left out, with the reason
    spans : tuple of (from, to, reason), s since the start of the log; holds in them are left out
    joined : tuple of tuples of int, holds that are one hold
    joined_spans : tuple of (from, to), s since the start of the log; holds in one are one hold
    """

    numbers: Mapping[int, str] = field(default_factory=dict)
    spans: tuple[tuple[float, float, str], ...] = ()
    joined: tuple[tuple[int, ...], ...] = ()
    joined_spans: tuple[tuple[float, float], ...] = ()

    def join(self, segments: Mapping[int, Segment], alike: float) -> dict[int, Segment]:
        """Join holds; they keep the number of the first.

        Parameters
        ----------
        segments : mapping of int to Segment
        alike : float, m/s², by which the means of holds in one attitude may differ

        Raises
        ------
        InputError
            If there is no such hold, a span of time has fewer than two, others lie between, or
            their attitudes differ.
        """
        holds = dict(segments)
        groups = list(self.joined)
        for start, end in self.joined_spans:
            groups.append(tuple(_within(holds, start, end)))
            if len(groups[-1]) < 2:
                raise InputError(f"join: {start:g}s-{end:g}s: fewer than two holds lie there")
        for group in groups:
            for number in group:
                _check(number, holds, "join")
            between = [n for n in holds if group[0] < n < group[-1] and n not in group]
            if between:
                raise InputError(f"join: {_names(group)}: hold {between[0]} lies between them")
            for number in group[1:]:
                step = float(np.linalg.norm(holds[number].mean - holds[group[0]].mean))
                if step > alike:
                    raise InputError(
                        f"join: holds {group[0]} and {number} differ by {step:.2g} m/s²: the "
                        "sensor was turned between them"
                    )
                holds[group[0]] = holds[group[0]] + holds.pop(number)
        return holds

    def left_out(self, holds: Mapping[int, Segment]) -> dict[int, str]:
        """Holds that are left out, with the reason.

        Raises
        ------
        InputError
            If there is no such hold, or none in a span of time.
        """
        for number in self.numbers:
            _check(number, holds, "exclude")
        reasons = dict(self.numbers)
        for start, end, reason in self.spans:
            inside = _within(holds, start, end)
            if not inside:
                raise InputError(f"exclude: {start:g}s-{end:g}s: no hold lies there")
            reasons |= {n: reason for n in inside if n not in reasons}
        return reasons


def parse_selection(exclude: Sequence[str], join: Sequence[str]) -> Selection:
    """Selection from ``13:moved`` or ``120s-135s:moved``, and from ``4,5`` or ``120s-135s``.

    Raises
    ------
    InputError
        If something is neither.
    """
    numbers: dict[int, str] = {}
    spans = []
    for text in exclude:
        if match := _BY_NUMBER.fullmatch(text):
            numbers[int(match[1])] = match[2]
        elif (match := _BY_TIME.fullmatch(text)) and float(match[1]) < float(match[2]):
            spans.append((float(match[1]), float(match[2]), match[3]))
        else:
            raise InputError(
                f"exclude: expected a hold or a time, and why, as 13:moved or 120s-135s:moved, "
                f"not {text!r}"
            )
    joined, joined_spans = [], []
    for text in join:
        if (match := _SPAN.fullmatch(text)) and float(match[1]) < float(match[2]):
            joined_spans.append((float(match[1]), float(match[2])))
            continue
        parts = [part.strip() for part in text.split(",")]
        if len(parts) < 2 or not all(re.fullmatch(r"\d{1,9}", part) for part in parts):
            raise InputError(
                f"join: expected numbers of holds or a time, as 4,5 or 120s-135s, not {text!r}"
            )
        joined.append(tuple(sorted({int(part) for part in parts})))
    return Selection(numbers, tuple(spans), tuple(joined), tuple(joined_spans))


def _within(holds: Mapping[int, Segment], start: float, end: float) -> list[int]:
    """Numbers of the holds that lie in a span of time, if only in part."""
    return sorted(n for n, hold in holds.items() if hold.t0 <= end and hold.t1 >= start)


def _check(number: int, holds: Mapping[int, Segment], key: str) -> None:
    if number not in holds:
        raise InputError(f"{key}: there is no hold {number}; they are {_names(list(holds))}")


def _names(numbers: Sequence[int]) -> str:
    """Numbers in one line, runs of them by their ends."""
    runs: list[list[int]] = []
    for number in sorted(numbers):
        if runs and number == runs[-1][-1] + 1:
            runs[-1].append(number)
        else:
            runs.append([number])
    return ", ".join(f"{r[0]} to {r[-1]}" if len(r) > 2 else ", ".join(map(str, r)) for r in runs)
