"""Static holds of a log: runs of samples at rest, or blocks of which each is a position.

The detector is that of Tedaldi, Pretto and Menegatti (ICRA 2014): a hold is a run of samples about
which the windows are at rest. It compares the norm of the variances of the three axes in a window
with a threshold, which comes from the data.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from statistics import NormalDist
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from accelstudy.basics.errors import InputError
from accelstudy.basics.units import STANDARD_GRAVITY
from accelstudy.basics.wording import plural, short_list
from accelstudy.campaign.importing.allan import MIN_DIFFERENCES, pooled_deviation
from accelstudy.campaign.importing.columns import AXES, SDS
from accelstudy.campaign.importing.log import GAP_RATIO, Log
from accelstudy.campaign.importing.noise import (
    HoldNoise,
    hold_noise,
    noise_before_rounding,
    step_in,
)
from accelstudy.campaign.importing.settings import ImportSettings
from accelstudy.leveling.angles import usual_norm

Array = NDArray[np.float64]

MIN_SAMPLES, MAX_SAMPLES = 8, 10**6
"""Samples of a window, at least and at most."""
THRESHOLD_FACTOR = 3.0
"""Threshold over noise floor; it leaves room for noise that differs between attitudes."""
QUIET_FACTOR, QUIET = 10.0, 0.003 * STANDARD_GRAVITY
"""The same for a quiet sensor, and the largest threshold that it may give, m/s²."""
MAX_REST_NOISE = 0.02
"""Noise of windows, as a share of gravity, from which on it may be motion and not the sensor's."""
MAX_COARSE_RATIO = 1.75
"""Noise of windows, as a multiple of that of rounding, up to which a sensor at rest may read the
same number all the time: that of noise of 0.4 steps."""
_TOGETHER = 2**16
"""Windows that are worked out together: what a processor keeps at hand is small."""
_DECADES, _PER_DECADE = 40, 50
"""Bins of the histogram of variances: decades on both sides of 1 (m/s²)², and bins of each."""
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
    def radius(self) -> float:
        """Usual distance of the means from the zero point of the specific forces, m/s²."""
        return usual_norm(self.means - self.noise.center)

    @property
    def used(self) -> NDArray[np.bool_]:
        """Which of them are not left out, (n,)."""
        return (self.table["left_out"] == "").to_numpy()

    @property
    def left_out(self) -> dict[int, str]:
        """Numbers of the others, with the reason."""
        reasons = self.table["left_out"]
        return dict(zip(reasons.index[~self.used].tolist(), reasons[~self.used], strict=True))


# --- Windows -------------------------------------------------------------------------------------


class Windows(NamedTuple):
    """Windows that slide over the samples of a log by one sample; none spans a gap.

    A channel that does not change in a window is frozen, unless the steps in which it is read
    explain it: then no window has less noise than that of rounding.

    Attributes
    ----------
    width : int, samples of a window; odd
    variance : (n,) array, (m/s²)², norm of the variances of the axes in the window about each
        sample; NaN about those too near to a gap or an end for a window, and if it is frozen
    about : slice or (n,) bool array, samples about which there is a window
    steps : (3,) array, m/s², in which the axes are read; 0 where there are none
    warnings : list of str
    threshold : float, m/s²; a window with at most this standard deviation (the root of the norm of
        the variances of its axes) is at rest
    floor : float, m/s², standard deviation of the noise by the same measure; NaN if not needed
    reason : str, how the threshold was chosen
    """

    width: int
    variance: Array
    about: slice | NDArray[np.bool_]
    steps: Array
    warnings: list[str]
    threshold: float = np.nan
    floor: float = np.nan
    reason: str = ""


def usual_window(log: Log) -> float:
    """Length of a window, s: 1 s, or 9 samples of a slow log if its unit of time is plausible."""
    return 1.0 if log.unit_hint() else max(1.0, (MIN_SAMPLES + 1) * log.step)


def windows_at_rest(log: Log, seconds: float | None = None, given: float | None = None) -> Windows:
    """Windows of a length in s, with the threshold, m/s², that separates rest from motion.

    Unless it is given it is a multiple of the noise floor: 3, since noise differs between
    attitudes; up to 10 as long as it is below 0.003 g. A quiet sensor feels footsteps and pumps,
    and whatever moves less than that in a second is not being turned.

    Raises
    ------
    InputError
        If the samples of a window are too few for a variance, or so many that the rate must be
        wrong, or a channel is frozen.
    """
    window = seconds or usual_window(log)
    samples = window / log.step
    if not MIN_SAMPLES <= samples <= MAX_SAMPLES:
        raise InputError(
            f"{log.path}: a window of {window:g} s holds {samples:.3g} samples, at "
            f"{1 / log.step:.6g} per second{log.unit_hint() or '; is the rate (`rate`) right?'}"
        )
    windows = slide_windows(log, round(samples) | 1)
    if given is not None:
        return windows._replace(threshold=given, reason="as given")
    floor = _noise_floor(windows.variance)
    if not np.isfinite(floor):
        raise InputError(f"{log.path}: a channel does not change in any window; is it frozen?")
    threshold = max(THRESHOLD_FACTOR * floor, min(QUIET_FACTOR * floor, QUIET))
    reason = f"{threshold / floor:.3g} times the noise floor of {floor:.3g} m/s²"
    reason += ", the sd of most windows at rest"
    return windows._replace(threshold=threshold, floor=floor, reason=reason)


def slide_windows(log: Log, width: int) -> Windows:
    """Windows of so many samples; raises `InputError` if the log is too short for one."""
    half, part = width // 2, log.part
    piece = np.cumsum((np.diff(log.time) > GAP_RATIO * log.step) | (np.diff(part) > 0))
    gaps = int(piece[-1]) - int(part[-1])
    variance, frozen = window_variance(log.forces, width)
    if piece[-1]:
        piece = np.concatenate([[0], piece])
        variance[half : len(piece) - half][piece[2 * half :] != piece[: -2 * half]] = np.nan
    covered = np.isfinite(variance)
    if not covered.any():
        raise InputError(
            f"{log.path}: too few samples for a window of {width}, or gaps all over"
            f"{log.unit_hint()}"
        )
    # A part of an array is no copy of it.
    whole = slice(half, len(covered) - half)
    about = whole if covered[whole].all() else covered
    steps = np.array([step_in(force[about]) for force in log.forces.T])
    warnings = [f"{plural(gaps, 'gap')} in time; no hold spans one"] if gaps else []
    rounding = noise_of_steps(steps)
    floor = _noise_floor(variance) if rounding else 0.0
    # If all windows that change are motion, nothing else explains that others do not.
    if 0 < floor <= MAX_COARSE_RATIO * rounding or floor > MAX_REST_NOISE * STANDARD_GRAVITY:
        np.maximum(variance, rounding**2, out=variance)
    elif (share := np.sum(frozen & covered) / covered.sum()) > 0:
        variance[frozen] = np.nan
        warnings.append(
            f"a channel does not change over a window in {100 * share:.2g} % of the log; left out"
        )
    return Windows(width, variance, about, steps, warnings)


def noise_of_steps(steps: Array) -> float:
    """Noise of a window by rounding alone, m/s²."""
    return float(np.sqrt(np.linalg.norm(steps**2 / 12)))


def window_variance(forces: Array, width: int) -> tuple[Array, NDArray[np.bool_]]:
    """Norm of the variances of the axes about each sample, (n,), and where an axis is constant."""
    variance, constant = np.full(len(forces), np.nan), np.zeros(len(forces), dtype=bool)
    for first in range(0, len(forces) - width + 1, _TOGETHER):
        block = forces[first : first + _TOGETHER + width - 1]
        middle = slice(first + width // 2, first + len(block) - width // 2)
        of_axes = pd.DataFrame(block).rolling(width).var(ddof=0).to_numpy()[width - 1 :]
        variance[middle] = np.sqrt(np.sum(of_axes**2, axis=1))
        # Rounding may hide a variance of zero, so readings that do not change are counted.
        same = np.diff(block, axis=0, prepend=block[:1]) == 0
        if np.count_nonzero(same, axis=0).max() >= width:
            alike = np.cumsum(same, axis=0)
            still = alike[width - 1 :] - alike[: 1 - width] == width - 1
            constant[middle] = np.any(still, axis=1)
    return variance, constant


def _noise_floor(variance: Array) -> float:
    """Noise around which windows at rest crowd, m/s²; infinite without a window that changes.

    Otsu's method finds the valley between rest and motion in the histogram of the logarithmic
    variances: it divides them into two classes with the largest variance between these. At rest
    they crowd around one value; in motion they spread over decades.
    """
    decades = np.log10(variance, where=variance > 0, out=np.full(len(variance), np.nan))
    bins = 2 * _DECADES * _PER_DECADE
    counts, edges = np.histogram(decades, bins, (-_DECADES, _DECADES))
    if not counts.any():
        return np.inf
    middle = (edges[:-1] + edges[1:]) / 2
    below, moment = np.cumsum(counts)[:-1].astype(float), np.cumsum(counts * middle)
    above = counts.sum() - below
    # An empty class has no mean, and no weight.
    low = moment[:-1] / np.maximum(below, 1)
    high = (moment[-1] - moment[:-1]) / np.maximum(above, 1)
    between = below * above * (high - low) ** 2
    best = np.flatnonzero(between >= between.max() * (1 - 1e-9))
    valley = middle[best[len(best) // 2]] if between.max() > 0 else middle[np.argmax(counts)]
    quiet = np.where(middle <= valley, counts, 0)
    # Smoothed over a tenth of a decade, so that a short log with few windows has a peak, too.
    mode = middle[np.argmax(np.convolve(quiet, np.ones(5), "same"))]
    crowd = np.where(np.abs(middle - mode) <= np.log10(2), counts, 0)
    return float(np.sqrt(10.0 ** middle[np.searchsorted(np.cumsum(crowd), crowd.sum() / 2)]))


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
    if not (table["left_out"] == "").any():
        if TURNS in why:
            raise _never_still(log, windows, "it turns slowly in all that looks like a hold")
        raise InputError(
            f"{log.path}: no static hold of {settings.shortest:g} s or more (a window is at rest "
            f"up to {windows.threshold:.3g} m/s²)" + "".join(f"; {w}" for w in warnings)
        )
    return _holds_of(log, windows, table, settings, warnings)


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
    lost = (settings.window or usual_window(log)) + 2 * settings.trim
    spans = (np.sort(short)[[0, -1]] + 2 * cut + windows.width) * step
    left = (spans[0] - lost) * (1 + 1e-9)
    digit = 10.0 ** np.floor(np.log10(left))
    said = " to ".join(dict.fromkeys(f"{span:.1f}" for span in spans))
    are, them = ("are", "them") if len(short) > 1 else ("is", "it")
    return runs, [
        f"{plural(len(short), 'rest')} of {said} s {are} no hold: it takes {lost + shortest:.3g} s,"
        f" of which {lost:.3g} s at its ends do not count; `shortest` "
        f"{digit * np.floor(left / digit):g} (now {shortest:g}) takes {them}"
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
    inner = np.array([
        np.min(read, axis=0, where=read > ends[0], initial=np.inf),
        np.max(read, axis=0, where=read < ends[1], initial=-np.inf),
    ])  # fmt: skip
    noise = noise_before_rounding(step, np.median([f.std(axis=0, ddof=1) for f in forces], axis=0))
    with np.errstate(divide="ignore", invalid="ignore"):
        steps = np.where(step > 0, step / noise, 0.0)
    steps[noise == 0] = np.inf  # every reading is the same in most holds
    normal = NormalDist()  # scipy.special takes long to import
    saturated = []
    for each in forces:
        n = len(each)
        at_end, beside = (np.sum(each == x[:, None], axis=1) for x in (ends, inner))
        middle = normal.inv_cdf(min(MAX_BEYOND / n, 0.5))
        share = np.array([normal.cdf(middle + step) for step in steps])
        explained = n * share + MIN_WITHIN * np.sqrt(n * share * (1 - share))
        piled = at_end > np.maximum(MAX_SATURATED_SHARE * n, explained)
        saturated.append(np.any(piled & (at_end > beside)))
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
        why = (
            f"what looks like rest varies by {windows.floor:.3g} m/s², slowly like a hand, not "
            "like the noise of a sensor"
        )
        raise _never_still(log, windows, why, size)
    return holds


def _moves(holds: Holds, records: Sequence[Array]) -> bool:
    """Whether the windows "at rest" show motion: large compared with gravity, and slow.

    The noise of a sensor at rest is below a few hundredths of gravity. The vibration of a machine
    may be larger, but it is quick and averages out like white noise. A human body moves slowly.
    """
    if not holds.windows.floor > MAX_REST_NOISE * min(holds.radius, STANDARD_GRAVITY):
        return False
    sd = float(np.sqrt(np.mean(holds.noise.sd**2)))
    if sd == 0:  # all samples of a coarse sensor are rounded alike
        return False
    curve = pooled_deviation(records, holds.log.step)
    reliable = (curve.differences >= MIN_DIFFERENCES) & (curve.tau >= QUICK_RATIO)
    if not reliable.any():
        return True
    white = sd * np.sqrt(holds.log.step / curve.tau[reliable])
    return bool(np.max(curve.pooled[reliable] / white) > SLOW_RATIO)


def _never_still(log: Log, windows: Windows, why: str, size: int | None = None) -> InputError:
    if size is not None:
        return InputError(
            f"{log.path}: blocks of {size} samples are no positions: {why}; is the number of "
            "samples (`block`) right, or does a file hold a move?"
        )
    least = np.sqrt(np.nanquantile(windows.variance, 0.01))
    return InputError(
        f"{log.path}: the sensor was never still: {why}; the quietest hundredth of its windows of "
        f"{windows.width * log.step:.2g} s varies by {least:.3g} m/s². Lay it down for some "
        "seconds in each of ten or more attitudes, on a table or in a fixture"
    )
