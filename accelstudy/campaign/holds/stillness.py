"""Whether a sensor was still at all: what tells a hold from a quiet moment of a motion."""

from __future__ import annotations

import numpy as np

from accelstudy.basics.errors import InputError
from accelstudy.basics.units import STANDARD_GRAVITY
from accelstudy.campaign.holds.allan import RELIABLE, AllanDeviation
from accelstudy.campaign.holds.segments import Segment
from accelstudy.campaign.holds.threshold import Survey, Threshold
from accelstudy.campaign.logs.recording import Recording

WANDERING = 2.0
"""Standard deviation over a whole hold, over the threshold of its windows, that no hold has."""
RESTLESS = 0.02
"""Noise of windows over gravity from which on it is doubtful whether it is the sensor's."""
SLOW = 2.0
"""Allan deviation over that of white noise from which on a motion is slow, as that of a hand."""
SHORTEST = 0.2
"""Seconds; motions that are quicker are vibrations, of which a mean is none the worse."""


def wanders(segment: Segment, threshold: Threshold) -> bool:
    """Whether the force changes within a run of still windows by more than any of them tells.

    A sensor that turns slowly is nearly still in each window, and yet has no attitude.
    """
    return segment.variance > (WANDERING * threshold.sd) ** 2


def moves(
    threshold: Threshold, curve: AllanDeviation, noise: float, step: float, radius: float
) -> bool:
    """Whether what the windows "at rest" show is motion: large beside gravity, and slow.

    The noise of a sensor at rest is below a few hundredths of gravity; a machine's vibration may be
    more, but is quick, so that means are as good as those of white noise. What a body does is slow.

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
    """Error that says that a sensor was never still."""
    return InputError(
        f"{log.path}: the sensor was never still: {why}; the quietest hundredth of its windows "
        f"of {window:g} s varies by {survey.quietest():.3g} m/s². Lay it down for some seconds in "
        "each of ten or more attitudes, on a table or in a fixture"
    )
