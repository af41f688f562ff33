"""Whether a sensor was still at all, or only moved quietly for a moment."""

from __future__ import annotations

import numpy as np

from accelstudy.basics.errors import InputError
from accelstudy.basics.units import STANDARD_GRAVITY
from accelstudy.campaign.holds.allan import RELIABLE, AllanDeviation
from accelstudy.campaign.holds.segments import Segment
from accelstudy.campaign.holds.threshold import Survey, Threshold
from accelstudy.campaign.logs.recording import Recording

WANDERING = 2.0
"""A hold whose standard deviation is more than this many thresholds of a window is none."""
RESTLESS = 0.02
"""Noise of windows, as a share of gravity, from which on it may be motion and not the sensor's."""
SLOW = 2.0
"""Allan deviation, as a multiple of that of white noise, from which on a motion is slow, such as
that of a hand."""
SHORTEST = 0.2
"""Seconds; quicker motions are vibrations, which do not harm a mean."""


def wanders(segment: Segment, threshold: Threshold) -> bool:
    """Whether the force changes over a run of still windows by more than within each of them.

    A sensor that turns slowly is nearly still in each window, yet has no constant attitude.
    """
    return segment.variance > (WANDERING * threshold.sd) ** 2


def moves(
    threshold: Threshold, curve: AllanDeviation, noise: float, step: float, radius: float
) -> bool:
    """Whether the windows "at rest" show motion: large compared with gravity, and slow.

    The noise of a sensor at rest is below a few hundredths of gravity. The vibration of a machine
    may be larger, but it is quick and averages out like white noise. A human body moves slowly.

    Parameters
    ----------
    threshold : Threshold
    curve : AllanDeviation, of all channels in the holds
    noise : float, m/s², standard deviation of the samples within holds
    step : float, s, between samples
    radius : float, m/s², norm of the means
    """
    if not threshold.floor > RESTLESS * min(radius, STANDARD_GRAVITY):
        return False
    known = (curve.differences >= RELIABLE) & (curve.tau >= SHORTEST)
    if not known.any():
        return True
    white = noise * np.sqrt(step / curve.tau[known])
    return bool(np.max(curve.pooled[known] / white) > SLOW)


def never_still(log: Recording, survey: Survey, window: float, why: str) -> InputError:
    """Make the error for a sensor that was never still."""
    return InputError(
        f"{log.path}: the sensor was never still: {why}; the quietest hundredth of its windows "
        f"of {window:g} s varies by {survey.quietest():.3g} m/s². Lay it down for some seconds in "
        "each of ten or more attitudes, on a table or in a fixture"
    )
