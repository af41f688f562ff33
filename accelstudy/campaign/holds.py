"""Static holds in a log: where a sliding window varies no more than the noise of the sensor.

The detector is that of Tedaldi, Pretto and Menegatti (ICRA 2014): the norm of the variances of the
three axes in a window, against a threshold. The threshold comes from the data. The log is read
twice, first for the threshold, then for the holds, and only a piece of it is in memory at a time.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from accelstudy.campaign.allan import AllanDeviation, AllanSums
from accelstudy.campaign.logs import AXES, GAP, Log
from accelstudy.errors import InputError

Array = NDArray[np.float64]

FACTOR = 9.0
"""Threshold over noise floor, in variance; a sensor's noise differs between attitudes."""
LONGEST_RECORD = 2**20
"""Samples of a hold that are kept for the Allan deviation; what follows counts for the mean."""
SATURATED = 0.05
"""Share of the samples of a hold at the end of the scale that makes it useless."""

_ALIKE = 1.5  # largest over smallest norm of the means of one sensor in gravity
_SMALLEST_WINDOW, _LARGEST_WINDOW = 8, 10**6
_BINS = np.linspace(-40.0, 40.0, 4001)  # decades of variance


@dataclass(frozen=True)
class Threshold:
    """What separates rest from motion.

    Attributes
    ----------
    sd : float, m/s²; a window with at most this standard deviation (the root of the norm of the
        variances of its axes) is at rest
    floor : float, m/s², standard deviation of the noise by the same measure; NaN if not needed
    reason : str, how the threshold was chosen
    """

    sd: float
    floor: float
    reason: str


@dataclass(frozen=True)
class Holds:
    """Static holds of a log, n of them, in order of time.

    Attributes
    ----------
    start, end : (n,) int arrays, first sample, and the one after the last
    t0, t1 : (n,) arrays, s, times of the first and of the last sample
    n_samples : (n,) int array
    mean, sd : (n, 3) arrays, m/s²
    threshold : Threshold
    window : int, samples in a window
    step : float, s, usual time between samples
    span : (float, float), s, first and last time in the log
    total : int, samples in the log that a window is centred at
    allan : AllanDeviation, of all holds together; channels: along the mean specific force of a
        hold, and twice across
    noise : (3,) array, m/s², root mean square sd of the samples within holds in these channels
    directed : bool, whether the means are near enough to forces for "along" to mean anything;
        counts without an offset are not
    warnings : tuple of str
    """

    start: NDArray[np.int_]
    end: NDArray[np.int_]
    t0: Array
    t1: Array
    n_samples: NDArray[np.int_]
    mean: Array
    sd: Array
    threshold: Threshold
    window: int
    step: float
    span: tuple[float, float]
    total: int
    allan: AllanDeviation
    noise: Array
    directed: bool
    warnings: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.start)

    def table(self) -> pd.DataFrame:
        """Table with one row for each hold."""
        columns: dict[str, NDArray[Any]] = {
            "start": self.start,
            "end": self.end,
            "t0_s": self.t0,
            "t1_s": self.t1,
            "n": self.n_samples,
        }
        columns |= {axis: self.mean[:, i] for i, axis in enumerate(AXES)}
        columns |= {f"sd_{axis}": self.sd[:, i] for i, axis in enumerate(AXES)}
        return pd.DataFrame(columns)


def find_holds(
    log: Log,
    *,
    window: float = 1.0,
    threshold: float | None = None,
    trim: float = 0.2,
    shortest: float = 1.0,
) -> Holds:
    """Find the static holds of a log.

    Parameters
    ----------
    log : Log
    window : float, s, length of the sliding window; a hold begins and ends half a window inside
        the samples at rest
    threshold : float, m/s², standard deviation of a window up to which it is at rest; chosen from
        the data if omitted
    trim : float, s, cut from both ends of a hold besides
    shortest : float, s, of what is left

    Raises
    ------
    InputError
        If the log cannot be read, is shorter than a window, or nothing in it is at rest.
    """
    width = _width(log, window)
    survey = _survey(log, width)
    chosen = _given(threshold) if threshold is not None else _choose(survey, log)
    cut, least = round(trim / log.step), max(2, round(shortest / log.step))
    sums, found, spreads, saturated, short = AllanSums(), [], [], 0, 0
    for hold in _runs(log, width, chosen.sd**2, cut, survey.extremes):
        if hold.n < least:
            short += 1
        elif hold.saturated():
            saturated += 1
        else:
            turned = hold.release() @ _frame(hold.mean)
            sums.add(turned)
            spreads.append(turned.var(axis=0, ddof=1))
            found.append(hold)
    warnings = [*survey.warnings()]
    if saturated:
        warnings.append(f"{_count(saturated, 'hold')} left out: the sensor is saturated there")
    if not found:
        raise InputError(
            f"{log.path}: no static hold of {shortest:g} s or more "
            f"({_count(short, 'shorter one')}; a window is at rest up to {chosen.sd:.3g} m/s²)"
            + "".join(f"; {warning}" for warning in warnings)
        )
    return Holds(
        start=np.array([hold.start for hold in found]),
        end=np.array([hold.start + hold.n for hold in found]),
        t0=np.array([hold.t0 for hold in found]),
        t1=np.array([hold.t1 for hold in found]),
        n_samples=np.array([hold.n for hold in found]),
        mean=np.array([hold.mean for hold in found]),
        sd=np.array([np.sqrt(hold.squares / (hold.n - 1)) for hold in found]),
        threshold=chosen,
        window=width,
        step=log.step,
        span=survey.span,
        total=survey.total,
        allan=sums.deviation(log.step),
        noise=np.sqrt(np.mean(spreads, axis=0)),
        directed=_alike(np.linalg.norm([hold.mean for hold in found], axis=1)),
        warnings=tuple(warnings),
    )


def _width(log: Log, window: float) -> int:
    samples = window / log.step
    if not _SMALLEST_WINDOW <= samples <= _LARGEST_WINDOW:
        raise InputError(
            f"{log.path}: a window of {window:g} s holds {samples:.3g} samples; are the rate "
            f"({1 / log.step:.6g} per second) and the unit of time right?"
        )
    return round(samples) | 1  # odd, so that it has a middle


def _frame(force: Array) -> Array:
    """Orthonormal columns, the first of them along `force`.

    A sensor that settles or is nudged turns a little; gravity then moves across the mean specific
    force, and along it only in the second order. What is left along it is the sensor's own noise.
    """
    size = float(np.linalg.norm(force))
    if size == 0:
        return np.eye(3)
    return np.linalg.svd(force[:, None] / size)[0]


def _alike(norms: Array) -> bool:
    """Whether the norms are all that of gravity but for an uncalibrated sensor's errors."""
    return bool(norms.max() <= _ALIKE * norms.min())


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}" + ("" if number == 1 else "s")


# --- Windows -------------------------------------------------------------------------------------


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


# --- First reading: the threshold ----------------------------------------------------------------


class _Survey:
    """What the first reading finds."""

    def __init__(self) -> None:
        self.counts = np.zeros(len(_BINS) - 1, dtype=int)
        self.total = self.frozen = self.gaps = 0
        self.span = (np.nan, np.nan)
        # Per axis the lowest and the highest value, and the ones next to them.
        self.extremes = np.array([[[np.inf] * 3] * 2, [[-np.inf] * 3] * 2])

    def add(self, batch: Windows) -> None:
        self.gaps = batch.piece
        if not len(batch.time):
            return
        self.span = (batch.time[0] if np.isnan(self.span[0]) else self.span[0], batch.time[-1])
        self.total += len(batch.time)
        self.frozen += int(batch.frozen.sum())
        alive = batch.variance[~batch.frozen & (batch.variance > 0)]
        self.counts += np.histogram(np.log10(alive), _BINS)[0]
        self.extremes[0] = _two_lowest(self.extremes[0], batch.forces)
        self.extremes[1] = -_two_lowest(-self.extremes[1], -batch.forces)

    def warnings(self) -> Iterator[str]:
        if self.gaps:
            yield f"{_count(self.gaps, 'gap')} in time; no hold spans one"
        if self.frozen:
            share = 100 * self.frozen / self.total
            yield f"a channel does not change over a window in {share:.2g} % of the log; left out"


def _two_lowest(known: Array, forces: Array) -> Array:
    candidates = np.vstack([known, forces])
    lowest = candidates.min(axis=0)
    return np.array([lowest, np.where(candidates > lowest, candidates, np.inf).min(axis=0)])


def _survey(log: Log, width: int) -> _Survey:
    survey = _Survey()
    for batch in windows(log, width):
        survey.add(batch)
    if not survey.total:
        raise InputError(f"{log.path}: too few samples for a window of {width}, or gaps all over")
    return survey


def _given(sd: float) -> Threshold:
    if not (np.isfinite(sd) and sd > 0):
        raise InputError(f"threshold: must be positive, not {sd:g}")
    return Threshold(sd, np.nan, "as given")


def _choose(survey: _Survey, log: Log) -> Threshold:
    """Take a multiple of the noise floor: of the variance that windows at rest usually have.

    Otsu's valley of the logarithmic variances parts rest from motion, though not sharply; at rest
    they crowd around one value, while in motion they spread over decades.
    """
    counts = survey.counts
    if not counts.any():
        raise InputError(f"{log.path}: a channel does not change in any window; is it frozen?")
    middle = (_BINS[:-1] + _BINS[1:]) / 2
    quiet = np.where(middle <= _otsu(counts, middle), counts, 0)
    # Smoothed over a tenth of a decade, so that the few windows of a short log have a crowd too.
    mode = middle[np.argmax(np.convolve(quiet, np.ones(5), "same"))]
    crowd = np.where(np.abs(middle - mode) <= np.log10(2), counts, 0)
    floor = 10.0 ** middle[np.searchsorted(np.cumsum(crowd), crowd.sum() / 2)]
    sd, noise = np.sqrt(FACTOR * floor), np.sqrt(floor)
    return Threshold(
        float(sd),
        float(noise),
        f"{np.sqrt(FACTOR):.3g} times the noise floor of {noise:.3g} m/s², "
        "around which windows at rest crowd",
    )


def _otsu(counts: NDArray[np.int_], middle: Array) -> float:
    """Value that parts a histogram in two with the largest variance between them."""
    below = np.cumsum(counts)[:-1].astype(float)
    above = counts.sum() - below
    moment = np.cumsum(counts * middle)
    # Empty classes have no mean, and no weight either.
    low = moment[:-1] / np.maximum(below, 1)
    high = (moment[-1] - moment[:-1]) / np.maximum(above, 1)
    between = below * above * (high - low) ** 2
    if not between.max() > 0:
        return float(middle[np.argmax(counts)])
    best = np.flatnonzero(between >= between.max() * (1 - 1e-9))
    return float(middle[best[len(best) // 2]])


# --- Second reading: the holds -------------------------------------------------------------------


class _Hold:
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


def _runs(log: Log, width: int, largest: float, cut: int, extremes: Array) -> Iterator[_Hold]:
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
                hold = _Hold(batch.index + first, cut, extremes)
            hold.grow(batch.time[first:end], batch.forces[first:end])
            if end < len(still):
                yield hold
                hold = None
        if hold is not None and len(still) and not still[-1]:
            yield hold
            hold = None
    if hold is not None:
        yield hold
