"""Logs of blocks: so many samples, or a whole file, of each position, without the moves.

Nothing has to be found in them. But a block in which the sensor moved is no position.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.errors import InputError
from accelstudy.campaign.importing.recording import Recording
from accelstudy.campaign.importing.segments import Segment, Segmentation, find_saturated
from accelstudy.campaign.importing.settings import ImportSettings
from accelstudy.campaign.importing.windows import FACTOR, Threshold, Windows, threshold_of

Array = NDArray[np.float64]

PARTS = 4
"""Parts of a block whose means are compared; the noise within them averages out."""
RESTLESS = 10.0
"""Scatter of the parts of a block, as a multiple of that of a typical one, from which on the sensor
moves: a hand that trembles makes some five of it, a turn by a few degrees dozens."""


def segment_blocks(log: Recording, settings: ImportSettings) -> Segmentation:
    """Make each block of a log a position; those in which the sensor moves are to be left out.

    The blocks have as many samples as the settings say, or are the files of the log.

    Raises
    ------
    InputError
        If the log does not end with a block, or the sensor is saturated or moves in all of them.
    """
    size, threshold = settings.block, settings.threshold_mps2
    block = log.samples.recording if size is None else _blocks(log, size)
    first = np.flatnonzero(np.diff(block, prepend=-1))
    edges = [*first.tolist(), len(block)]
    all_blocks = {int(block[i]) + 1: slice(i, end) for i, end in pairwise(edges)}
    least = size or min(each.stop - each.start for each in all_blocks.values())
    if least < PARTS:
        raise InputError(f"{log.path}: {least} samples; a position has at least {PARTS}")
    # Blocks of which most is left out are no positions, which the report says.
    blocks = {n: each for n, each in all_blocks.items() if each.stop - each.start >= PARTS}
    windows = Windows(log, (least // 2) | 1)
    full = find_saturated(windows, [*blocks.values()], settings.full_range)
    left_out = {n: "the sensor is saturated" for n, f in zip(blocks, full, strict=True) if f}
    scatter = {
        n: _scatter(log.samples.forces[each]) for n, each in blocks.items() if n not in left_out
    }
    if not scatter:
        raise InputError(f"{log.path}: the sensor is saturated in all blocks of {least} samples")
    if threshold is None:
        # Rounding hides the scatter of a coarse sensor.
        usual = max(float(np.median([*scatter.values()])), FACTOR / RESTLESS * windows.rounding)
        reason = f"{RESTLESS:g} times the scatter of the {PARTS} parts of a typical block"
        chosen = Threshold(RESTLESS * usual, usual, reason)
    else:
        chosen = threshold_of(windows, threshold)
    for number, each in scatter.items():
        if each > chosen.sd:
            left_out[number] = f"the sensor moves: its parts scatter by {each:.2g} m/s²"
    segments = {n: Segment.of(log.samples, each) for n, each in blocks.items()}
    return Segmentation(windows, chosen, segments, left_out=left_out, size=least)


def _scatter(forces: Array) -> float:
    """Scatter of the means of the parts of a block, (n, 3), m/s²."""
    means = [part.mean(axis=0) for part in np.array_split(forces, PARTS)]
    return float(np.sqrt(np.linalg.norm(np.var(means, axis=0, ddof=1))))


def _blocks(log: Recording, size: int) -> NDArray[np.int_]:
    """Block of each sample, from 0; a row that is left out counts as well."""
    total, row = len(log.first.rows.forces), log.samples.row
    fewer = total // size * size
    if len(row) and row[-1] >= fewer:  # a note at the end is no sample
        raise InputError(
            f"{log.path}: {total} samples are no multiple of the {size} of a block (`block`): "
            f"{fewer} or {fewer + size} would be {fewer // size} or {fewer // size + 1} positions"
        )
    return row // size
