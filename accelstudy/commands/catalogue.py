"""The catalogue of all that a sensor, a rig, noise and data can have, as text for people."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from accelstudy.basics.plugins import source_of
from accelstudy.basics.registry import WithSettings
from accelstudy.basics.units import display_unit, to_display
from accelstudy.campaign.gross_errors import GrossError, get_gross_error, gross_error_names
from accelstudy.effects import Effect, effect_names, get_effect
from accelstudy.noise_effects import NoiseEffect, get_noise_effect, noise_effect_names
from accelstudy.sensors.models import compose
from accelstudy.simulation.hold_plan import PROVIDES

INDENT = "    "


def catalogue() -> str:
    """List effects of the sensor and of the rig, noise effects and gross errors.

    Parameters and typical sizes are in the units shown to people, settings in SI as specs have
    them.
    """
    effects = [get_effect(name) for name in effect_names()]
    lines = ["Effects of the sensor", ""]
    lines += [line for e in effects if e.part == "sensor" for line in _effect(e)]
    lines += ["", "Effects of the rig", ""]
    lines += [line for e in effects if e.part == "rig" for line in _effect(e)]
    lines += ["", "Noise effects", ""]
    lines += [line for n in noise_effect_names() for line in _noise_effect(get_noise_effect(n))]
    lines += ["", "Gross errors", ""]
    lines += [line for n in gross_error_names() for line in _gross_error(get_gross_error(n))]
    return "\n".join(lines)


def _effect(effect: Effect) -> Iterator[str]:
    yield from _head(effect, effect.equation)
    unit = effect.parameters[0].unit
    names = ", ".join(parameter.name for parameter in effect.parameters)
    low, high = map(_number, to_display(effect.typical, unit))
    yield f"{INDENT}{names} [{display_unit(unit)}], typically {low} … {high}"
    yield from _settings(effect)
    columns = compose(effect.spec, (effect.spec,)).hold_columns
    if needed := [column for column in columns if column in PROVIDES]:
        yield f"{INDENT}needs the {' and the '.join(needed)} of each hold"
    if effect.family:
        yield f"{INDENT}family: {effect.family}"


def _noise_effect(effect: NoiseEffect) -> Iterator[str]:
    yield from _head(effect, effect.equation)
    yield from _settings(effect)
    low, high = map(_number, effect.typical)
    first = effect.takes[0]
    yield f"{INDENT}{first.name} typically {low} … {high}{_unit(first.unit)}"


def _gross_error(error: GrossError) -> Iterator[str]:
    yield from _head(error, error.equation)
    yield from _settings(error)


def _head(item: WithSettings, equation: str) -> Iterator[str]:
    yield f"{item.name}: {equation}"
    if item.summary:
        yield f"{INDENT}{item.summary}"
    if source := source_of(item.kind, item.name):
        yield f"{INDENT}of the plug-in {source}"


def _settings(item: WithSettings) -> Iterator[str]:
    settings = [
        f"{setting.name} drawn"
        if math.isnan(value)
        else f"{setting.name}={_number(value)}" + _unit(setting.unit)
        for setting, value in zip(item.takes, item.settings.values(), strict=True)
    ]
    if settings:
        yield f"{INDENT}settings: {', '.join(settings)}"


def _number(value: float) -> str:
    """Three digits, and never an exponent."""
    return np.format_float_positional(value, 3, fractional=False, trim="-")


def _unit(unit: str) -> str:
    return "" if unit == "1" else f" {unit}"
