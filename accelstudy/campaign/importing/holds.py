"""What the static holds of a log are, and what they have in common: their noise, their zero point.

The detector is that of Tedaldi, Pretto and Menegatti (ICRA 2014): it compares the norm of the
variances of the three axes in a window with a threshold, which comes from the data (`windows`); a
hold is a run of samples whose windows are at rest (`segments`).
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from accelstudy.basics.errors import InputError
from accelstudy.basics.units import STANDARD_GRAVITY
from accelstudy.basics.wording import counted
from accelstudy.campaign.importing.allan import (
    RELIABLE,
    AllanDeviation,
    MeanAccuracy,
    accuracy_of_mean,
    pooled_deviation,
)
from accelstudy.campaign.importing.recording import Samples
from accelstudy.campaign.importing.resolution import rounding_of_mean
from accelstudy.campaign.importing.segments import Envelope, Segment, Segmentation
from accelstudy.campaign.importing.settings import ImportSettings, Span, Which
from accelstudy.campaign.importing.windows import RESTLESS, Threshold, usual_window
from accelstudy.leveling.angles import usual_norm

Array = NDArray[np.float64]

_ALIKE = 1.5  # largest over smallest norm of the means of one sensor in gravity
_SPREAD = 0.25  # rms of the means along their thinnest direction, over gravity; of a sphere 0.58
LONGEST_RECORD = 2**20
"""Samples of a hold that are used for the Allan deviation; later ones count for the mean only."""
SLOW = 2.0
"""Allan deviation, as a multiple of that of white noise, from which on a motion is slow, such as
that of a hand."""
SHORTEST = 0.2
"""Seconds; quicker motions are vibrations, which do not harm a mean."""


@dataclass(frozen=True)
class HoldNoise:
    """Noise of the samples within all holds of a log together, in three channels.

    The first channel is along the mean specific force of a hold, the other two are across it.

    Attributes
    ----------
    allan : AllanDeviation, of the channels
    sd : (3,) array, m/s², root mean square sd of the samples within holds in the channels
    center : (3,) array, m/s², zero point of the specific forces; zero if the holds determine none
    directed : bool, whether the means are close enough to forces for "along" to have a meaning
    of_sensor : slice, channels with the noise of the sensor: those without what moves it, if there
        are any
    accuracy : MeanAccuracy, of the mean over a typical hold in the channels of the sensor
    across : float, m/s², standard deviation of such a mean across gravity
    rounding : float, m/s², what rounding to the steps of the readings leaves in any mean
    count : int, holds
    """

    allan: AllanDeviation
    sd: Array
    center: Array
    directed: bool
    of_sensor: slice
    accuracy: MeanAccuracy
    across: float
    rounding: float
    count: int

    @property
    def sigma(self) -> float:
        """Standard deviation of the mean over a typical hold, m/s²."""
        return float(np.hypot(self.accuracy.allan, self.rounding))

    @property
    def dof(self) -> float:
        """Degrees of freedom of the square of `sigma` (Welch and Satterthwaite).

        Those of the part of rounding are the means of the axes that it comes from.
        """
        allan, rounding = self.accuracy.allan**2, self.rounding**2
        parts = allan**2 / self.accuracy.dof + rounding**2 / (3 * self.count)
        return (allan + rounding) ** 2 / parts if parts > 0 else self.accuracy.dof


@dataclass(frozen=True)
class DetectedHolds:
    """Static holds of a log, n of them, in order of time.

    Attributes
    ----------
    segments : mapping of int to Segment, by the numbers that figures and options use
    left_out : mapping of int to str, numbers of holds that are left out, with the reason
    conditions : mapping of "temperature" and "vibration" to (n,) arrays, °C (mean) and m/s² (rms);
        NaN where nothing is known
    noise : HoldNoise, of the holds that are not left out
    threshold : Threshold
    step : float, s, usual time between samples; 1 where the log does not tell it
    resolution : (3,) array, m/s², steps in which the axes are read; 0 where none is found
    envelope : Envelope, of the log, for its figure
    warnings : tuple of str
    size : int, samples of each block, or of the shortest, if the log consists of blocks
    """

    segments: Mapping[int, Segment]
    left_out: Mapping[int, str]
    conditions: Mapping[str, Array]
    noise: HoldNoise
    threshold: Threshold
    step: float
    resolution: Array
    envelope: Envelope
    warnings: tuple[str, ...]
    size: int | None = None

    def __len__(self) -> int:
        return len(self.segments)

    def without(self, numbers: Collection[int]) -> DetectedHolds:
        """Return the others, as if these had not been found."""
        kept = ~np.isin(self.number, list(numbers))
        return replace(
            self,
            segments={n: part for n, part in self.segments.items() if n not in numbers},
            left_out={n: why for n, why in self.left_out.items() if n not in numbers},
            conditions={name: values[kept] for name, values in self.conditions.items()},
        )

    def of_each(self, attribute: str) -> NDArray[Any]:
        """Attribute of `Segment` for each hold, (n,) or (n, 3)."""
        return np.array([getattr(segment, attribute) for segment in self.segments.values()])

    @property
    def number(self) -> NDArray[np.int_]:
        """Numbers of the holds, (n,)."""
        return np.array(list(self.segments))

    @property
    def used(self) -> NDArray[np.bool_]:
        """Which holds are not left out, (n,)."""
        return ~np.isin(self.number, list(self.left_out))

    @property
    def t0(self) -> Array:
        """Times of the first samples since the first of the log, (n,), s."""
        return self.of_each("t0")

    @property
    def t1(self) -> Array:
        """Times of the last samples, (n,), s."""
        return self.of_each("t1")

    @property
    def n_samples(self) -> NDArray[np.int_]:
        """Numbers of samples, (n,)."""
        return self.of_each("n")

    @property
    def mean(self) -> Array:
        """Mean specific forces, (n, 3), m/s²."""
        return self.of_each("mean")

    @property
    def radius(self) -> float:
        """Usual distance of the means from the zero point of the specific forces, m/s²."""
        return usual_norm(self.mean - self.noise.center)


def detected_holds(
    segmentation: Segmentation,
    settings: ImportSettings,
) -> DetectedHolds:
    """Collect the holds of one sensor, as they were found with these settings.

    Raises
    ------
    InputError
        If nothing is at rest, a person leaves all of it out, or the sensor was never still.
    """
    windows, threshold = segmentation.windows, segmentation.threshold
    log, shortest = windows.log, settings.shortest_s
    window, trim = settings.window_s or usual_window(log), settings.trim_s

    def never_still(why: str) -> InputError:
        if segmentation.size is not None:
            return InputError(
                f"{log.path}: blocks of {segmentation.size} samples are no positions: {why}; is "
                "the number of samples (`block`) right, or does a file hold a move?"
            )
        return InputError(
            f"{log.path}: the sensor was never still: {why}; the quietest hundredth of its windows "
            f"of {window:g} s varies by {windows.quietest():.3g} m/s². Lay it down for some "
            "seconds in each of ten or more attitudes, on a table or in a fixture"
        )

    warnings = []
    if windows.gaps:
        warnings.append(f"{counted(windows.gaps, 'gap')} in time; no hold spans one")
    if windows.frozen.any() and not windows.coarse:
        share = 100 * windows.frozen.sum() / windows.centred.sum()
        warnings.append(
            f"a channel does not change over a window in {share:.2g} % of the log; left out"
        )
    if segmentation.saturated:
        warnings.append(
            f"{counted(segmentation.saturated, 'hold')} left out: the sensor is saturated there"
        )
    if segmentation.wandering:
        warnings.append(
            f"{counted(segmentation.wandering, 'hold')} left out: the force changes there by more "
            "than its noise, since the sensor turns slowly"
        )
    if not segmentation.segments:
        if segmentation.wandering:
            raise never_still("it turns slowly in all that looks like a hold")
        warnings += _too_short(segmentation.short, window, trim, shortest)
        raise InputError(
            f"{log.path}: no static hold of {shortest:g} s or more (a window is at rest up to "
            f"{threshold.sd:.3g} m/s²)" + "".join(f"; {warning}" for warning in warnings)
        )
    warnings += _too_short(segmentation.short, window, trim, shortest)
    segments = _joined(segmentation.segments, settings.joined, threshold.sd, log.samples)
    left_out = {**segmentation.left_out, **_left_out(segments, settings.left_out)}
    used = [segment for number, segment in segments.items() if number not in left_out]
    if not used:
        why = f"exclude: no {'hold' if segmentation.size is None else 'block'} is left"
        raise InputError(f"{log.path}: {why} ({next(iter(left_out.values()))})")
    holds = DetectedHolds(
        segments=segments,
        left_out=left_out,
        conditions=_conditions(list(segments.values()), log.conditions),
        noise=hold_noise(used, log.step, windows.steps),
        threshold=threshold,
        step=log.step,
        resolution=windows.steps,
        envelope=Envelope(windows),
        warnings=tuple(warnings),
        size=segmentation.size,
    )
    if _moves(holds):
        raise never_still(
            f"what looks like rest varies by {threshold.floor:.3g} m/s², slowly like a hand, "
            "not like the noise of a sensor"
        )
    return holds


def _too_short(rests: Sequence[float], window: float, trim: float, shortest: float) -> list[str]:
    """Say which rests, of so many seconds, are no holds, and the option that takes them."""
    if not rests:
        return []
    lost, several = window + 2 * trim, len(rests) > 1
    spans = sorted({f"{min(rests):.1f}", f"{max(rests):.1f}"}, key=float)
    left = (min(rests) - lost) * (1 + 1e-9)
    digit = 10.0 ** np.floor(np.log10(left))
    takes = digit * np.floor(left / digit)
    return [
        f"{counted(len(rests), 'rest')} of {' to '.join(spans)} s {'are' if several else 'is'} no "
        f"hold: it takes {lost + shortest:.3g} s, of which {lost:.3g} s at its ends do not count; "
        f"`shortest` {takes:g} (now {shortest:g}) takes {'them' if several else 'it'}"
    ]


def _joined(
    segments: Mapping[int, Segment], joined: Sequence[Which], alike: float, samples: Samples
) -> dict[int, Segment]:
    """Join holds; they keep the number of the first.

    Parameters
    ----------
    segments : mapping of int to Segment
    joined : sequence of Which
    alike : float, m/s², by which the means of holds in one attitude may differ
    samples : Samples, of the log

    Raises
    ------
    InputError
        If there is no such hold, a span of time has fewer than two, others lie between, or
        their attitudes differ.
    """
    holds = dict(segments)
    for which in joined:
        group = _chosen(holds, which, "join")
        if len(group) < 2:
            raise InputError(f"join: {which}: fewer than two holds lie there")
        between = [n for n in holds if group[0] < n < group[-1] and n not in group]
        if between:
            raise InputError(f"join: {_names(group)}: hold {between[0]} lies between them")
        for number in group[1:]:
            step = float(np.linalg.norm(holds[number].mean - holds[group[0]].mean))
            if step > alike:
                raise InputError(
                    f"join: holds {group[0]} and {number} differ by {step:.2g} m/s²: the "
                    "sensor was turned between them"
                )
            parts = *holds[group[0]].parts, *holds.pop(number).parts
            holds[group[0]] = Segment.of(samples, *parts)
    return holds


def _left_out(
    holds: Mapping[int, Segment], left_out: Sequence[tuple[Which, str]]
) -> dict[int, str]:
    """Holds that are left out, with the reason; one by its number counts before one by its time.

    Raises
    ------
    InputError
        If there is no such hold, or none in a span of time.
    """
    reasons: dict[int, str] = {}
    for which, why in sorted(left_out, key=lambda each: not isinstance(each[0], Span)):
        numbers = _chosen(holds, which, "exclude")
        if not numbers:
            raise InputError(f"exclude: {which}: no hold lies there")
        reasons |= dict.fromkeys(numbers, why)
    return reasons


def _chosen(holds: Mapping[int, Segment], which: Which, key: str) -> list[int]:
    """Numbers of holds: those given, or those that lie in a span of time, if only in part."""
    if isinstance(which, Span):
        return sorted(n for n, h in holds.items() if h.t0 <= which.end and h.t1 >= which.start)
    for number in which:
        if number not in holds:
            raise InputError(f"{key}: there is no hold {number}; they are {_names(list(holds))}")
    return [*which]


def _names(numbers: Sequence[int]) -> str:
    """Numbers in one line, runs of them by their ends."""
    runs: list[list[int]] = []
    for number in sorted(numbers):
        if runs and number == runs[-1][-1] + 1:
            runs[-1].append(number)
        else:
            runs.append([number])
    return ", ".join(f"{r[0]} to {r[-1]}" if len(r) > 2 else ", ".join(map(str, r)) for r in runs)


def hold_noise(segments: Sequence[Segment], step: float, resolution: ArrayLike = 0.0) -> HoldNoise:
    """Sum the samples of each hold in its channels; `resolution` as of `DetectedHolds`."""
    center, directed = _center(np.array([segment.mean for segment in segments]))
    frames = [_frame(segment.mean - center) for segment in segments]
    variances = [
        np.diag(frame.T @ segment.covariance @ frame)
        for segment, frame in zip(segments, frames, strict=True)
    ]
    sd = np.sqrt(np.mean(variances, axis=0))
    records = [
        (record[:LONGEST_RECORD], frame)
        for segment, frame in zip(segments, frames, strict=True)
        for record in segment.records
    ]
    allan = pooled_deviation([r for r, _ in records], step, [f for _, f in records])
    typical = int(np.median([segment.n for segment in segments]))
    of_sensor = slice(0, 1 if directed else 3)
    accuracy, across = (
        accuracy_of_mean(allan.channels(channels), typical * step, sd[channels], typical)
        for channels in (of_sensor, slice(1, 3))
    )
    of_axes = np.sqrt(np.mean([segment.sd**2 for segment in segments], axis=0))
    rounding = float(np.sqrt(np.mean(rounding_of_mean(resolution, of_axes) ** 2)))
    return HoldNoise(
        allan, sd, center, directed, of_sensor, accuracy, across.allan, rounding, len(segments)
    )


def _conditions(segments: Sequence[Segment], names: Sequence[str]) -> dict[str, Array]:
    """Mean temperature and rms vibration of holds."""
    which = {"temperature": 0, "vibration": 1}
    return {
        name: np.array([segment.conditions[which[name], i] for segment in segments])
        for i, name in enumerate(names)
    }


def _center(means: Array) -> tuple[Array, bool]:
    """Point from which all means of holds are equally far, and whether there is one.

    The offset of counts may be unknown; with a large one no mean points along gravity. If the
    attitudes differ enough, the sphere through the means shows it.
    """
    centers = [np.zeros(3)]
    if len(means) > 5 and (sphere := fit_sphere(means)) is not None:
        center, radius = sphere
        thinnest = np.linalg.svd(means - means.mean(axis=0), compute_uv=False)[-1]
        if thinnest > _SPREAD * radius * np.sqrt(len(means)):
            centers.insert(0, center)
    for center in centers:
        norms = np.linalg.norm(means - center, axis=1)
        if norms.max() <= _ALIKE * norms.min():
            return center, True
    return np.zeros(3), False


def _frame(force: Array) -> Array:
    """Orthonormal columns, the first of them along `force`.

    A sensor that settles or is nudged turns a little. That moves the force across its mean, and
    along it in the second order only. So the scatter along the mean is the sensor's own noise.
    """
    size = float(np.linalg.norm(force))
    if size == 0:
        return np.eye(3)
    return np.linalg.svd(force[:, None] / size)[0]


def fit_sphere(forces: Array) -> tuple[Array, float] | None:
    """Centre (3,) and radius of the sphere that fits points (n, 3) best; None if there is none.

    |f − c|² = r² is linear in c and in r² − |c|².
    """
    # Relative to their mean, so that a large offset costs no digits.
    middle = forces.mean(axis=0)
    points = forces - middle
    design = np.column_stack([2 * points, np.ones(len(points))])
    solution, _, rank, _ = np.linalg.lstsq(design, np.sum(points**2, axis=1), rcond=1e-6)
    square = solution[3] + solution[:3] @ solution[:3]
    if rank < 4 or square <= 0:
        return None
    return middle + solution[:3], float(np.sqrt(square))


def _moves(holds: DetectedHolds) -> bool:
    """Whether the windows "at rest" show motion: large compared with gravity, and slow.

    The noise of a sensor at rest is below a few hundredths of gravity. The vibration of a machine
    may be larger, but it is quick and averages out like white noise. A human body moves slowly.
    """
    if not holds.threshold.floor > RESTLESS * min(holds.radius, STANDARD_GRAVITY):
        return False
    curve, sd = holds.noise.allan, float(np.sqrt(np.mean(holds.noise.sd**2)))
    if sd == 0:  # all samples of a coarse sensor are rounded alike
        return False
    reliable = (curve.differences >= RELIABLE) & (curve.tau >= SHORTEST)
    if not reliable.any():
        return True
    white = sd * np.sqrt(holds.step / curve.tau[reliable])
    return bool(np.max(curve.pooled[reliable] / white) > SLOW)
