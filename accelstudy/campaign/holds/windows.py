"""Windows that slide over a log, and how much the forces vary in each."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.errors import InputError
from accelstudy.campaign.logs.recording import GAP, Recording

Array = NDArray[np.float64]

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
