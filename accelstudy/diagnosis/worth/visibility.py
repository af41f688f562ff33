"""What a campaign or a scheme can show of the effects of the catalogue, before any diagnosis."""

from __future__ import annotations

import numpy as np
import pandas as pd

from accelstudy.adjustment.quality import solve
from accelstudy.approaches import Approach
from accelstudy.basics.units import display_unit, to_display
from accelstudy.basics.wording import number
from accelstudy.campaign.calibration.fit import fit_campaign, usual_approach
from accelstudy.campaign.session import Campaign
from accelstudy.diagnosis.space.examined import ExaminedFit, examine
from accelstudy.diagnosis.worth.limits import visibilities
from accelstudy.effects import Effect, get_effect
from accelstudy.schemes import Scheme
from accelstudy.sensors.sensor import SensorModel
from accelstudy.simulation.hold_plan import check_needs_no_plan
from accelstudy.simulation.sessions import Noise, session


def examine_campaign(
    campaign: Campaign, model: SensorModel, approach: Approach | None = None
) -> ExaminedFit:
    """Return what a campaign can show beside a model, with its own noise.

    Parameters
    ----------
    campaign : Campaign
    model : SensorModel
    approach : Approach; by default robot-aided if the campaign has the robot's angles
    """
    fit = fit_campaign(campaign, model, approach or usual_approach(campaign))
    return examine(solve(fit.model, fit.approach, fit.observed, fit.adjustment))


def examine_scheme(
    scheme: Scheme, model: SensorModel, approach: Approach, noise: Noise | None = None
) -> ExaminedFit:
    """Return what a scheme can show beside a model; nothing is known of times and temperatures.

    Raises
    ------
    InputError
        If the positions do not determine the model, or it needs to know more of them.
    """
    check_needs_no_plan(model)
    ideal = session(model, np.zeros(model.n_parameters), scheme.directions)
    observed = ideal.observations(noise or Noise())
    return examine(solve(model, approach, observed))


def visibility_table(examined: ExaminedFit) -> pd.DataFrame:
    """Table for people: one row per effect that is not in the model, in the units shown."""
    rows = []
    for row in visibilities(examined):

        def shown(size: float, unit: str = row.unit, seen: bool = row.status == "visible") -> str:
            return number(float(to_display(size, unit))) if seen else "–"

        worst = _settings(row.hardest)
        rows.append(
            {
                "effect": row.name,
                "part": get_effect(row.name).part,
                "status": row.status,
                "MDB": shown(row.mdb),
                "MIB": shown(row.mib),
                "unit": display_unit(row.unit) if row.status == "visible" else "",
                "with": _settings(row.easiest),
                "worst MDB": f"{shown(row.hardest_mdb)} with {worst}" if worst else "",
                "confused with": row.reason
                or ", ".join(f"{name} {cosine:.2f}" for name, cosine in row.confused),
            }
        )
    return pd.DataFrame(rows)


def _settings(effect: Effect | None) -> str:
    """Settings of an effect as it is written, with their units: ``t=290 s``."""
    if effect is None:
        return ""
    units = {
        setting.name: "" if setting.unit == "1" else f" {setting.unit}" for setting in effect.takes
    }
    return ", ".join(f"{name}={value:.4g}{units[name]}" for name, value in effect.settings.items())
