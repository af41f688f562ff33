"""Windows that slide over a log: its noise, and the threshold up to which one is at rest."""

from __future__ import annotations

import pickle
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from tempfile import SpooledTemporaryFile
from typing import Any
from weakref import finalize

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.errors import InputError
from accelstudy.basics.progress import track
from accelstudy.basics.units import STANDARD_GRAVITY
from accelstudy.campaign.importing.recording import GAP, Recording
from accelstudy.campaign.importing.resolution import Readings

Array = NDArray[np.float64]

_SMALLEST, _LARGEST = 8, 10**6  # samples
IN_MEMORY = 2**22
"""Bytes of windows that are kept in memory."""
FACTOR = 3.0
"""Threshold over noise floor; it leaves room for noise that differs between attitudes."""
QUIET_FACTOR, QUIET = 10.0, 0.003 * STANDARD_GRAVITY
"""The same for a quiet sensor, and the largest threshold that it may give, m/s²."""
RESTLESS = 0.02
"""Noise of windows, as a share of gravity, from which on it may be motion and not the sensor's."""
COARSE = 1.75
"""Noise of windows, as a multiple of that of rounding, up to which a sensor at rest may read the
same number all the time: that of noise of 0.4 steps."""

_BINS = np.linspace(-40.0, 40.0, 4001)  # decades of variance


def surveyed(
    logs: Sequence[Recording], window: float, threshold: float | None
) -> list[tuple[Survey, Threshold]]:
    """Read logs of simultaneous samples once, each for its noise and for what is at rest in it.

    Parameters
    ----------
    logs : sequence of Recording
    window : float, s
    threshold : float, m/s², standard deviation of a window up to which it is at rest; chosen from
        the data of each log if None

    Raises
    ------
    InputError
        If a log cannot be read, or no threshold can be told from it.
    """
    width = samples_in(logs[0], window)
    surveys = [survey_log(log, width) for log in logs]
    if threshold is not None:
        return [(survey, given_threshold(threshold)) for survey in surveys]
    return [(s, choose_threshold(s, log)) for s, log in zip(surveys, logs, strict=True)]


def usual_window(log: Recording) -> float:
    """Length of a window, s: 1 s, or 9 samples of a slow log if its unit of time is plausible."""
    return 1.0 if log.likely_unit() else max(1.0, (_SMALLEST + 1) * log.step)


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
    times, forces, others = np.empty(0), _columns(3), _columns(len(log.conditions))
    for rows in log.chunks():
        before = times[-1:] if len(times) else rows.time[:1]
        jumps = np.diff(rows.time, prepend=before) > GAP * log.step
        if rows.anew and row > 0:
            jumps[0], recording = True, recording + 1
        edges = sorted({0, *np.flatnonzero(jumps).tolist(), len(rows.time)})
        for first, end in pairwise(edges):
            if jumps[first]:
                piece += 1
                times, forces, others = times[:0], forces[:0], others[:0]
            times = np.concatenate([times, rows.time[first:end]])
            forces = np.concatenate([forces, rows.forces[first:end]])
            others = np.concatenate([others, rows.conditions[first:end]])
            row += end - first
            centred = max(0, len(times) - width + 1)
            empty = np.empty(0), np.empty(0, dtype=bool)
            variance, frozen = _spread(forces, width) if centred else empty
            inside = slice(half, half + centred)
            yield Windows(
                piece,
                recording,
                row - len(times) + half,
                times[inside],
                np.asfortranarray(forces[inside]),
                np.asfortranarray(others[inside]),
                variance,
                frozen,
            )
            times, forces, others = times[centred:], forces[centred:], others[centred:]


def _columns(count: int) -> Array:
    """No row yet of columns each of which lies in one piece, as sums along them are faster."""
    return np.empty((0, count), order="F")


def _spread(forces: Array, width: int) -> tuple[Array, NDArray[np.bool_]]:
    """Norm of the variances of the axes in each window, and whether an axis does not change."""
    squares = np.zeros(len(forces) - width + 1)
    frozen = np.zeros(len(squares), dtype=bool)
    # Axis by axis, as what a processor keeps at hand is small.
    for force in forces.T:
        # Squares of large numbers lose digits.
        offsets = force - force.mean()
        mean = _window_sums(offsets, width)
        mean /= width
        offsets *= offsets
        variance = _window_sums(offsets, width)
        variance /= width
        mean *= mean
        variance -= mean
        np.maximum(variance, 0.0, out=variance)
        variance *= variance
        squares += variance
        # Rounding may hide a variance of zero, so changes are counted.
        changed = force[1:] != force[:-1]
        if not changed.all():
            frozen |= _window_sums(changed, width - 1) == 0
    return np.sqrt(squares, out=squares), frozen


def _window_sums(values: NDArray[Any], width: int) -> Array:
    """Sums of `width` neighbours, each of its own values: a large one costs others no digits.

    A window is the end of one part of so many values and the beginning of the next part.
    """
    parts = np.zeros((-(-len(values) // width), width))
    parts.ravel()[: len(values)] = values
    ends = np.cumsum(parts[:, ::-1], axis=1)[:, ::-1].ravel()
    result: Array = np.cumsum(parts, axis=1).ravel()[width - 1 : len(values)]
    beyond = np.arange(len(result)) % width > 0
    result[beyond] += ends[: len(result)][beyond]
    return result


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


class KeptWindows:
    """Windows of a log that are kept for a second reading, since to read text takes long.

    They are kept in memory up to `IN_MEMORY` bytes, beyond that in a temporary file. Where that
    has no room, the log is read again.
    """

    def __init__(self, log: Recording, width: int) -> None:
        self._log, self._width = log, width
        # It lives as long as the survey, which no block of code does.
        self._file = SpooledTemporaryFile(IN_MEMORY)  # noqa: SIM115
        finalize(self, self._file.close)
        self._count = 0

    def first(self) -> Iterator[Windows]:
        """Read the log, and keep its windows."""
        for batch in windows(self._log, self._width):
            if self._count >= 0:
                try:
                    pickle.dump(batch, self._file, pickle.HIGHEST_PROTOCOL)
                    self._count += 1
                except OSError:
                    self._count = -1
            yield batch

    def again(self) -> Iterator[Windows]:
        """Yield the same windows as in the first reading."""
        if self._count < 0:
            yield from windows(self._log, self._width)
        self._file.seek(0)
        for _ in range(self._count):
            yield pickle.load(self._file)


class Survey:
    """Noise and extremes of a log, collected in a first pass over windows of `width` samples."""

    def __init__(self, log: Recording, width: int) -> None:
        self.width, self.kept = width, KeptWindows(log, width)
        self.counts, self._counts_frozen = np.zeros((2, len(_BINS) - 1), dtype=int)
        self._constant = 0
        self._readings = Readings()
        self.total = self.frozen = self.gaps = 0
        self.span = (np.nan, np.nan)
        # Per axis the lowest and the highest value, and the ones next to them.
        self.extremes = np.array([[[np.inf] * 3] * 2, [[-np.inf] * 3] * 2])

    def add(self, batch: Windows) -> None:
        """Add windows, in their order."""
        self.gaps = batch.piece - batch.recording
        if not len(batch.time):
            return
        self.span = (batch.time[0] if np.isnan(self.span[0]) else self.span[0], batch.time[-1])
        self.total += len(batch.time)
        self.frozen += int(batch.frozen.sum())
        varies = batch.variance > 0
        self._constant += int(np.sum(~varies))
        for counts, chosen in (
            (self.counts, varies & ~batch.frozen),
            (self._counts_frozen, varies & batch.frozen),
        ):
            counts += np.histogram(np.log10(batch.variance[chosen]), _BINS)[0]
        self._readings.add(batch.forces)
        self.extremes[0] = _two_lowest(self.extremes[0], batch.forces)
        self.extremes[1] = -_two_lowest(-self.extremes[1], -batch.forces)

    @cached_property
    def steps(self) -> Array:
        """Steps in which the axes are read, (3,), m/s²; 0 where there are none."""
        return self._readings.steps

    @property
    def rounding(self) -> float:
        """Noise of a window by rounding alone, m/s²."""
        return float(np.sqrt(np.linalg.norm(self.steps**2 / 12)))

    @cached_property
    def coarse(self) -> bool:
        """Whether the steps explain that a channel at rest does not change over a window.

        If all windows that change are motion, nothing else explains it either.
        """
        if not self.rounding > 0:
            return False
        noise = _noise_floor(self.counts + self._counts_frozen)
        return bool(noise <= COARSE * self.rounding or noise > RESTLESS * STANDARD_GRAVITY)

    @property
    def counts_at_rest(self) -> NDArray[np.int_]:
        """Histogram of the windows that may be at rest; none has less noise than that of rounding.

        A channel that does not change is frozen, unless its steps explain it.
        """
        if not self.coarse:
            return self.counts
        counts = self.counts + self._counts_frozen
        least = int(np.searchsorted(_BINS, 2 * np.log10(self.rounding)))
        counts[least] += counts[:least].sum() + self._constant
        counts[:least] = 0
        return counts

    def quietest(self) -> float:
        """Standard deviation that a hundredth of the windows does not exceed, m/s²."""
        rank = np.searchsorted(np.cumsum(self.counts), 0.01 * self.counts.sum())
        return float(10.0 ** (_BINS[min(rank, len(_BINS) - 2) + 1] / 2))


def _two_lowest(before: Array, forces: Array) -> Array:
    """Lowest value of each axis and the one next to it, (2, 3), with those before."""
    result = before.copy()
    for (lowest, next_to_it), force, ends in zip(before.T, forces.T, result.T, strict=True):
        if force.min() < next_to_it:
            candidates = np.append(force[force < next_to_it], [lowest, next_to_it])
            ends[0] = candidates.min()
            ends[1] = candidates[candidates > ends[0]].min(initial=np.inf)
    return result


def survey_log(log: Recording, width: int) -> Survey:
    """Read a log once, in windows of `width` samples."""
    survey = Survey(log, width)
    for batch in track(survey.kept.first(), f"noise of {log.path.name}"):
        survey.add(batch)
    if not survey.total:
        raise InputError(
            f"{log.path}: too few samples for a window of {width}, or gaps all over"
            f"{log.likely_unit()}"
        )
    return survey


def given_threshold(sd: float) -> Threshold:
    """Threshold that a person chose, m/s²."""
    if not (np.isfinite(sd) and sd > 0):
        raise InputError(f"threshold: must be positive, not {sd:g}")
    return Threshold(sd, np.nan, "as given")


def choose_threshold(survey: Survey, log: Recording) -> Threshold:
    """Choose a multiple of the noise floor, which is the usual noise of windows at rest.

    Otsu's method finds the valley between rest and motion in the histogram of the logarithmic
    variances. At rest they crowd around one value, the noise floor; in motion they spread over
    decades.

    The multiple is 3, since noise differs between attitudes. It is up to 10 as long as the
    threshold is below 0.003 g: a quiet sensor feels footsteps and pumps, and whatever moves less
    than that in a second is not being turned.
    """
    counts = survey.counts_at_rest
    if not counts.any():
        raise InputError(f"{log.path}: a channel does not change in any window; is it frozen?")
    noise = _noise_floor(counts)
    sd = max(FACTOR * noise, min(QUIET_FACTOR * noise, QUIET))
    return Threshold(
        sd,
        noise,
        f"{sd / noise:.3g} times the noise floor of {noise:.3g} m/s², "
        "around which windows at rest crowd",
    )


def _noise_floor(counts: NDArray[np.int_]) -> float:
    """Noise around which windows at rest crowd, m/s²; infinite without a window."""
    if not counts.any():
        return np.inf
    middle = (_BINS[:-1] + _BINS[1:]) / 2
    quiet = np.where(middle <= _otsu(counts, middle), counts, 0)
    # Smoothed over a tenth of a decade, so that a short log with few windows has a peak, too.
    mode = middle[np.argmax(np.convolve(quiet, np.ones(5), "same"))]
    crowd = np.where(np.abs(middle - mode) <= np.log10(2), counts, 0)
    floor = 10.0 ** middle[np.searchsorted(np.cumsum(crowd), crowd.sum() / 2)]
    return float(np.sqrt(floor))


def _otsu(counts: NDArray[np.int_], middle: Array) -> float:
    """Value that divides a histogram into two classes with the largest variance between them."""
    below = np.cumsum(counts)[:-1].astype(float)
    above = counts.sum() - below
    moment = np.cumsum(counts * middle)
    # An empty class has no mean, and no weight.
    low = moment[:-1] / np.maximum(below, 1)
    high = (moment[-1] - moment[:-1]) / np.maximum(above, 1)
    between = below * above * (high - low) ** 2
    if not between.max() > 0:
        return float(middle[np.argmax(counts)])
    best = np.flatnonzero(between >= between.max() * (1 - 1e-9))
    return float(middle[best[len(best) // 2]])
