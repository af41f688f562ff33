"""Static holds in a log: where a sliding window varies no more than the noise of the sensor.

The detector is that of Tedaldi, Pretto and Menegatti (ICRA 2014): it compares the norm of the
variances of the three axes in a window with a threshold, which comes from the data. The log is read
twice, first for the threshold, then for the holds, and only a chunk of it is in memory at a time.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from accelstudy.basics.errors import InputError
from accelstudy.basics.progress import stage
from accelstudy.basics.wording import counted
from accelstudy.campaign.holds.allan import AllanDeviation, AllanSums
from accelstudy.campaign.holds.runs import runs_at_rest
from accelstudy.campaign.holds.segments import Segment
from accelstudy.campaign.holds.selection import Selection
from accelstudy.campaign.holds.slopes import slope_sigmas
from accelstudy.campaign.holds.sphere import fit_sphere
from accelstudy.campaign.holds.stillness import moves, never_still, wanders
from accelstudy.campaign.holds.threshold import (
    Survey,
    Threshold,
    choose_threshold,
    given_threshold,
    survey_log,
)
from accelstudy.campaign.holds.windows import samples_in
from accelstudy.campaign.logs.columns import AXES
from accelstudy.campaign.logs.recording import Recording
from accelstudy.leveling.angles import usual_norm

Array = NDArray[np.float64]

_ALIKE = 1.5  # largest over smallest norm of the means of one sensor in gravity
_SPREAD = 0.25  # rms of the means along their thinnest direction, over gravity; of a sphere 0.58


@dataclass(frozen=True)
class DetectedHolds:
    """Static holds of a log, n of them, in order of time.

    Attributes
    ----------
    number : (n,) int array, numbers that figures and options use
    start, end : (n,) int arrays, first sample, and the one after the last
    t0, t1 : (n,) arrays, s, times of the first and of the last sample since the first of the log
    n_samples : (n,) int array
    mean, sd : (n, 3) arrays, m/s²
    slope, sd_slope : (n, 3) arrays, m/s²/s, of the samples, and its standard deviation
    conditions : mapping of "temperature" and "vibration" to (n,) arrays, °C (mean) and m/s² (rms);
        NaN where nothing is known
    left_out : mapping of int to str, numbers of holds that are left out, with the reason
    threshold : Threshold
    window : int, samples in a window
    step : float, s, usual time between samples
    span : (float, float), s, first and last time in the log
    total : int, samples in the log that a window is centred at
    allan : AllanDeviation, of all holds together; channels: along the mean specific force of a
        hold, and twice across
    noise : (3,) array, m/s², root mean square sd of the samples within holds in these channels
    center : (3,) array, m/s², zero point of the specific forces; zero if the holds determine none
    directed : bool, whether the means are close enough to forces for "along" to have a meaning
    warnings : tuple of str
    """

    number: NDArray[np.int_]
    start: NDArray[np.int_]
    end: NDArray[np.int_]
    t0: Array
    t1: Array
    n_samples: NDArray[np.int_]
    mean: Array
    sd: Array
    slope: Array
    sd_slope: Array
    conditions: Mapping[str, Array]
    left_out: Mapping[int, str]
    threshold: Threshold
    window: int
    step: float
    span: tuple[float, float]
    total: int
    allan: AllanDeviation
    noise: Array
    center: Array
    directed: bool
    warnings: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.start)

    @property
    def used(self) -> NDArray[np.bool_]:
        """Which holds are not left out."""
        return ~np.isin(self.number, list(self.left_out))

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


def find_holds(log: Recording, **options: Any) -> DetectedHolds:
    """Find the static holds of one log; see `find_joint_holds`."""
    return find_joint_holds([log], **options)[0]


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
    step = logs[0].step
    cut, least = round(trim / step), max(2, round(shortest / step))
    groups: list[tuple[int, list[Segment | None]]] = []
    saturated, wandering, short = [0] * len(logs), [0] * len(logs), 0
    with stage("holds", surveys[0].total) as advance:
        for group in runs_at_rest(
            logs,
            width,
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
                wanders_off = not full and wanders(segment, chosen[i])
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
        found = {n: part for n, (_, parts) in numbers.items() if (part := parts[i]) is not None}
        if not found:
            if wandering[i]:
                why = "it turns slowly in all that looks like a hold"
                raise never_still(log, surveys[i], window, why)
            raise InputError(
                f"{log.path}: no static hold of {shortest:g} s or more "
                f"({counted(short, 'shorter one')}; a window is at rest up to "
                f"{chosen[i].sd:.3g} m/s²)" + "".join(f"; {warning}" for warning in warnings)
            )
        segments = selection.join(found, chosen[i].sd)
        holds = _holds(
            segments, selection.left_out(segments), log, chosen[i], surveys[i], width, warnings
        )
        radius = usual_norm(holds.mean - holds.center)
        spread = float(np.sqrt(np.mean(holds.noise**2)))
        if threshold is None and moves(chosen[i], holds.allan, spread, step, radius):
            why = (
                f"what looks like rest varies by {chosen[i].floor:.3g} m/s², slowly like a hand, "
                "not like the noise of a sensor"
            )
            raise never_still(log, surveys[i], window, why)
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


def _holds(
    segments: Mapping[int, Segment],
    left_out: Mapping[int, str],
    log: Recording,
    threshold: Threshold,
    survey: Survey,
    width: int,
    warnings: Sequence[str],
) -> DetectedHolds:
    """Collect the segments of a sensor."""
    used = [segment for number, segment in segments.items() if number not in left_out]
    if not used:
        raise InputError(f"{log.path}: exclude: no hold is left")
    center, directed = _center(np.array([segment.mean for segment in used]))
    sums, spreads = AllanSums(), []
    for segment in used:
        frame = _frame(segment.mean - center)
        for record in segment.noise:
            sums.add(record, frame)
        spreads.append(np.diag(frame.T @ segment.covariance @ frame))
    every = list(segments.values())
    return DetectedHolds(
        number=np.array(list(segments)),
        start=np.array([hold.start for hold in every]),
        end=np.array([hold.end for hold in every]),
        t0=np.array([hold.t0 for hold in every]),
        t1=np.array([hold.t1 for hold in every]),
        n_samples=np.array([hold.n for hold in every]),
        mean=np.array([hold.mean for hold in every]),
        sd=np.sqrt([np.diag(hold.covariance) for hold in every]),
        slope=np.array([hold.slope for hold in every]),
        sd_slope=slope_sigmas(every, log.step),
        conditions=_conditions(every, log.conditions),
        left_out=left_out,
        threshold=threshold,
        window=width,
        step=log.step,
        span=survey.span,
        total=survey.total,
        allan=sums.deviation(log.step),
        noise=np.sqrt(np.mean(spreads, axis=0)),
        center=center,
        directed=directed,
        warnings=tuple(warnings),
    )


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
