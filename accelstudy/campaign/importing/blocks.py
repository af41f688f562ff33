"""Logs of blocks: so many samples, or a whole file, of each position, without the moves.

Nothing has to be found in them. But a block in which the sensor moved is no position.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.errors import InputError
from accelstudy.campaign.importing.recording import Log, LogSeries, Recording
from accelstudy.campaign.importing.resolution import noise_before_rounding
from accelstudy.campaign.importing.segments import Envelope, GrowingHold, Segment, Segmentation
from accelstudy.campaign.importing.windows import (
    FACTOR,
    Survey,
    Threshold,
    given_threshold,
    survey_log,
)

Array = NDArray[np.float64]


PARTS = 4
"""Parts of a block whose means are compared; the noise within them averages out."""
RESTLESS = 10.0
"""Scatter of the parts of a block, as a multiple of that of a typical one, from which on the sensor
moves: a hand that trembles makes some five of it, a turn by a few degrees dozens."""


def segment_blocks(
    log: Log | LogSeries, size: int | None, threshold: float | None, full_range: float
) -> tuple[Survey, Threshold, Segmentation]:
    """Make each block of a log a position; those in which the sensor moves are to be left out.

    The blocks have so many samples, or are the parts of the log.

    Parameters
    ----------
    log : Log or LogSeries
    size : int, samples of each position; None if each part of a LogSeries is one
    threshold : float, m/s², scatter of the parts of a block up to which it is at rest; chosen from
        the data if None
    full_range : float, m/s², the sensor measures ± this

    Raises
    ------
    InputError
        If the log does not end with a block, or the sensor is saturated or moves in all of them.
    """
    parts = log.parts if isinstance(log, LogSeries) else ()
    least = size or min(sum(len(rows.time) for rows in part.chunks()) for part in parts)
    if least < PARTS:
        raise InputError(f"{log.path}: {least} samples; a position has at least {PARTS}")
    survey = survey_log(log, (least // 2) | 1)
    envelope = Envelope(survey.span, survey.total)
    for _ in envelope.along(survey.kept.again()):
        pass
    segments: dict[int, Segment] = {}
    blocks: dict[int, GrowingHold] = {}
    left_out, scatter = {}, {}
    start = 0
    for number, rows in enumerate(_files(log) if size is None else _blocks(log, size), 1):
        if len(rows) < PARTS:  # most are left out, which the report says
            continue
        block = GrowingHold(start, 0, survey.extremes, full_range - survey.steps.max(), 0)
        block.keep(rows)
        start += len(rows)
        segments[number] = block.finish()
        blocks[number] = block
        means = [part.mean(axis=0) for part in np.array_split(rows[:, 1:4], PARTS)]
        scatter[number] = float(np.sqrt(np.linalg.norm(np.var(means, axis=0, ddof=1))))
    sd = np.median([segment.sd for segment in segments.values()], axis=0)
    noise = noise_before_rounding(survey.steps, sd)
    for number in [n for n, block in blocks.items() if block.saturated(survey.steps, noise)]:
        left_out[number] = "the sensor is saturated"
        del scatter[number]
    if not scatter:
        raise InputError(f"{log.path}: the sensor is saturated in all blocks of {least} samples")
    if threshold is None:
        # Rounding hides the scatter of a coarse sensor.
        usual = max(float(np.median([*scatter.values()])), FACTOR / RESTLESS * survey.rounding)
        reason = f"{RESTLESS:g} times the scatter of the {PARTS} parts of a typical block"
        chosen = Threshold(RESTLESS * usual, usual, reason)
    else:
        chosen = given_threshold(threshold)
    for number, each in scatter.items():
        if each > chosen.sd:
            left_out[number] = f"the sensor moves: its parts scatter by {each:.2g} m/s²"
    return survey, chosen, Segmentation(segments, 0, 0, (), envelope, left_out, least)


def _files(log: Recording) -> Iterator[Array]:
    """Samples of each part of a log, as those of a block."""
    held: list[Array] = []
    for rows in log.chunks():
        if rows.anew and held:
            yield np.concatenate(held)
            held = []
        held.append(np.column_stack([rows.time, rows.forces, rows.conditions]))
    yield np.concatenate(held)


def _blocks(log: Log | LogSeries, size: int) -> Iterator[Array]:
    """Samples of each block: time, forces, conditions."""
    assert isinstance(log, Log)
    left, total = np.empty((0, 4 + len(log.conditions))), 0
    for rows, lost in log.all_rows():
        total += len(rows.time)
        samples = np.column_stack([rows.time, rows.forces, rows.conditions])
        samples[lost] = np.nan
        left = np.concatenate([left, samples])
        whole = len(left) // size * size
        for block in left[:whole].reshape(-1, size, left.shape[1]):
            yield block[np.isfinite(block[:, 1])]
        left = left[whole:]
    if np.isfinite(left[:, 1]).any():  # a note at the end is no sample
        fewer = total - len(left)
        raise InputError(
            f"{log.path}: {total} samples are no multiple of the {size} of a block (--block): "
            f"{fewer} or {fewer + size} would be {fewer // size} or {fewer // size + 1} positions"
        )
