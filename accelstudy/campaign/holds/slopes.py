"""How well the slope of the samples within a hold is known if they are not independent."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from accelstudy.campaign.holds.allan import AllanSums, accuracy_of_mean
from accelstudy.campaign.holds.segments import Segment

Array = NDArray[np.float64]

SHARE = 8.0
"""Length of a hold over the longest averaging time that its residuals about a line are used for."""


def slope_sigmas(segments: Sequence[Segment], step: float) -> Array:
    """Standard deviations of the slopes of the axes in holds, (n, 3), m/s²/s.

    The slope over a time T depends on the difference between its two halves. For white noise the
    least-squares slope has σ = √6 σ_A(T/2) / T with the Allan deviation σ_A; for flicker noise and
    a random walk this is right within some 10 %.

    σ_A is that of the residuals about the line of each hold, over all holds together, so that
    slopes do not count as noise. Since the line also absorbs the slowest noise, a hold contributes
    only averaging times up to an eighth of its length. Longer ones come from longer holds, or are
    extrapolated.

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
