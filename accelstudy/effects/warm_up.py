"""Warm-up: the bias settles after the sensor was switched on."""

import numpy as np

from accelstudy.basics.registry import Setting
from accelstudy.effects.base import Effect, per_axis, register


@register
class WarmUp(Effect):
    """Warm-up transient w exp(−t/τ); the time constant τ is searched for."""

    name = "warm_up"
    family = "slow change in time"
    parameters = per_axis("w", "m/s^2", "w_%")
    takes = (Setting("tau", "s", 600.0, above=0, smooth=True),)
    equation = "w_i exp(−t/τ)"
    typical = (0.01, 0.05)

    def output(self, f, p, g, hold, xp):
        """Return w exp(−t/τ)."""
        decay = xp.exp(-hold.time / self.settings["tau"])
        return tuple(w * decay for w in p)

    def candidates(self, hold, f, g):
        """Return time constants from a twentieth of the session to the whole of it.

        A longer one can hardly be told from a linear drift.
        """
        time = hold.column("time")
        session = max(float(np.ptp(time)), 1.0)
        return tuple(
            WarmUp(tau=float(f"{session * part:.3g}")) for part in np.geomspace(0.05, 1, 7)
        )
