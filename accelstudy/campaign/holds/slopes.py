"""How well the slope of the samples within a hold is known, when they are not independent."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from accelstudy.campaign.holds.allan import AllanSums, accuracy_of_mean
from accelstudy.campaign.holds.segments import Segment

Array = NDArray[np.float64]

SHARE = 8.0
"""A hold's length over the averaging times that are taken of what a line leaves of it."""


def slope_sigmas(segments: Sequence[Segment], step: float) -> Array:
    """Standard deviations of the slopes of the axes in holds, (n, 3), m/s²/s.

    A slope over T is told by the difference of the two halves. For white noise the least-squares
    slope has σ = √6 σ_A(T/2) / T with the Allan deviation σ_A; for flicker noise and a random walk
    the same is right within some 10 %. σ_A is that of the samples about the line of their own hold,
    so that slopes do not count as noise, over all holds together. The line takes the slowest noise
    with it; so of each hold only averaging times up to an eighth of it are used. What is longer is
    known from the long holds, or carried on: the noise of a sensor is slower in a long hold.

    Parameters
    ----------
    segments : sequence of Segment
    step : float, s, between samples
    """
    sums = AllanSums()
    for segment in segments:
        for record in segment.wobble:
            sums.add(record.up_to(segment.n / SHARE))
    curve = sums.deviation(step)
    variances = np.mean([np.diag(segment.covariance) for segment in segments], axis=0)
    sigma = np.empty((len(segments), 3))
    for i, segment in enumerate(segments):
        for axis in range(3):
            half = accuracy_of_mean(
                curve.channels(slice(axis, axis + 1)),
                segment.n * step / 2,
                float(np.sqrt(variances[axis])),
                max(1, segment.n // 2),
            )
            sigma[i, axis] = np.sqrt(6.0) * half.allan / (segment.n * step)
    return sigma
