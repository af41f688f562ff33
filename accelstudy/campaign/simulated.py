"""Simulated campaigns: data as they might be measured, with chosen effects and the truth."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import fields, replace
from types import SimpleNamespace
from typing import Any

import numpy as np

from accelstudy.approaches import get_approach
from accelstudy.basics import bounds
from accelstudy.basics.arrays import Array
from accelstudy.basics.errors import InputError, check_name
from accelstudy.basics.registry import WithSettings
from accelstudy.basics.units import MGON
from accelstudy.campaign.session import Campaign
from accelstudy.effects import Effect, get_effect
from accelstudy.noise_effects import get_noise_effect
from accelstudy.schemes import get_scheme
from accelstudy.sensors.models import compose, get_model
from accelstudy.simulation.hold_plan import PROVIDES, HoldPlan
from accelstudy.simulation.sessions import Noise, session

STREAMS = ("sensor", "effects", "order", "noise", "sd")
"""Streams of random numbers, one for each kind of draw, so that none changes another."""

ORDERS = ("scheme", "random")


def simulate_campaign(given: Mapping[str, Any]) -> Campaign:
    """Simulate a campaign, with all that was drawn as its truth.

    Parameters
    ----------
    given : mapping, all keywords of `accelstudy.simulate_campaign`, in SI

    Raises
    ------
    InputError
        If a name or a setting is unknown, or an effect needs a column that is not simulated.
    """
    settings = SimpleNamespace(**given)
    plan = HoldPlan(**{one.name: given[one.name] for one in fields(HoldPlan)})
    seeds = np.random.SeedSequence(settings.seed).spawn(len(STREAMS))
    rng = {name: np.random.default_rng(s) for name, s in zip(STREAMS, seeds, strict=True)}
    hidden = [_hidden_effect(text, settings.size, rng["effects"]) for text in settings.effects]
    names, sensor = {effect.name for effect, _ in hidden}, []
    for effect in get_model(settings.model).effects:
        # Of random sign, with sizes that are log-uniform between the typical sizes.
        n, (low, high) = len(effect.parameters), np.log(effect.typical)
        sizes = np.exp(rng["sensor"].uniform(low, high, n)) * rng["sensor"].choice([-1.0, 1.0], n)
        if effect.name not in names:
            sensor.append((effect, sizes))
    present = [*sensor, *hidden]
    model = compose("simulated", tuple(effect.spec for effect, _ in present))
    noise_effects = [get_noise_effect(spec) for spec in settings.noise_effects]

    directions = _directions(settings, rng["order"])
    hold = plan.hold(len(directions))
    for effect, _ in present:
        if column := plan.missing(effect):
            raise InputError(
                f"{PROVIDES[column]}: missing; the effect {effect.name!r} needs the {column} of "
                "each hold"
            )
    noise = Noise(settings.sigma, settings.robot_sigma, effects=settings.noise_effects)
    parameters = np.concatenate([values for _, values in present])
    ideal = session(model, parameters, directions, settings.gravity, hold)
    drawn = ideal.draw(noise, 1, rng["noise"])
    robot = get_approach(settings.approach).uses_angles
    columns: dict[str, Any] = {}
    if settings.n_samples is not None:
        n = settings.n_samples
        # σ√n, with the scatter of the sd of normal samples.
        within = np.prod([effect.within_hold for effect in noise_effects], axis=0)
        scatter = np.sqrt(rng["sd"].chisquare(n - 1, (len(directions), 3)) / (n - 1))
        sd = settings.sigma * np.sqrt(n) * within * scatter
        columns = {"n_samples": np.full(len(directions), n), "sd": sd}
    if robot and drawn.angles is not None:
        columns |= {"angles": drawn.angles[0], "yaw": hold.yaw if settings.yaw != "none" else None}
    campaign = Campaign.of(
        {
            "name": settings.name,
            "gravity": {"value_mps2": settings.gravity},
            "sensor_noise": {"sigma_mps2": settings.sigma} if settings.sigma_known else None,
            "robot": {"angle_sigma_mgon": settings.robot_sigma / MGON} if robot else None,
        },
        forces=drawn.forces[0],
        time=hold.time,
        temperature=hold.temperature,
        vibration=hold.vibration,
        **columns,
    )
    return replace(
        campaign,
        truth={
            "schema_version": 1,
            "campaign": settings.name,
            "seed": settings.seed,
            "sensor": [_with_parameters(*pair) for pair in sensor],
            "effects": [_with_parameters(*pair) for pair in hidden],
            "noise": {
                "sigma_mps2": settings.sigma,
                "effects": [_name_and_settings(effect) for effect in noise_effects],
            },
            "settings": {
                key: list(value) if isinstance(value, tuple) else value
                for key, value in given.items()
            },
        },
    )


def _hidden_effect(text: str, size: float, rng: np.random.Generator) -> tuple[Effect, Array]:
    """Read an effect beyond the model, with its parameters if they are given."""
    spec, colon, numbers = text.partition(":")
    effect = get_effect(spec.strip())
    n = len(effect.parameters)
    values = size * effect.typical[1] * rng.choice([-1.0, 1.0], n)
    if colon:
        try:
            values = np.array([float(part) for part in numbers.split(",")])
        except ValueError:
            values = np.array([np.nan])
        if len(values) != n or not np.isfinite(values).all():
            names = ", ".join(f"{p.name} in {p.unit}" for p in effect.parameters)
            raise InputError(f"effect {text!r}: expected {n} numbers after the colon ({names})")
    return effect, values


def _directions(settings: SimpleNamespace, rng: np.random.Generator) -> Array:
    """Directions of the holds in their order, (n, 3)."""
    once, first = get_scheme(settings.scheme).directions, settings.repeat_first
    bounds.POSITIONS.check_key("repeats: number of positions", settings.repeats * len(once) + first)
    directions = np.tile(once, (settings.repeats, 1))
    check_name("order", settings.order, ORDERS)
    if settings.order == "random":
        directions = rng.permutation(directions)
    if first > len(directions):
        raise InputError(
            f"repeat_first: must be at most {len(directions)}, the holds of {settings.scheme}, "
            f"not {first}"
        )
    return np.concatenate([directions, directions[:first]])


def _with_parameters(effect: Effect, values: Array) -> dict[str, Any]:
    """Name, settings and parameters of an effect."""
    pairs = zip(effect.parameters, values.tolist(), strict=True)
    parameters = [{"name": p.name, "value": value, "unit": p.unit} for p, value in pairs]
    return {**_name_and_settings(effect), "parameters": parameters}


def _name_and_settings(item: WithSettings) -> dict[str, Any]:
    """Name and settings, each setting with its unit."""
    units = {setting.name: setting.unit for setting in item.takes}
    settings = {
        name: {"value": float(value), "unit": units[name]}
        for name, value in item.settings.items()
        if not math.isnan(value)
    }
    return {"name": item.name, "settings": settings}
