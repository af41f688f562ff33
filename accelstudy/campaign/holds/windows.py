"""Windows that slide over a log, how much the forces vary in each, and their envelope in time."""

from __future__ import annotations

from collections.abc import Iterator
from copy import copy
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.errors import InputError
from accelstudy.campaign.logs.recording import GAP, Recording

Array = NDArray[np.float64]

SPANS = 1200
"""Spans of time of an envelope, about as many as a page can show."""
_SMALLEST, _LARGEST = 8, 10**6  # samples


def samples_in(log: Recording, window: float) -> int:
    """Samples in a window of `window` seconds; odd, so that it has a middle.

    Raises
    ------
    InputError
        If they are too few for a variance, or so many that the rate must be wrong.
    """
    samples = window / log.step
    if not _SMALLEST <= samples <= _LARGEST:
        raise InputError(
            f"{log.path}: a window of {window:g} s holds {samples:.3g} samples, at "
            f"{1 / log.step:.6g} per second"
            f"{log.likely_unit() or '; is the rate (--rate) right?'}"
        )
    return round(samples) | 1


@dataclass(frozen=True)
class Windows:
    """Neighbouring windows, one centred at each of m samples.

    `piece` is the number of gaps so far, `recording` the number of recordings that ended, and
    `index` the place of the first of these samples in the log.
    """

    piece: int
    recording: int
    index: int
    time: Array
    forces: Array
    conditions: Array
    variance: Array
    frozen: NDArray[np.bool_]


def windows(log: Recording, width: int) -> Iterator[Windows]:
    """Windows of `width` samples (odd), sliding by one; none spans a gap."""
    half, piece, recording, row = width // 2, 0, 0, 0
    times, values = np.empty(0), np.empty((0, 3 + len(log.conditions)))
    for rows in log.chunks():
        before = times[-1:] if len(times) else rows.time[:1]
        jumps = np.diff(rows.time, prepend=before) > GAP * log.step
        if rows.anew and row > 0:
            jumps[0], recording = True, recording + 1
        chunk = np.column_stack([rows.forces, rows.conditions])
        edges = sorted({0, *np.flatnonzero(jumps).tolist(), len(chunk)})
        for first, end in pairwise(edges):
            if jumps[first]:
                piece += 1
                times, values = times[:0], values[:0]
            times = np.concatenate([times, rows.time[first:end]])
            values = np.concatenate([values, chunk[first:end]])
            row += end - first
            centred = max(0, len(times) - width + 1)
            empty = np.empty(0), np.empty(0, dtype=bool)
            variance, frozen = _spread(values[:, :3], width) if centred else empty
            inside = slice(half, half + centred)
            yield Windows(
                piece,
                recording,
                row - len(times) + half,
                times[inside],
                values[inside, :3],
                values[inside, 3:],
                variance,
                frozen,
            )
            times, values = times[centred:], values[centred:]


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
            np.fmin.at(self.low, span, values)
            np.fmax.at(self.high, span, values)
            yield batch

    def less(self, offset: Array) -> Envelope:
        """Envelope of the forces less an offset, (3,), m/s²."""
        shifted = copy(self)
        shifted.low, shifted.high = (values - [*offset, 0.0] for values in (self.low, self.high))
        return shifted


def _spread(forces: Array, width: int) -> tuple[Array, NDArray[np.bool_]]:
    """Norm of the variances of the axes in each window, and whether an axis does not change."""
    # Running sums of large numbers lose digits.
    offsets = forces - forces.mean(axis=0)
    sums, squares = (_window_sums(values, width) / width for values in (offsets, offsets**2))
    variance = np.maximum(squares - sums**2, 0.0)
    # Rounding may hide a variance of zero, so changes are counted.
    changes = _window_sums(np.diff(forces, axis=0) != 0, width - 1)
    return np.sqrt(np.sum(variance**2, axis=1)), np.any(changes == 0, axis=1)


def _window_sums(values: NDArray[Any], width: int) -> NDArray[Any]:
    sums = np.cumsum(values, axis=0)
    result = sums[width - 1 :].copy()
    result[1:] -= sums[:-width]
    return result
