"""The catalogues of effects, models, schemes and so on, as tables."""

from __future__ import annotations

from collections.abc import Callable

import pandas as pd

from accelstudy.api.given import for_programs
from accelstudy.approaches import approach_names
from accelstudy.basics.errors import UnknownNameError
from accelstudy.campaign.gross_errors import get_gross_error, gross_error_names
from accelstudy.data_sheets.reading import data_sheet_names, get_data_sheet
from accelstudy.data_sheets.sheet import QUANTITIES
from accelstudy.effects import Effect, effect_names, get_effect
from accelstudy.noise_effects import get_noise_effect, noise_effect_names
from accelstudy.schemes import get_scheme, scheme_names
from accelstudy.sensors.models import MODELS, get_model


@for_programs
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
    return pd.DataFrame(KINDS[kind]()).set_index("name")


Rows = list[dict[str, object]]


def _effects() -> Rows:
    return [_effect(get_effect(name)) for name in effect_names()]


def _effect(effect: Effect) -> dict[str, object]:
    return {
        "name": effect.name,
        "part": effect.part,
        "family": effect.family,
        "equation": effect.equation,
        "parameters": ", ".join(parameter.name for parameter in effect.parameters),
        "unit": effect.parameters[0].unit,
        "typical_low": effect.typical[0],
        "typical_high": effect.typical[1],
        "settings": ", ".join(setting.name for setting in effect.takes),
        "summary": effect.summary,
    }


def _noise_effects() -> Rows:
    each = map(get_noise_effect, noise_effect_names())
    return [
        {"name": one.name, "equation": one.equation,
         "settings": ", ".join(setting.name for setting in one.takes), "summary": one.summary}
        for one in each
    ]  # fmt: skip


def _gross_errors() -> Rows:
    each = map(get_gross_error, gross_error_names())
    return [{"name": e.name, "equation": e.equation, "summary": e.summary} for e in each]


def _models() -> Rows:
    return [
        {"name": name, "n_parameters": model.n_parameters,
         "parameters": ", ".join(model.parameter_names)}
        for name, model in ((name, get_model(name)) for name in MODELS)
    ]  # fmt: skip


def _schemes() -> Rows:
    each = map(get_scheme, scheme_names())
    return [{"name": s.name, "n_positions": s.n_positions, "status": s.status} for s in each]


def _approaches() -> Rows:
    return [{"name": name} for name in approach_names()]


def _data_sheets() -> Rows:
    each = map(get_data_sheet, data_sheet_names())
    return [
        {"name": s.name, "title": s.title, **{q: getattr(s, q) for q in QUANTITIES}} for s in each
    ]


KINDS: dict[str, Callable[[], Rows]] = {
    "effects": _effects,
    "noise effects": _noise_effects,
    "gross errors": _gross_errors,
    "models": _models,
    "schemes": _schemes,
    "approaches": _approaches,
    "data sheets": _data_sheets,
}
"""Catalogues by their names."""
