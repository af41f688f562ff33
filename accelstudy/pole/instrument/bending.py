"""How far the foot of a bent pole lies from the straight line that leveling assumes.

The pole is a beam of constant stiffness with small deflections (Euler and Bernoulli). It stands on
its tip, the hand balances the weight by a force across the pole, and the top is free. Only the
component of the weight across the pole bends it, which grows with the sine of the tilt.
"""

from __future__ import annotations

from accelstudy.basics.units import STANDARD_GRAVITY
from accelstudy.pole.instrument.setup import Setup


def flexibility(setup: Setup, g: float = STANDARD_GRAVITY) -> float:
    """Distance of the foot from the straight line through the top, for a horizontal pole, m.

    With the bending moment M(x) = P (L − x) + w (L − x)²/2 − R (h − x) of the weight P of the top,
    the weight w of a metre and the force R of the hand at h, whose last term counts below the hand
    only, and the direction of the pole measured at s, the distance is

        (∫₀ᴸ M x dx − L ∫ₛᴸ M dx) / (E I),        R = (P L + w L²/2) / h.

    With h = 0 the pole is a cantilever that is clamped at its foot. The sensor follows the slope of
    the pole where it sits. So the computed foot is this much too far away from the side to which
    the top leans; a negative distance means the other side.

    Parameters
    ----------
    setup : Setup
    g : float, m/s²
    """
    length, hand, sensor = setup.length, setup.hand_at, setup.sensor_at
    head, metre = setup.head_mass * g, setup.pole_mass * g
    free = length - sensor
    moment = head * length + metre * length**2 / 2  # at the foot, were it clamped: R h
    first = head * length**3 / 6 + metre * length**4 / 24 - moment * hand**2 / 6
    above = head * free**2 / 2 + metre * free**3 / 6
    if sensor < hand:
        above -= moment / hand * (hand - sensor) ** 2 / 2
    return (first - length * above) / setup.stiffness
