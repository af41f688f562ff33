"""Windows that slide over a log, and how much the forces vary in each."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from accelstudy.campaign.logs import GAP, Log
from accelstudy.errors import InputError

Array = NDArray[np.float64]

_SMALLEST, _LARGEST = 8, 10**6  # samples


def samples_in(log: Log, window: float) -> int:
    """Samples in a window of `window` seconds; odd, so that it has a middle.

    Raises
    ------
    InputError
        If they are too few to tell a variance, or too many to be meant.
    """
    samples = window / log.step
    if not _SMALLEST <= samples <= _LARGEST:
        raise InputError(
            f"{log.path}: a window of {window:g} s holds {samples:.3g} samples; are the rate "
            f"({1 / log.step:.6g} per second) and the unit of time right?"
        )
    return round(samples) | 1


@dataclass(frozen=True)
class Windows:
    """Neighbouring windows, one centred at each of m samples.

    `piece` counts the gaps so far, `index` is the place of the first of these samples in the log.
    """

    piece: int
    index: int
    time: Array
    forces: Array
    variance: Array
    frozen: NDArray[np.bool_]


def windows(log: Log, width: int) -> Iterator[Windows]:
    """Windows of `width` samples (odd), sliding by one; none spans a gap."""
    half, piece, row = width // 2, 0, 0
    times, forces = np.empty(0), np.empty((0, 3))
    for chunk_times, chunk_forces in log.chunks():
        before = times[-1:] if len(times) else chunk_times[:1]
        jumps = np.diff(chunk_times, prepend=before) > GAP * log.step
        edges = sorted({0, *np.flatnonzero(jumps).tolist(), len(chunk_times)})
        for first, end in pairwise(edges):
            if jumps[first]:
                piece += 1
                times, forces = times[:0], forces[:0]
            times = np.concatenate([times, chunk_times[first:end]])
            forces = np.concatenate([forces, chunk_forces[first:end]])
            row += end - first
            centred = max(0, len(times) - width + 1)
            variance, frozen = _spread(forces, width) if centred else (np.empty(0), np.empty(0))
            inside = slice(half, half + centred)
            yield Windows(
                piece,
                row - len(times) + half,
                times[inside],
                forces[inside],
                variance,
                frozen.astype(bool),
            )
            times, forces = times[centred:], forces[centred:]


def _spread(forces: Array, width: int) -> tuple[Array, NDArray[np.bool_]]:
    """Norm of the variances of the axes in each window, and whether an axis does not change."""
    # Running sums lose digits far from zero.
    offsets = forces - forces.mean(axis=0)
    sums, squares = (_window_sums(values, width) / width for values in (offsets, offsets**2))
    variance = np.maximum(squares - sums**2, 0.0)
    # Rounding hides a variance of zero; counting does not.
    changes = _window_sums(np.diff(forces, axis=0) != 0, width - 1)
    return np.sqrt(np.sum(variance**2, axis=1)), np.any(changes == 0, axis=1)


def _window_sums(values: NDArray[Any], width: int) -> NDArray[Any]:
    sums = np.cumsum(values, axis=0)
    result = sums[width - 1 :].copy()
    result[1:] -= sums[:-width]
    return result
