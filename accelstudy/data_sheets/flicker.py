"""The change of a bias with time by flicker noise, whose size is the bias instability."""

from __future__ import annotations

import math

FLICKER = math.sqrt(2 * math.log(2) / math.pi)
"""Floor of the Allan deviation in parts of the bias instability B, 0.664 (IEEE Std 952)."""


def flicker_change(instability: float, white: float, seconds: float) -> float:
    """Standard deviation of the change of a bias by flicker noise, m/s².

    Consider two means over τ; the second begins m τ after the first. By noise of the two-sided
    density B²/(2πf) their difference has the variance B²/π ((m + 1)² ln(m + 1) +
    (m − 1)² ln(m − 1) − 2 m² ln m). For neighbouring means this is twice the Allan variance
    2 ln 2 B²/π; far apart it is about B²/π (2 ln m + 3), which grows slowly without a limit. τ is
    the time from which on flicker noise exceeds white noise, since shorter means do not show it.

    Parameters
    ----------
    instability : float, B, m/s²
    white : float, N of the white noise, m/s²/√Hz
    seconds : float, s, between the two means; 0 for no change
    """
    if seconds <= 0 or instability == 0:
        return 0.0
    means = max(1.0, seconds * (FLICKER * instability / white) ** 2) if white > 0 else 1.0
    # Logarithms of m ± 1 relative to that of m, so that large terms do not cancel.
    growth = 2 * math.log(means) + (means + 1) ** 2 * math.log1p(1 / means)
    if means > 1:
        growth += (means - 1) ** 2 * math.log1p(-1 / means)
    return instability * math.sqrt(growth / math.pi)
