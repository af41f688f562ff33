"""Logs of equal blocks: so many samples of each position, without the moves between them.

Nothing has to be found in them. But a block in which the sensor moved is no position.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.errors import InputError
from accelstudy.basics.wording import counted
from accelstudy.campaign.importing.recording import Log
from accelstudy.campaign.importing.segments import (
    WANDERING,
    Envelope,
    GrowingHold,
    Segment,
    Segmentation,
)
from accelstudy.campaign.importing.windows import (
    Survey,
    Threshold,
    choose_threshold,
    given_threshold,
    survey_log,
    windows,
)

Array = NDArray[np.float64]


def segment_blocks(
    log: Log, size: int, threshold: float | None, full_range: float
) -> tuple[Survey, Threshold, Segmentation]:
    """Make each block of a log a position; those with a move in them are to be left out.

    The noise of the log tells what a move is, as where holds are found: of windows half as long as
    a block most are at rest.

    Parameters
    ----------
    log : Log
    size : int, samples of each position
    threshold : float, m/s², standard deviation of a window up to which it is at rest; chosen from
        the data if None
    full_range : float, m/s², the sensor measures ± this

    Raises
    ------
    InputError
        If the log does not end with a block, or most blocks hold a move or a saturated sensor.
    """
    survey = survey_log(log, (size // 2) | 1)
    chosen = choose_threshold(survey, log) if threshold is None else given_threshold(threshold)
    envelope = Envelope(survey.span, survey.total)
    for _ in envelope.along(windows(log, survey.width)):
        pass
    segments: dict[int, Segment] = {}
    left_out: dict[int, str] = {}
    for number, rows in enumerate(_blocks(log, size), 1):
        block = GrowingHold((number - 1) * size, 0, survey.extremes, full_range, 0)
        block.keep(rows)
        segments[number] = segment = block.finish()
        if block.saturated():
            left_out[number] = "the sensor is saturated"
        elif segment.variance > (WANDERING * chosen.sd) ** 2:
            left_out[number] = f"the sensor moves: sd {np.sqrt(segment.variance):.2g} m/s²"
    if len(left_out) > len(segments) / 2:
        first, why = next(iter(left_out.items()))
        raise InputError(
            f"{log.path}: {len(left_out)} of {counted(len(segments), 'block')} of {size} samples "
            f"are no positions (block {first}: {why}); is the number of samples (--block) right?"
        )
    return survey, chosen, Segmentation(segments, 0, 0, 0, envelope, left_out, size)


def _blocks(log: Log, size: int) -> Iterator[Array]:
    """Samples of each block: time, forces, conditions."""
    left, total = np.empty((0, 4 + len(log.conditions))), 0
    for rows in log.chunks():
        total += len(rows.time)
        left = np.concatenate([left, np.column_stack([rows.time, rows.forces, rows.conditions])])
        whole = len(left) // size * size
        yield from left[:whole].reshape(-1, size, left.shape[1])
        left = left[whole:]
    if len(left):
        fewer = total - len(left)
        raise InputError(
            f"{log.path}: {total} samples are no multiple of the {size} of a block (--block): "
            f"{fewer} or {fewer + size} would be {fewer // size} or {fewer // size + 1} positions"
        )
