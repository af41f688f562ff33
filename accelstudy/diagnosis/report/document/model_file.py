"""The sensor that a diagnosis found, as a configuration of the Monte Carlo study: `model.yaml`."""

from __future__ import annotations

import re
from typing import Any

import numpy as np

from accelstudy.basics.names import LONGEST
from accelstudy.basics.units import MGON
from accelstudy.campaign.session import Campaign
from accelstudy.diagnosis.result import Diagnosis
from accelstudy.sensors.models import MODELS, composition_name
from accelstudy.sensors.sensor import SensorModel

REPLICATES = 1000


def study_overlay(diagnosis: Diagnosis) -> dict[str, Any]:
    """Return a configuration that overlays `config/config.yaml`.

    The simulated sensor has the effects that were found, with the estimates as true values, and the
    noise that was found. It is calibrated with the base model and with the extended one, in as many
    evenly spread positions as the campaign has.
    """
    d = diagnosis
    solution = d.final.frame.solution
    extended = d.extended
    effects = [effect.spec for effect in extended.effects]
    models = [composition_name(d.model.effects)]
    own: dict[str, list[str]] = {}
    if extended is not d.model:
        # The one model of the file's own is the one that the file stands for.
        added = [e.name for e in extended.effects[len(d.model.effects) :]]
        name = "-".join([study_name(models[0]), *added])
        own = {"extended" if name in MODELS or len(name) > LONGEST else name: list(effects)}
    noise: dict[str, Any] = {
        "sensor": {"sigma_mps2": d.sigma_position, "per": "position"},
        "gravity": {"sigma_mps2": d.campaign.sigma_gravity, "error_mps2": 0.0},
    }
    if d.campaign.sigma_angle is not None:
        noise["robot"] = {"sigma_mgon": d.campaign.sigma_angle / MGON}
    content = {
        "study": study_name(d.campaign.name),
        "gravity_mps2": solution.gravity,
        "noise": noise,
        "simulated_effects": effects,
        "sensor": _truth(extended, solution.parameters.tolist()),
        "models": own,
        "grids": [
            {
                "models": [*models, *own],
                "schemes": [f"fibonacci-{d.campaign.n_positions}"],
                "approaches": [d.approach.name],
                "replicates": REPLICATES,
            }
        ],
        "presets": None,
        "sensitivity": None,
        "paper": False,
    }
    holds = study_holds(d.campaign, extended)
    return {**content, "holds": holds} if holds else content


def study_holds(campaign: Campaign, model: SensorModel) -> dict[str, Any]:
    """Conditions of the holds on which the effects of a model depend, in the ranges of a campaign.

    A course of the temperature that correlates with the order of the holds is taken as linear, any
    other as random.
    """
    needed, holds = model.hold_columns, dict[str, Any]()
    if {"time", "order"} & {*needed} and campaign.time is not None:
        holds["interval_s"] = float(np.ptp(campaign.time) / (campaign.n_positions - 1))
    if "temperature" in needed and campaign.temperature is not None:
        t = campaign.temperature
        trend = np.corrcoef(np.arange(len(t)), t)[0, 1] if np.ptp(t) > 0 else 0.0
        low, high = float(t.min()), float(t.max())
        holds["temperature_degC"] = [high, low] if trend < -0.5 else [low, high]
        holds["temperature_order"] = "linear" if abs(trend) > 0.5 else "random"
    if "vibration" in needed and campaign.vibration is not None:
        holds["vibration_mps2"] = [float(campaign.vibration.min()), float(campaign.vibration.max())]
    if "yaw" in needed and campaign.yaw is not None:
        holds["yaw"] = "random" if np.ptp(campaign.yaw) > 0 else "none"
    return holds


def study_name(name: str) -> str:
    """Return the name of a campaign as the name of a study: letters, digits, _ and - only."""
    return re.sub(r"[^A-Za-z0-9_-]+", "-", name)[:LONGEST].strip("-_") or "campaign"


def _truth(model: SensorModel, parameters: list[float]) -> dict[str, dict[str, Any]]:
    """Estimates as true values, by effect, SI."""
    values = dict(zip(model.parameter_names, parameters, strict=False))  # gravity may follow
    return {
        effect.spec: {
            "value": [values[p.name] for p in effect.parameters],
            "unit": effect.parameters[0].unit,
        }
        for effect in model.effects
    }
