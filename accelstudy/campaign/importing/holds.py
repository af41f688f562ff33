"""Static holds of a log: runs of samples at rest, or blocks of which each is a position.

A hold is a run of samples about which the windows are at rest.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from statistics import NormalDist

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from accelstudy.basics.errors import InputError
from accelstudy.basics.units import STANDARD_GRAVITY
from accelstudy.basics.wording import plural, short_list
from accelstudy.campaign.importing.allan import MIN_DIFFERENCES
from accelstudy.campaign.importing.columns import AXES, SDS
from accelstudy.campaign.importing.noise import (
    HoldNoise,
    hold_noise,
    noise_before_rounding,
)
from accelstudy.campaign.importing.recording import Recording
from accelstudy.campaign.importing.settings import ImportSettings
from accelstudy.campaign.importing.windows import (
    MAX_REST_NOISE,
    THRESHOLD_FACTOR,
    Threshold,
    Windows,
    usual_window,
)
from accelstudy.leveling.angles import usual_norm

Array = NDArray[np.float64]

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
    windows : Windows, of the log
    threshold : Threshold
    table : DataFrame, a row for each hold, by the number that figures and options use; see
        `hold_table`
    left_out : mapping of int to str, numbers of holds that are left out, with the reason
    noise : HoldNoise, of the holds that are not left out
    warnings : tuple of str
    size : int, samples of each block, or of the shortest, if the log consists of blocks
    """

    windows: Windows
    threshold: Threshold
    table: pd.DataFrame
    left_out: Mapping[int, str]
    noise: HoldNoise
    warnings: tuple[str, ...]
    size: int | None = None

    @property
    def log(self) -> Recording:
        """The log."""
        return self.windows.log

    @property
    def means(self) -> Array:
        """Mean specific forces, (n, 3), m/s²."""
        return self.table[[*AXES]].to_numpy()

    @property
    def radius(self) -> float:
        """Usual distance of the means from the zero point of the specific forces, m/s²."""
        return usual_norm(self.means - self.noise.center)

    @property
    def are_used(self) -> NDArray[np.bool_]:
        """Which of them are not left out, (n,)."""
        return ~self.table.index.isin([*self.left_out])

    def without(self, reasons: Mapping[int, str]) -> Holds:
        """Return the others, as if these had not been found, with warnings that say why."""
        return replace(
            self,
            table=self.table.drop(index=[*reasons]),
            left_out={n: why for n, why in self.left_out.items() if n not in reasons},
            warnings=(*self.warnings, *(f"hold {n} left out: {why}" for n, why in reasons.items())),
        )


# --- Runs at rest --------------------------------------------------------------------------------


def find_holds(log: Recording, settings: ImportSettings, one_each: bool = False) -> Holds:
    """Find the static holds of a log, each of which begins and ends half a window inside a rest.

    Rests in which the sensor is saturated, or turns, are left out.

    Parameters
    ----------
    log : Recording
    settings : ImportSettings, of which those of the holds count
    one_each : bool, whether the log has several recordings with one position each: the longest
        hold, which gets the number of the recording

    Raises
    ------
    InputError
        If the log is shorter than a window, nothing in it is at rest, or the sensor was never
        still.
    """
    windows = Windows.lasting(log, settings.window_s)
    threshold = windows.threshold(settings.threshold_mps2)
    runs, too_short = _runs_at_rest(windows, threshold.sd, settings)
    # A sensor that turns slowly is nearly still in each window, yet has no constant attitude: its
    # force changes over the run by more than within each of them.
    turns = [scatter(log.forces[run]) > MAX_WANDER * threshold.sd for run in runs]
    reasons = {i: TURNS for i, turning in enumerate(turns) if turning}
    reasons |= dict.fromkeys(find_saturated(windows, runs, settings.full_range), SATURATED)
    numbers = dict(enumerate(range(len(runs)), 1))
    if one_each:
        part, lengths = log.part, [run.stop - run.start for run in runs]
        last_is_best = sorted(range(len(runs)), key=lambda i: (i not in reasons, lengths[i]))
        numbers = dict(sorted({int(part[runs[i].start]) + 1: i for i in last_is_best}.items()))
    left_out = {n: reasons[i] for n, i in numbers.items() if i in reasons}
    why = Counter(left_out.values())
    lost = [f"{plural(count, 'hold')} left out: {reason}" for reason, count in why.items()]
    warnings = [*windows.warnings, *lost, *too_short]
    if len(left_out) == len(numbers):
        if TURNS in why:
            raise _never_still(windows, "it turns slowly in all that looks like a hold", settings)
        raise InputError(
            f"{log.path}: no static hold of {settings.shortest_s:g} s or more (a window "
            f"is at rest up to {threshold.sd:.3g} m/s²)" + "".join(f"; {w}" for w in warnings)
        )
    holds = {n: runs[i] for n, i in numbers.items()}
    return _holds_of(windows, threshold, holds, warnings, settings, left_out)


def _runs_at_rest(
    windows: Windows, limit: float, settings: ImportSettings
) -> tuple[list[slice], list[str]]:
    """Samples that are at rest for long enough, in windows up to an sd in m/s².

    Also a line about rests that are too short, with the option that takes them.
    """
    step, shortest = windows.log.step, settings.shortest_s
    still = windows.variance <= limit**2
    edges = np.flatnonzero(np.diff(still, prepend=False, append=False)).reshape(-1, 2)
    cut, least = round(settings.trim_s / step), max(2, round(shortest / step))
    rests = edges + np.array([cut, -cut])
    lengths = np.diff(rests)[:, 0]
    runs = [slice(first, end) for first, end in rests[lengths >= least].tolist()]
    short = lengths[(lengths >= MIN_REST) & (lengths < least)]
    if not len(short):
        return runs, []
    lost = (settings.window_s or usual_window(windows.log)) + 2 * settings.trim_s
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


def find_blocks(log: Recording, settings: ImportSettings) -> Holds:
    """Make each block of a log a position; those in which the sensor moves are left out.

    The blocks have as many samples as the settings say, or are the files of the log. Nothing has to
    be found in them.

    Raises
    ------
    InputError
        If the log does not end with a block, or the sensor is saturated or moves in all of them.
    """
    block = log.part
    if (size := settings.block) is not None:
        row, total = log.samples.index.to_numpy(), len(log.first.lost)
        fewer = total // size * size
        if len(row) and row[-1] >= fewer:  # a note at the end is no sample
            raise InputError(
                f"{log.path}: {total} samples are no multiple of the {size} of a block (`block`): "
                f"{fewer} or {fewer + size} would be {fewer // size} or {fewer // size + 1} "
                "positions"
            )
        block = row // size  # a row that is left out counts as well
    edges = [*np.flatnonzero(np.diff(block, prepend=-1)).tolist(), len(block)]
    blocks = {int(block[i]) + 1: slice(i, end) for i, end in pairwise(edges)}
    least = size or int(np.diff(edges).min())
    if least < PARTS:
        raise InputError(f"{log.path}: {least} samples; a position has at least {PARTS}")
    # Blocks of which most is left out are no positions, which the report says.
    blocks = {n: each for n, each in blocks.items() if each.stop - each.start >= PARTS}
    windows, numbers = Windows(log, (least // 2) | 1), [*blocks]
    full = find_saturated(windows, [*blocks.values()], settings.full_range)
    left_out = {numbers[i]: SATURATED for i in full}
    scatters = {
        n: scatter(np.array([p.mean(axis=0) for p in np.array_split(log.forces[each], PARTS)]))
        for n, each in blocks.items()
        if n not in left_out
    }
    if not scatters:
        raise InputError(f"{log.path}: the sensor is saturated in all blocks of {least} samples")
    if settings.threshold_mps2:
        threshold = windows.threshold(settings.threshold_mps2)
    else:
        # Rounding hides the scatter of a coarse sensor.
        hidden = THRESHOLD_FACTOR / MAX_TREMOR * windows.rounding
        usual = max(float(np.median([*scatters.values()])), hidden)
        reason = f"{MAX_TREMOR:g} times the scatter of the {PARTS} parts of a typical block"
        threshold = Threshold(MAX_TREMOR * usual, usual, reason)
    for number, each in scatters.items():
        if each > threshold.sd:
            left_out[number] = f"the sensor moves: its parts scatter by {each:.2g} m/s²"
    return _holds_of(windows, threshold, blocks, windows.warnings, settings, left_out, least)


# --- What is no measurement ----------------------------------------------------------------------


def scatter(forces: Array) -> float:
    """Root of the norm of the variances of the axes, m/s², which is the measure of the detector."""
    return float(np.sqrt(np.linalg.norm(forces.var(axis=0, ddof=1))))


def find_saturated(windows: Windows, holds: Sequence[slice], full_range: float) -> list[int]:
    """Find holds with samples at the sensor's range or, if it is unknown, at the extreme.

    In a hold of n samples of which none lies beyond the last step, the mean may be so high that
    `MAX_BEYOND` of them were expected there. Those above the last edge but one are as many as the
    step, and the noise before rounding, explain.

    Parameters
    ----------
    windows : Windows
    holds : sequence of slices of the samples of the log
    full_range : float, m/s², the sensor measures ± this; infinite if unknown

    Returns
    -------
    list of int, places of the holds in their sequence
    """
    forces, step = [windows.log.forces[hold] for hold in holds], windows.steps
    if np.isfinite(full_range) or not forces:
        # The largest reading of a converter is a step less than its range.
        limit = full_range - step.max()
        return [i for i, each in enumerate(forces) if reaches_range(each, limit)]
    ends, inner = np.empty((2, 2, 3))
    for axis, force in enumerate(windows.log.forces.T):
        read = force[windows.centred]
        low, high = ends[:, axis] = read.min(), read.max()
        inner[0, axis] = np.min(read, where=read > low, initial=np.inf)
        inner[1, axis] = np.max(read, where=read < high, initial=-np.inf)
    noise = noise_before_rounding(step, np.median([f.std(axis=0, ddof=1) for f in forces], axis=0))
    with np.errstate(divide="ignore", invalid="ignore"):
        steps = np.where(step > 0, step / noise, 0.0)
    steps[noise == 0] = np.inf  # every reading is the same in most holds
    normal, found = NormalDist(), []  # scipy.special takes long to import
    for i, each in enumerate(forces):
        n = len(each)
        at_end, beside = (np.sum(each == x[:, None], axis=1) for x in (ends, inner))
        middle = normal.inv_cdf(min(MAX_BEYOND / n, 0.5))
        share = np.array([normal.cdf(middle + step) for step in steps])
        explained = n * share + MIN_WITHIN * np.sqrt(n * share * (1 - share))
        if np.any((at_end > np.maximum(MAX_SATURATED_SHARE * n, explained)) & (at_end > beside)):
            found.append(i)
    return found


def reaches_range(forces: Array, full_range: float) -> bool:
    """Whether samples (n, 3) of a hold, m/s², lie at the sensor's range ±`full_range`."""
    # Conversion from counts or g rounds.
    beyond = np.abs(forces) >= full_range * (1 - 1e-9)
    return bool(np.any(beyond.sum(axis=0) > MAX_SATURATED_SHARE * len(forces)))


# --- The table of holds --------------------------------------------------------------------------


def hold_table(log: Recording, holds: Mapping[int, slice]) -> pd.DataFrame:
    """Table of holds by their numbers, from the samples of each.

    Its columns are start and end (first sample, and the one after the last), t0 and t1 (times of
    the first and of the last sample, s), n (samples), fx … (means, m/s²), sd_fx … (standard
    deviations of the samples), and, as far as the log has them, the mean temperature, °C, and the
    rms vibration, m/s²; NaN where nothing was measured.
    """
    rows = []
    for hold in holds.values():
        forces, time = log.forces[hold], log.time[hold]
        row = {"start": hold.start, "end": hold.stop, "t0": time[0], "t1": time[-1]}
        row |= {"n": len(forces), **dict(zip(AXES, forces.mean(axis=0), strict=True))}
        row |= dict(zip(SDS, forces.std(axis=0, ddof=1), strict=True))
        for name in log.conditions:
            power = 2 if name == "vibration" else 1
            known = log.samples[name].iloc[hold].dropna().to_numpy() ** power
            row[name] = known.mean() ** (1 / power) if len(known) else np.nan
        rows.append(row)
    return pd.DataFrame(rows, index=[*holds])


def _holds_of(
    windows: Windows,
    threshold: Threshold,
    holds: Mapping[int, slice],
    warnings: Sequence[str],
    settings: ImportSettings,
    left_out: Mapping[int, str],
    size: int | None = None,
) -> Holds:
    """Holds, of which a person leaves out some, too, if the sensor was still in the others.

    Raises
    ------
    InputError
        If there is no such hold, a person leaves all of them out, or the sensor was never still.
    """
    log, left_out = windows.log, {**left_out, **settings.left_out}
    for number in sorted(left_out.keys() - holds.keys()):
        there = short_list([str(each) for each in holds])
        raise InputError(f"exclude: there is no hold {number}; they are {there}")
    used = [log.forces[hold] for number, hold in holds.items() if number not in left_out]
    if not used:
        why = f"exclude: no {'hold' if size is None else 'block'} is left"
        raise InputError(f"{log.path}: {why} ({next(iter(left_out.values()))})")
    noise = hold_noise(used, log.step, windows.steps)
    table = hold_table(log, holds)
    found = Holds(windows, threshold, table, left_out, noise, tuple(warnings), size)
    if _moves(found):
        why = (
            f"what looks like rest varies by {threshold.floor:.3g} m/s², slowly like a hand, not "
            "like the noise of a sensor"
        )
        raise _never_still(windows, why, settings, size)
    return found


def _moves(holds: Holds) -> bool:
    """Whether the windows "at rest" show motion: large compared with gravity, and slow.

    The noise of a sensor at rest is below a few hundredths of gravity. The vibration of a machine
    may be larger, but it is quick and averages out like white noise. A human body moves slowly.
    """
    if not holds.threshold.floor > MAX_REST_NOISE * min(holds.radius, STANDARD_GRAVITY):
        return False
    curve, sd = holds.noise.allan, float(np.sqrt(np.mean(holds.noise.sd**2)))
    if sd == 0:  # all samples of a coarse sensor are rounded alike
        return False
    reliable = (curve.differences >= MIN_DIFFERENCES) & (curve.tau >= QUICK_RATIO)
    if not reliable.any():
        return True
    white = sd * np.sqrt(holds.log.step / curve.tau[reliable])
    return bool(np.max(curve.pooled[reliable] / white) > SLOW_RATIO)


def _never_still(
    windows: Windows, why: str, settings: ImportSettings, size: int | None = None
) -> InputError:
    if size is not None:
        return InputError(
            f"{windows.log.path}: blocks of {size} samples are no positions: {why}; is the number "
            "of samples (`block`) right, or does a file hold a move?"
        )
    least = np.sqrt(np.nanquantile(windows.variance, 0.01))
    seconds = settings.window_s or usual_window(windows.log)
    return InputError(
        f"{windows.log.path}: the sensor was never still: {why}; the quietest hundredth of its "
        f"windows of {seconds:g} s varies by {least:.3g} m/s². Lay it down for some seconds in "
        "each of ten or more attitudes, on a table or in a fixture"
    )
