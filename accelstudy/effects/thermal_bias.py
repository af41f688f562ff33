"""Thermal bias: the zero offset depends on temperature."""

import numpy as np

from accelstudy.basics.registry import Setting
from accelstudy.effects.base import Effect, per_axis, register
from accelstudy.effects.hold_conditions import REFERENCE_TEMPERATURE

LAGS = (0.04, 0.1, 0.25)
"""Time constants of a lag that are tried, as parts of the session."""


@register
class ThermalBias(Effect):
    """Bias temperature sensitivity b_T (T − T0), T0 = 20 °C (IEEE Std 1293).

    The sensor may follow the thermometer with a first-order lag. Then T_τ replaces T, with
    τ dT_τ/dt = T − T_τ, and T_τ = T when the session begins. By default τ is 0: no lag.
    """

    name = "thermal_bias"
    family = "temperature"
    parameters = per_axis("b_T", "m/s^2/K", "b_{T%}")
    takes = (Setting("tau", "s", 0.0, above=0, smooth=True, none=0.0),)
    typical = (0.5e-3, 7e-3)

    @property
    def equation(self):
        """Formula of the effect; it names the lag if there is one."""
        lag = "b_T,i (T_τ − T0), T_τ behind T by the lag τ"
        return lag if self.settings["tau"] else "b_T,i (T − T0)"

    def output(self, f, p, g, hold, xp):
        """Return b_T (T_τ − T0)."""
        warmer = hold.lagged(self.settings["tau"]) - REFERENCE_TEMPERATURE
        return tuple(b * warmer for b in p)

    def candidates(self, hold, f, g):
        """Return no lag and, where the time is known, some up to a third of the session."""
        session = 0.0 if hold.time is None else float(np.ptp(hold.time))
        lags = [float(f"{session * part:.3g}") for part in LAGS if session > 0]
        return (ThermalBias(), *(ThermalBias(tau=tau) for tau in lags))
