"""Static holds in a log: where a sliding window varies no more than the noise of the sensor.

The detector is that of Tedaldi, Pretto and Menegatti (ICRA 2014): it compares the norm of the
variances of the three axes in a window with a threshold, which comes from the data. The log is read
twice, first for the threshold, then for the holds and the envelope that a figure shows, and only a
chunk of it is in memory at a time.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.errors import InputError
from accelstudy.basics.progress import stage
from accelstudy.basics.units import STANDARD_GRAVITY
from accelstudy.basics.wording import counted
from accelstudy.campaign.holds.allan import RELIABLE
from accelstudy.campaign.holds.detected import DetectedHolds, collected
from accelstudy.campaign.holds.segments import Segment, runs_at_rest
from accelstudy.campaign.holds.selection import Selection
from accelstudy.campaign.holds.threshold import (
    Survey,
    Threshold,
    choose_threshold,
    given_threshold,
    survey_log,
)
from accelstudy.campaign.holds.windows import Envelope, samples_in, windows
from accelstudy.campaign.logs.recording import Recording

Array = NDArray[np.float64]

WANDERING = 2.0
"""A hold whose standard deviation is more than this many thresholds of a window is none."""
RESTLESS = 0.02
"""Noise of windows, as a share of gravity, from which on it may be motion and not the sensor's."""
SLOW = 2.0
"""Allan deviation, as a multiple of that of white noise, from which on a motion is slow, such as
that of a hand."""
SHORTEST = 0.2
"""Seconds; quicker motions are vibrations, which do not harm a mean."""


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
