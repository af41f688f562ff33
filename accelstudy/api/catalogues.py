"""The catalogues of effects, models, schemes and so on, as tables."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pandas as pd

from accelstudy.approaches import approach_names
from accelstudy.basics.errors import UnknownNameError
from accelstudy.basics.plugins import source_of
from accelstudy.basics.registry import WithSettings
from accelstudy.campaign.gross_errors import get_gross_error, gross_error_names
from accelstudy.data_sheets.reading import data_sheet_names, get_data_sheet
from accelstudy.data_sheets.sheet import QUANTITIES
from accelstudy.effects import Effect, effect_names, get_effect
from accelstudy.noise_effects import NoiseEffect, get_noise_effect, noise_effect_names
from accelstudy.schemes import get_scheme, scheme_names
from accelstudy.sensors.models import MODELS, compose, get_model
from accelstudy.simulation.hold_plan import PROVIDES

Row = dict[str, object]


def catalogue(kind: str) -> pd.DataFrame:
    """Return all of a kind as a table, by name; numbers are in SI.

    Parameters
    ----------
    kind : str
        "effects", "noise effects", "gross errors", "models", "schemes", "approaches" or
        "data sheets".
    """
    if kind not in KINDS:
        raise UnknownNameError("catalogue", kind, KINDS)
    return pd.DataFrame([*KINDS[kind]()]).set_index("name")


def _effect(effect: Effect) -> Row:
    columns = compose(effect.spec, (effect.spec,)).hold_columns
    return {
        **_item(effect, effect.equation),
        "part": effect.part,
        "family": effect.family,
        "parameters": ", ".join(parameter.name for parameter in effect.parameters),
        "unit": effect.parameters[0].unit,
        "typical_low": effect.typical[0],
        "typical_high": effect.typical[1],
        "needs": " and the ".join(column for column in columns if column in PROVIDES),
    }


def _noise_effect(effect: NoiseEffect) -> Row:
    setting = effect.takes[0]
    return {
        **_item(effect, effect.equation),
        "setting": setting.name,
        "unit": setting.unit,
        "typical_low": effect.typical[0],
        "typical_high": effect.typical[1],
    }


def _item(item: WithSettings, equation: str) -> Row:
    """Columns of what has settings: its formula, and the settings as specs have them."""
    settings = [
        f"{one.name} drawn"
        if math.isnan(value)
        else f"{one.name}={plain_number(value)}{'' if one.unit == '1' else f' {one.unit}'}"
        for one, value in zip(item.takes, item.settings.values(), strict=True)
    ]
    return {
        "name": item.name,
        "equation": equation,
        "summary": item.summary,
        "plugin": source_of(item.kind, item.name) or "",
        "settings": ", ".join(settings),
    }


def plain_number(value: float) -> str:
    """Write a number with three digits, and never an exponent."""
    return np.format_float_positional(value, 3, fractional=False, trim="-")


KINDS: dict[str, Callable[[], list[Row]]] = {
    "effects": lambda: [_effect(get_effect(name)) for name in effect_names()],
    "noise effects": lambda: [_noise_effect(get_noise_effect(n)) for n in noise_effect_names()],
    "gross errors": lambda: [
        _item(error, error.equation) for error in map(get_gross_error, gross_error_names())
    ],
    "models": lambda: [
        {"name": name, "n_parameters": m.n_parameters, "parameters": ", ".join(m.parameter_names)}
        for name, m in ((name, get_model(name)) for name in MODELS)
    ],
    "schemes": lambda: [
        {"name": scheme.name, "n_positions": scheme.n_positions, "status": scheme.status}
        for scheme in map(get_scheme, scheme_names())
    ],
    "approaches": lambda: [{"name": name} for name in approach_names()],
    "data sheets": lambda: [
        {"name": sheet.name, "title": sheet.title, **{q: getattr(sheet, q) for q in QUANTITIES}}
        for sheet in map(get_data_sheet, data_sheet_names())
    ],
}
"""Rows of each catalogue."""
