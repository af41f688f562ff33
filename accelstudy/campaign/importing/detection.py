"""Static holds in a log: where a sliding window varies no more than the noise of the sensor.

The detector is that of Tedaldi, Pretto and Menegatti (ICRA 2014): it compares the norm of the
variances of the three axes in a window with a threshold, which comes from the data. The log is read
twice, first for the threshold, then for the holds and the envelope that a figure shows, and only a
chunk of it is in memory at a time.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.errors import InputError
from accelstudy.basics.progress import stage
from accelstudy.basics.units import STANDARD_GRAVITY
from accelstudy.basics.wording import counted
from accelstudy.campaign.importing.allan import (
    RELIABLE,
    AllanDeviation,
    AllanSums,
    slope_sigmas,
)
from accelstudy.campaign.importing.recording import Recording
from accelstudy.campaign.importing.segments import Segment, Selection, runs_at_rest
from accelstudy.campaign.importing.windows import (
    Envelope,
    Survey,
    Threshold,
    choose_threshold,
    given_threshold,
    samples_in,
    survey_log,
    windows,
)
from accelstudy.leveling.angles import usual_norm

Array = NDArray[np.float64]

_ALIKE = 1.5  # largest over smallest norm of the means of one sensor in gravity
_SPREAD = 0.25  # rms of the means along their thinnest direction, over gravity; of a sphere 0.58
WANDERING = 2.0
"""A hold whose standard deviation is more than this many thresholds of a window is none."""
RESTLESS = 0.02
"""Noise of windows, as a share of gravity, from which on it may be motion and not the sensor's."""
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
    """

    allan: AllanDeviation
    sd: Array
    center: Array
    directed: bool

    @property
    def of_sensor(self) -> slice:
        """Channels with the noise of the sensor: those without what moves it, if there are any."""
        return slice(0, 1) if self.directed else slice(0, 3)


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
    step : float, s, usual time between samples
    envelope : Envelope, of the log, for its figure
    warnings : tuple of str
    """

    segments: Mapping[int, Segment]
    left_out: Mapping[int, str]
    conditions: Mapping[str, Array]
    noise: HoldNoise
    threshold: Threshold
    step: float
    envelope: Envelope
    warnings: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.segments)

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

    def slope_sigmas(self) -> Array:
        """Standard deviations of the slopes of the samples, (n, 3), m/s²/s."""
        return slope_sigmas(list(self.segments.values()), self.step)


def find_joint_holds(
    logs: Sequence[Recording],
    *,
    window: float = 1.0,
    threshold: float | None = None,
    trim: float = 0.2,
    shortest: float = 1.0,
    full_range: float = np.inf,
    selection: Selection | None = None,
    one_each: bool = False,
) -> list[DetectedHolds]:
    """Find the static holds of sensors that were turned together.

    The sensors are on one body. So a hold is where all of them rest, and has the same number for
    all.

    Parameters
    ----------
    logs : sequence of Recording, one for each sensor, of simultaneous samples
    window : float, s, length of the sliding window; a hold begins and ends half a window inside
        the samples at rest
    threshold : float, m/s², standard deviation of a window up to which it is at rest; chosen from
        the data of each sensor if omitted
    trim : float, s, cut off in addition at both ends of a hold
    shortest : float, s, least length of what is left
    full_range : float, m/s², the sensors measure ± this
    selection : Selection, holds that a person leaves out or joins
    one_each : bool, whether the logs have several recordings with one position each: the longest
        hold, which gets the number of the recording

    Returns
    -------
    list of DetectedHolds
        For each sensor; a hold in which one sensor is saturated is missing for that one only.

    Raises
    ------
    InputError
        If a log cannot be read, is shorter than a window, nothing in it is at rest, or the sensor
        was never still.
    """
    selection = selection or Selection()
    width = samples_in(logs[0], window)
    surveys = [survey_log(log, width) for log in logs]
    chosen = [
        given_threshold(threshold) if threshold is not None else choose_threshold(survey, log)
        for survey, log in zip(surveys, logs, strict=True)
    ]
    envelopes = [Envelope(survey.span, survey.total) for survey in surveys]
    step = logs[0].step
    cut, least = round(trim / step), max(2, round(shortest / step))
    groups: list[tuple[int, list[Segment | None]]] = []
    saturated, wandering, short = [0] * len(logs), [0] * len(logs), 0
    with stage("holds", surveys[0].total) as advance:
        for group in runs_at_rest(
            [
                envelope.along(windows(log, width))
                for envelope, log in zip(envelopes, logs, strict=True)
            ],
            [each.sd**2 for each in chosen],
            cut,
            [survey.extremes for survey in surveys],
            full_range,
            advance,
        ):
            if group[0].n < least:
                short += 1
                continue
            kept: list[Segment | None] = []
            for i, hold in enumerate(group):
                full, segment = hold.saturated(), hold.finish()
                wanders_off = not full and _wanders(segment, chosen[i])
                saturated[i] += full
                wandering[i] += wanders_off
                kept.append(None if full or wanders_off else segment)
            if any(kept):
                groups.append((group[0].recording, kept))
    numbers = _numbers(groups, one_each)
    result = []
    for i, log in enumerate(logs):
        warnings = [*surveys[i].warnings()]
        if saturated[i]:
            warnings.append(
                f"{counted(saturated[i], 'hold')} left out: the sensor is saturated there"
            )
        if wandering[i]:
            warnings.append(
                f"{counted(wandering[i], 'hold')} left out: the force changes there by more than "
                "its noise, since the sensor turns slowly"
            )
        parts = {n: part for n, (_, group) in numbers.items() if (part := group[i]) is not None}
        if not parts:
            if wandering[i]:
                why = "it turns slowly in all that looks like a hold"
                raise _never_still(log, surveys[i], window, why)
            raise InputError(
                f"{log.path}: no static hold of {shortest:g} s or more "
                f"({counted(short, 'shorter one')}; a window is at rest up to "
                f"{chosen[i].sd:.3g} m/s²)" + "".join(f"; {warning}" for warning in warnings)
            )
        segments = selection.join(parts, chosen[i].sd)
        left_out = selection.left_out(segments)
        holds = collected(segments, left_out, log, chosen[i], envelopes[i], warnings)
        if threshold is None and _moves(holds):
            why = (
                f"what looks like rest varies by {chosen[i].floor:.3g} m/s², slowly like a hand, "
                "not like the noise of a sensor"
            )
            raise _never_still(log, surveys[i], window, why)
        result.append(holds)
    return result


def _numbers(
    groups: Sequence[tuple[int, list[Segment | None]]], one_each: bool
) -> dict[int, tuple[int, list[Segment | None]]]:
    """Number the holds: in order, or the longest of each recording by the recording's number."""
    if not one_each:
        return dict(enumerate(groups, 1))
    longest: dict[int, tuple[int, list[Segment | None]]] = {}
    for group in sorted(groups, key=lambda group: max(part.n for part in group[1] if part)):
        longest[group[0] + 1] = group
    return dict(sorted(longest.items()))


def _wanders(segment: Segment, threshold: Threshold) -> bool:
    """Whether the force changes over a run of still windows by more than within each of them.

    A sensor that turns slowly is nearly still in each window, yet has no constant attitude.
    """
    return segment.variance > (WANDERING * threshold.sd) ** 2


def _moves(holds: DetectedHolds) -> bool:
    """Whether the windows "at rest" show motion: large compared with gravity, and slow.

    The noise of a sensor at rest is below a few hundredths of gravity. The vibration of a machine
    may be larger, but it is quick and averages out like white noise. A human body moves slowly.
    """
    if not holds.threshold.floor > RESTLESS * min(holds.radius, STANDARD_GRAVITY):
        return False
    curve, sd = holds.noise.allan, float(np.sqrt(np.mean(holds.noise.sd**2)))
    reliable = (curve.differences >= RELIABLE) & (curve.tau >= SHORTEST)
    if not reliable.any():
        return True
    white = sd * np.sqrt(holds.step / curve.tau[reliable])
    return bool(np.max(curve.pooled[reliable] / white) > SLOW)


def _never_still(log: Recording, survey: Survey, window: float, why: str) -> InputError:
    """Make the error for a sensor that was never still."""
    return InputError(
        f"{log.path}: the sensor was never still: {why}; the quietest hundredth of its windows "
        f"of {window:g} s varies by {survey.quietest():.3g} m/s². Lay it down for some seconds in "
        "each of ten or more attitudes, on a table or in a fixture"
    )


def collected(
    segments: Mapping[int, Segment],
    left_out: Mapping[int, str],
    log: Recording,
    threshold: Threshold,
    envelope: Envelope,
    warnings: Sequence[str],
) -> DetectedHolds:
    """Collect the segments of a sensor.

    Raises
    ------
    InputError
        If all holds are left out.
    """
    used = [segment for number, segment in segments.items() if number not in left_out]
    if not used:
        raise InputError(f"{log.path}: exclude: no hold is left")
    return DetectedHolds(
        segments=segments,
        left_out=left_out,
        conditions=_conditions(list(segments.values()), log.conditions),
        noise=_noise(used, log.step),
        threshold=threshold,
        step=log.step,
        envelope=envelope,
        warnings=tuple(warnings),
    )


def _noise(segments: Sequence[Segment], step: float) -> HoldNoise:
    """Turn the samples of each hold to its channels, and add them up."""
    center, directed = _center(np.array([segment.mean for segment in segments]))
    sums, variances = AllanSums(), []
    for segment in segments:
        frame = _frame(segment.mean - center)
        for record in segment.noise:
            sums.add(record, frame)
        variances.append(np.diag(frame.T @ segment.covariance @ frame))
    sd = np.sqrt(np.mean(variances, axis=0))
    return HoldNoise(sums.deviation(step), sd, center, directed)


def _conditions(segments: Sequence[Segment], names: Sequence[str]) -> dict[str, Array]:
    """Mean temperature and rms vibration of holds."""
    count, total, squares = np.array([s.conditions for s in segments]).transpose(1, 0, 2)
    with np.errstate(invalid="ignore", divide="ignore"):
        values = {"temperature": total / count, "vibration": np.sqrt(squares / count)}
    return {name: values[name][:, i] for i, name in enumerate(names)}


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
