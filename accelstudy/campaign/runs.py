"""Runs of windows at rest, collected into holds while the log passes by."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from accelstudy.campaign.logs import Log
from accelstudy.campaign.windows import windows

Array = NDArray[np.float64]

LONGEST_RECORD = 2**20
"""Samples of a hold that are kept for the Allan deviation; what follows counts for the mean."""
SATURATED = 0.05
"""Share of the samples of a hold at the end of the scale that makes it useless."""


class GrowingHold:
    """A hold while it grows.

    Its first `cut` samples are dropped as they come; its latest ones wait until later ones arrive,
    as nobody knows yet which will be the last.
    """

    def __init__(self, start: int, cut: int, extremes: Array) -> None:
        self.start, self.n = start + cut, 0
        self.t0 = self.t1 = np.nan
        self.mean, self.squares = np.zeros(3), np.zeros(3)
        self._extremes, self._at_extremes = extremes, np.zeros((2, 2, 3), dtype=int)
        self._cut, self._to_drop = cut, cut
        self._times, self._forces = np.empty(0), np.empty((0, 3))
        self._record: list[Array] = []
        self._recorded = 0

    def grow(self, times: Array, forces: Array) -> None:
        """Take in the samples that follow."""
        dropped = min(self._to_drop, len(times))
        self._to_drop -= dropped
        times = np.concatenate([self._times, times[dropped:]])
        forces = np.concatenate([self._forces, forces[dropped:]])
        sure = max(0, len(times) - self._cut)
        self._times, self._forces = times[sure:], forces[sure:]
        if sure:
            self._keep(times[:sure], forces[:sure])

    def _keep(self, times: Array, forces: Array) -> None:
        self.t0, self.t1 = (times[0] if not self.n else self.t0), times[-1]
        # Mean and squares of both parts together (Chan, Golub and LeVeque 1979).
        n, mean = len(forces), forces.mean(axis=0)
        step = mean - self.mean
        self.squares += np.sum((forces - mean) ** 2, axis=0) + step**2 * self.n * n / (self.n + n)
        self.mean += step * n / (self.n + n)
        self.n += n
        self._at_extremes += np.sum(forces == self._extremes[:, :, None, :], axis=2)
        kept = forces[: max(0, LONGEST_RECORD - self._recorded)]
        self._record.append(kept.copy())
        self._recorded += len(kept)

    def release(self) -> Array:
        """Samples of the hold, which are forgotten here: those of all holds may not fit."""
        samples, self._record = np.concatenate(self._record), []
        self._times, self._forces = np.empty(0), np.empty((0, 3))
        return samples

    def saturated(self) -> bool:
        """Whether samples pile up at the end of the scale.

        A coarse but sound sensor reaches its largest value too, though less often than the next.
        """
        end, beside = self._at_extremes[:, 0], self._at_extremes[:, 1]
        return bool(np.any((end > SATURATED * self.n) & (end > beside)))


def runs_at_rest(
    log: Log, width: int, largest: float, cut: int, extremes: Array
) -> Iterator[GrowingHold]:
    """Runs of windows at rest, cut at both ends; some have no samples left."""
    hold, piece = None, 0
    for batch in windows(log, width):
        if hold is not None and batch.piece != piece:
            yield hold
            hold = None
        piece = batch.piece
        still = (batch.variance <= largest) & ~batch.frozen
        edges = np.flatnonzero(np.diff(still, prepend=False, append=False))
        for first, end in edges.reshape(-1, 2).tolist():
            if hold is not None and first > 0:
                yield hold
                hold = None
            if hold is None:
                hold = GrowingHold(batch.index + first, cut, extremes)
            hold.grow(batch.time[first:end], batch.forces[first:end])
            if end < len(still):
                yield hold
                hold = None
        if hold is not None and len(still) and not still[-1]:
            yield hold
            hold = None
    if hold is not None:
        yield hold
