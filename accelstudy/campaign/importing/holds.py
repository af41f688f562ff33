"""Static holds of a log: runs of samples at rest, or blocks of which each is a position.

A hold is a run of samples about which the windows are at rest.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from statistics import NormalDist

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from accelstudy.basics.arrays import Array
from accelstudy.basics.errors import InputError
from accelstudy.basics.units import STANDARD_GRAVITY
from accelstudy.basics.wording import plural, short_list
from accelstudy.campaign.gross_errors.recognition import check_size
from accelstudy.campaign.importing.allan import MIN_DIFFERENCES, pooled_deviation
from accelstudy.campaign.importing.columns import AXES, SDS
from accelstudy.campaign.importing.log import Log
from accelstudy.campaign.importing.noise import HoldNoise, hold_noise, noise_before_rounding
from accelstudy.campaign.importing.settings import ImportSettings
from accelstudy.campaign.importing.windows import (
    MAX_REST_NOISE,
    THRESHOLD_FACTOR,
    Windows,
    noise_of_steps,
    slide_windows,
    usual_window,
    windows_at_rest,
)

MAX_SATURATED_SHARE = 0.05
"""A hold is useless if more than this share of its samples is at the end of the scale."""
MAX_BEYOND, MIN_WITHIN = 5.0, 3.0
"""Samples that rounding alone would hardly leave out beyond the largest one (e⁻⁵), and standard
deviations by which those at the largest one may exceed what it then explains."""
MIN_REST = 8
"""Samples left of a rest from which on it is told; a sensor that turns back is still for fewer."""
MAX_WANDER = 2.0
"""A hold whose standard deviation is more than this many thresholds of a window is none."""
SATURATED = "the sensor is saturated there"
TURNS = "the force changes there by more than its noise, since the sensor turns slowly"
SLOW_RATIO, QUICK_RATIO = 2.0, 0.2
"""Allan deviation, as a multiple of that of white noise, from which on a motion is slow, such as
that of a hand; seconds, below which motions are vibrations, which do not harm a mean."""
PARTS = 4
"""Parts of a block whose means are compared; the noise within them averages out."""
MAX_TREMOR = 10.0
"""Scatter of the parts of a block, as a multiple of that of a typical one, from which on the sensor
moves: a hand that trembles makes some five of it, a turn by a few degrees dozens."""


@dataclass(frozen=True)
class Holds:
    """Static holds of a log, n of them, in order of time.

    Attributes
    ----------
    log : Log, joined
    windows : Windows of the log
    table : DataFrame, a row for each hold, by the number that figures and options use: start and
        end (first sample, and the one after the last), t0 and t1 (times of the first and of the
        last sample, s), n (samples), fx … (means, m/s²), sd_fx … (standard deviations of the
        samples), as far as the log has them the mean temperature, °C, and the rms vibration, m/s²
        (NaN where nothing was measured), and left_out, why a hold is left out, or ""
    noise : HoldNoise, of the holds that are not left out
    warnings : tuple of str
    size : int, samples of each block, or of the shortest, if the log consists of blocks
    """

    log: Log
    windows: Windows
    table: pd.DataFrame
    noise: HoldNoise
    warnings: tuple[str, ...]
    size: int | None = None

    @property
    def means(self) -> Array:
        """Mean specific forces, (n, 3), m/s²."""
        return self.table[[*AXES]].to_numpy()

    @property
    def used(self) -> NDArray[np.bool_]:
        """Which of them are not left out, (n,)."""
        return (self.table["left_out"] == "").to_numpy()

    @property
    def left_out(self) -> dict[int, str]:
        """Numbers of the others, with the reason."""
        reasons = self.table["left_out"]
        return dict(zip(reasons.index[~self.used].tolist(), reasons[~self.used], strict=True))


# --- Runs at rest --------------------------------------------------------------------------------


def find_holds(log: Log, settings: ImportSettings) -> Holds:
    """Find the static holds of a log, each of which begins and ends half a window inside a rest.

    Rests in which the sensor is saturated, or turns, are left out. Of a log joined of several parts
    the longest hold of each is its one position, which gets the number of the part.

    Raises
    ------
    InputError
        If the log is shorter than a window, nothing in it is at rest, or the sensor was never
        still.
    """
    windows = windows_at_rest(log, settings.window, settings.threshold)
    runs, too_short = _runs_at_rest(log, windows, settings)
    table = _table_of(log, range(1, len(runs) + 1), runs)
    # A sensor that turns slowly is nearly still in each window, yet has no constant attitude: its
    # force changes over the run by more than within each of them.
    wander = np.sqrt(np.linalg.norm(table[[*SDS]] ** 2, axis=1))
    table.loc[wander > MAX_WANDER * windows.threshold, "left_out"] = TURNS
    table.loc[find_saturated(log, windows, runs, settings), "left_out"] = SATURATED
    if len(log.parts) > 1:
        table.index = log.part[table["start"].astype(int)] + 1
        best_last = table.assign(used=table["left_out"] == "").sort_values(["used", "n"])
        table = best_last.groupby(level=0).tail(1).sort_index().drop(columns="used")
    why = Counter(reason for reason in table["left_out"] if reason)
    lost = [f"{plural(count, 'hold')} left out: {reason}" for reason, count in why.items()]
    warnings = [*windows.warnings, *lost, *too_short]
    if SATURATED in why and settings.range is None:
        warnings.append("with a `range`, `apply` leaves the rows of saturated readings empty")
    if not (table["left_out"] == "").any():
        if TURNS in why:
            raise _never_still(
                log, windows, settings, "it turns slowly in all that looks like a hold"
            )
        raise InputError(
            f"{log.path}: no static hold of {settings.shortest:g} s or more (a window is at rest "
            f"up to {windows.threshold:.3g} m/s²)" + "".join(f"; {w}" for w in warnings)
        )
    return _holds_of(log, windows, table, settings, warnings)


def shortest_rest(log: Log, settings: ImportSettings) -> float:
    """Length of a rest, s, of which the shortest hold is left without its ends."""
    return (settings.window or usual_window(log)) + 2 * settings.trim + settings.shortest


def _runs_at_rest(
    log: Log, windows: Windows, settings: ImportSettings
) -> tuple[list[slice], list[str]]:
    """Samples that are at rest for long enough.

    Also a line about rests that are too short, with the option that takes them.
    """
    step, shortest = log.step, settings.shortest
    still = windows.variance <= windows.threshold**2
    edges = np.flatnonzero(np.diff(still, prepend=False, append=False)).reshape(-1, 2)
    cut, least = round(settings.trim / step), max(2, round(shortest / step))
    rests = edges + np.array([cut, -cut])
    lengths = np.diff(rests)[:, 0]
    runs = [slice(first, end) for first, end in rests[lengths >= least].tolist()]
    short = lengths[(lengths >= MIN_REST) & (lengths < least)]
    if not len(short):
        return runs, []
    whole = shortest_rest(log, settings)
    spans = (np.sort(short)[[0, -1]] + 2 * cut + windows.width) * step
    said = " to ".join(dict.fromkeys(f"{span:.1f}" for span in spans))
    are, them = ("are", "them") if len(short) > 1 else ("is", "it")
    return runs, [
        f"{plural(len(short), 'rest')} of {said} s {are} no hold: it takes {whole:.3g} s, of which "
        f"{whole - shortest:.3g} s at its ends do not count; `shortest` "
        f"{step * short.min():.4g} (now {shortest:g}) takes {them}"
    ]


# --- Blocks --------------------------------------------------------------------------------------


def find_blocks(log: Log, settings: ImportSettings) -> Holds:
    """Make each block of a log a position; those in which the sensor moves are left out.

    The blocks have as many samples as the settings say, or are the parts of the log. Nothing has to
    be found in them.

    Raises
    ------
    InputError
        If the log does not end with a block, or the sensor is saturated or moves in all of them.
    """
    block = log.part
    if (size := settings.block) is not None:
        row, total = log.samples.index.to_numpy(), len(log.raw.content)
        fewer = total // size * size
        if row[-1] >= fewer:  # a note at the end is no sample
            raise InputError(
                f"{log.path}: {total} samples are no multiple of the {size} of a block (`block`): "
                f"{fewer} or {fewer + size} would be {fewer // size} or {fewer // size + 1} "
                "positions"
            )
        block = row // size  # a row that is left out counts as well
    edges = [*np.flatnonzero(np.diff(block, prepend=-1)).tolist(), len(block)]
    least = size or int(np.diff(edges).min())
    if least < PARTS:
        raise InputError(f"{log.path}: {least} samples; a position has at least {PARTS}")
    # Blocks of which most is left out are no positions, which the report says.
    blocks = [slice(i, end) for i, end in pairwise(edges) if end - i >= PARTS]
    table = _table_of(log, [int(block[each.start]) + 1 for each in blocks], blocks)
    windows = slide_windows(log, (least // 2) | 1)
    full = find_saturated(log, windows, blocks, settings)
    if full.all():
        raise InputError(f"{log.path}: the sensor is saturated in all blocks of {least} samples")
    parts = [np.array_split(log.forces[each], PARTS) for each in blocks]
    moved = np.array([scatter(np.array([p.mean(axis=0) for p in each])) for each in parts])
    # Rounding hides the scatter of a coarse sensor.
    hidden = THRESHOLD_FACTOR / MAX_TREMOR * noise_of_steps(windows.steps)
    usual = max(float(np.median(moved[~full])), hidden)
    reason = f"{MAX_TREMOR:g} times the scatter of the {PARTS} parts of a typical block"
    windows = windows._replace(threshold=MAX_TREMOR * usual, floor=usual, reason=reason)
    if settings.threshold:
        windows = windows._replace(threshold=settings.threshold, floor=np.nan, reason="as given")
    why = [f"the sensor moves: its parts scatter by {each:.2g} m/s²" for each in moved]
    table["left_out"] = np.select([full, moved > windows.threshold], [SATURATED, why], "")
    return _holds_of(log, windows, table, settings, windows.warnings, least)


# --- What is no measurement ----------------------------------------------------------------------


def scatter(forces: Array) -> float:
    """Root of the norm of the variances of the axes, m/s², which is the measure of the detector."""
    return float(np.sqrt(np.linalg.norm(forces.var(axis=0, ddof=1))))


def find_saturated(
    log: Log, windows: Windows, holds: Sequence[slice], settings: ImportSettings
) -> NDArray[np.bool_]:
    """Find holds with samples at the sensor's range or, if it is unknown, at the extreme, (n,).

    In a hold of n samples of which none lies beyond the last step, the mean may be so high that
    `MAX_BEYOND` of them were expected there. Those above the last edge but one are as many as the
    step, and the noise before rounding, explain.
    """
    forces, step = [log.forces[hold] for hold in holds], windows.steps
    # The range of counts is unknown if their offset is.
    if settings.range is not None and (log.layout.unit, log.layout.offset) != ("counts", None):
        # The largest reading of a converter is a step less than its range.
        limit = settings.range - step.max()
        return np.array([reaches_range(each, limit) for each in forces], dtype=bool)
    if not forces:
        return np.zeros(0, dtype=bool)
    read = log.forces[windows.about]
    ends = np.array([read.min(axis=0), read.max(axis=0)])
    noise = noise_before_rounding(step, np.median([f.std(axis=0, ddof=1) for f in forces], axis=0))
    with np.errstate(divide="ignore", invalid="ignore"):
        steps = np.where(step > 0, step / noise, 0.0)
    steps[noise == 0] = np.inf  # every reading is the same in most holds
    normal = NormalDist()  # scipy.special takes long to import
    saturated = []
    for each in forces:
        n = len(each)
        at_end = np.sum(each == ends[:, None], axis=1)
        middle = normal.inv_cdf(min(MAX_BEYOND / n, 0.5))
        share = np.array([normal.cdf(middle + step) for step in steps])
        explained = n * share + MIN_WITHIN * np.sqrt(n * share * (1 - share))
        saturated.append(np.any(at_end > np.maximum(MAX_SATURATED_SHARE * n, explained)))
    return np.array(saturated)


def reaches_range(forces: Array, full_range: float) -> bool:
    """Whether samples (n, 3) of a hold, m/s², lie at the sensor's range ±`full_range`."""
    # Conversion from counts or g rounds.
    beyond = np.abs(forces) >= full_range * (1 - 1e-9)
    return bool(np.any(beyond.sum(axis=0) > MAX_SATURATED_SHARE * len(forces)))


# --- The table of holds --------------------------------------------------------------------------


def _table_of(log: Log, numbers: Sequence[int], holds: Sequence[slice]) -> pd.DataFrame:
    """Table of holds, none of them left out; see `Holds`."""
    rows = []
    for hold in holds:
        forces, time = log.forces[hold], log.time[hold]
        row = [hold.start, hold.stop, time[0], time[-1], len(forces), *forces.mean(axis=0)]
        row += [*forces.std(axis=0, ddof=1)]
        for name in log.conditions:
            power = 2 if name == "vibration" else 1
            known = log.samples[name].iloc[hold].dropna().to_numpy() ** power
            row.append(known.mean() ** (1 / power) if len(known) else np.nan)
        rows.append([*row, ""])
    names = ["start", "end", "t0", "t1", "n", *AXES, *SDS, *log.conditions, "left_out"]
    return pd.DataFrame(rows, index=[*numbers], columns=names)


def _holds_of(
    log: Log,
    windows: Windows,
    table: pd.DataFrame,
    settings: ImportSettings,
    warnings: Sequence[str],
    size: int | None = None,
) -> Holds:
    """Holds, of which a person leaves out some, too, if the sensor was still in the others.

    Raises
    ------
    InputError
        If there is no such hold, a person leaves all of them out, or the sensor was never still.
    """
    for number, reason in sorted(settings.exclude.items()):
        if number not in table.index:
            there = short_list([*map(str, table.index)])
            raise InputError(f"exclude: there is no hold {number}; they are {there}")
        table.loc[number, "left_out"] = reason
    used = table[table["left_out"] == ""]
    if used.empty:
        why = f"exclude: no {'hold' if size is None else 'block'} is left"
        raise InputError(f"{log.path}: {why} ({table['left_out'].iloc[0]})")
    records = [log.forces[start:end] for start, end in used[["start", "end"]].to_numpy()]
    noise = hold_noise(records, log.step, windows.steps)
    holds = Holds(log, windows, table, noise, tuple(warnings), size)
    if _moves(holds, records):
        # In a wrong unit noise may be as large as motion. The zero of counts is hardly known yet.
        if (conversion := log.layout.conversion).unit != "counts":
            check_size(f"{log.path}", np.concatenate(records), settings.gravity, conversion)
        why = (
            f"what looks like rest varies by {windows.floor:.3g} m/s², like a hand, not like the "
            "noise of a sensor"
        )
        raise _never_still(log, windows, settings, why, size)
    return holds


def _moves(holds: Holds, records: Sequence[Array]) -> bool:
    """Whether the windows "at rest" show motion: large compared with gravity, and slow.

    The noise of a sensor at rest is below a few hundredths of gravity. The vibration of a machine
    may be larger, but it is quick and averages out like white noise. A human body moves slowly.
    """
    floor = holds.windows.floor
    if not floor > MAX_REST_NOISE * STANDARD_GRAVITY:
        return False
    curve = pooled_deviation(records, holds.log.step)
    reliable = (curve.differences >= MIN_DIFFERENCES) & (curve.tau >= QUICK_RATIO)
    white = np.sqrt(np.mean(holds.noise.sd**2) * holds.log.step / curve.tau)
    return bool(not reliable.any() or np.any(reliable & (curve.pooled > SLOW_RATIO * white)))


def _never_still(
    log: Log, windows: Windows, settings: ImportSettings, why: str, size: int | None = None
) -> InputError:
    if size is not None:
        return InputError(
            f"{log.path}: blocks of {size} samples are no positions: {why}; is the number of "
            "samples (`block`) right, or does a file hold a move?"
        )
    return InputError(
        f"{log.path}: the sensor was never still: {why}; the quietest hundredth of its windows of "
        f"{windows.width * log.step:.2g} s varies by {_quietest(windows):.3g} m/s². Lay it down "
        f"for {shortest_rest(log, settings):.3g} s or more in each of ten or more attitudes, on a "
        "table or in a fixture"
    )


def _quietest(windows: Windows) -> float:
    """Standard deviation of the quietest hundredth of the windows, m/s²."""
    return float(np.sqrt(np.nanquantile(windows.variance, 0.01)))
