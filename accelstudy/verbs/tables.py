"""Tables of what there is to choose from, and of what it can determine."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from os import PathLike
from typing import Any

import numpy as np
import pandas as pd

from accelstudy.approaches import approach_names, get_approach
from accelstudy.basics import units
from accelstudy.basics.arguments import as_sequence
from accelstudy.basics.errors import InputError, UnknownNameError
from accelstudy.basics.plugins import source_of
from accelstudy.basics.progress import stage, track
from accelstudy.campaign.importing.public import public_data
from accelstudy.data_sheets.reading import data_sheet_names, get_data_sheet
from accelstudy.data_sheets.sheet import QUANTITIES
from accelstudy.design.estimability import estimability
from accelstudy.diagnosis import visibility
from accelstudy.effects import Effect, effect_names, get_effect
from accelstudy.leveling.angles import angles_of
from accelstudy.noise_effects import NoiseEffect, get_noise_effect, noise_effect_names
from accelstudy.schemes import get_scheme, scheme_families, scheme_names
from accelstudy.sensors.models import MODELS, compose, get_model
from accelstudy.simulation.hold_plan import PROVIDES, check_needs_no_plan
from accelstudy.simulation.sessions import Noise
from accelstudy.study.config import read_study
from accelstudy.verbs.inputs import resolve

Row = dict[str, object]


def rows_of(kind: str) -> pd.DataFrame:
    """Return a catalogue by its name, in which - may be a space."""
    make = KINDS.get(str(kind).replace(" ", "-"))
    if make is None:
        raise UnknownNameError("catalogue", kind, KINDS)
    return pd.DataFrame(make()).set_index("name")


def _effect(item: Effect | NoiseEffect) -> Row:
    """Row of an effect of the sensor or of the rig, or of a noise effect."""
    row: Row = {"name": item.name, "equation": item.equation, "summary": item.summary}
    settings = [
        f"{one.name}={plain_number(value)} {_unit(one.unit)}".rstrip()
        + (f" ({one.limits})" if one.limits else "")
        for one, value in zip(item.takes, item.settings.values(), strict=True)
    ]
    if isinstance(item, Effect):
        columns = compose(item.spec, (item.spec,)).hold_columns
        unit, ends = item.unit, item.typical
        row |= {
            "part": item.part,
            "parameters": ", ".join(parameter.name for parameter in item.parameters),
            "typical": f"{_ends(units.to_display(ends, unit))} {units.shown_unit(unit)}",
            "needs": ", ".join(column for column in columns if column in PROVIDES),
            "family": item.family,
        }
    else:
        first = [f"{s.name} {_ends(item.typical)} {_unit(s.unit)}" for s in item.takes[:1]]
        row |= {"part": "noise", "typical": "".join(first).rstrip()}
    return row | {"settings": "; ".join(settings), "plugin": source_of(item.kind, item.name)[0]}


def _ends(ends: Iterable[float]) -> str:
    return " … ".join(map(plain_number, ends))


def _unit(unit: str) -> str:
    return "" if unit == "1" else units.unit_label(unit)


def plain_number(value: float) -> str:
    """Write a number with three digits, and never an exponent."""
    return np.format_float_positional(value, 3, fractional=False, trim="-")


KINDS: dict[str, Callable[[], list[Row]]] = {
    "effects": lambda: [
        *map(_effect, sorted(map(get_effect, effect_names()), key=lambda one: one.part == "rig")),
        *map(_effect, map(get_noise_effect, noise_effect_names())),
    ],
    "models": lambda: [
        {"name": name, "parameters": ", ".join(m.parameter_names), "n_parameters": m.n_parameters}
        for name, m in ((name, get_model(name)) for name in MODELS)
    ],
    "schemes": lambda: [
        {"name": scheme.name, "n_positions": scheme.n_positions, "status": scheme.status}
        for scheme in map(get_scheme, scheme_names())
    ],
    "approaches": lambda: [
        {"name": one.name, "n_conditions": one.n_conditions}
        for one in map(get_approach, approach_names())
    ],
    "data-sheets": lambda: [
        {"name": sheet.name, "title": sheet.title, **{q: getattr(sheet, q) for q in QUANTITIES}}
        for sheet in map(get_data_sheet, data_sheet_names())
    ],
    "public-data": lambda: [
        {"name": k, "description": one.description, "licence": one.licence, "url": one.url}
        for k, one in public_data().items()
    ],
}
"""Rows of each catalogue."""


# --- what it can determine ----------------------------------------------------------------------


def visible_effects(
    campaign: Any, scheme: str | None, model: str, approach: str | None
) -> pd.DataFrame:
    """Return what a campaign or a scheme can show of the effects that a model leaves out."""
    if campaign is not None and scheme is not None:
        raise InputError("effects: `campaign` and `scheme` exclude each other; give one of them")
    with stage("what can be shown"):
        if scheme is None:
            examined = visibility.examine_campaign(*resolve(campaign, model, approach))
        else:
            by = get_approach(approach or "robot")
            examined = visibility.examine_scheme(get_scheme(scheme), get_model(model), by)
        table = visibility.visibility_table(examined)
    table.attrs["legend"] = (
        "MDB, minimal detectable bias: parameter that a test at 0.1 % finds in 80 of 100 cases;"
        "\nMIB, minimal identifiable bias: size that also excludes the most similar effect;"
        "\nwith: setting in which the effect shows best, of those that a diagnosis tries;"
        "\nconfused with: the nearest effects and the cosine of their signatures, 1 for the same."
        f"\n{units.angle_note()}."
    )
    return table


def scheme_table(names: Sequence[str], model: str, approach: str) -> pd.DataFrame:
    """Return what schemes, by default all, determine of the ideal sensor."""
    chosen_model, chosen_approach = get_model(model), get_approach(approach)
    check_needs_no_plan(chosen_model)
    rows, pole = [], f"pole/{units.attitude_unit()}"
    for scheme in map(get_scheme, track(as_sequence(names) or scheme_names(), "schemes")):
        found = estimability(scheme, chosen_model, chosen_approach, blur=Noise().sigma_force)
        rows.append(
            {
                "scheme": scheme.name,
                "n": scheme.n_positions,
                "status": scheme.status,
                "rank": f"{found.rank}/{len(found.parameter_names)}",
                "condition": found.condition if found.estimable else math.nan,
                "r": found.redundancy,
                "m": scheme.fourth_moment,
                pole: float(units.to_attitude(scheme.pole_distance)),
                "not estimable": ", ".join(found.not_estimable),
            }
        )
    table = pd.DataFrame(rows).round({"condition": 1, "m": 4, pole: 1})
    table.attrs["title"] = f"model {chosen_model.name}, approach {approach}"
    table.attrs["legend"] = (
        "rank and condition: of the scaled design matrix at the ideal sensor;"
        "\nr: conditions - unknowns; m: mean of x²y²;"
        "\npole: distance to the x axis, where roll is undefined;"
        f"\n{units.angle_note()}."
        f"\nFamilies: {', '.join(scheme_families())}."
    )
    return table


def directions(name: str) -> pd.DataFrame:
    """Return the directions of a scheme, with roll and pitch in the unit of angles."""
    scheme = get_scheme(name)
    attitudes = units.to_attitude(angles_of(-scheme.directions))
    columns = ["x", "y", "z", *(f"{angle}_{units.attitude_unit()}" for angle in ("roll", "pitch"))]
    numbers = pd.RangeIndex(1, scheme.n_positions + 1, name="position")
    table = pd.DataFrame(np.hstack([scheme.directions, attitudes]), numbers, columns)
    table.attrs["title"] = f"{scheme.title} ({scheme.status}): {scheme.source}"
    return table


def cell_table(configurations: Sequence[str | PathLike[str]]) -> pd.DataFrame:
    """Return the cells of a study: redundancy, replicates, and why one cannot be estimated."""
    rows = []
    for cell in read_study(*as_sequence(configurations)).cells:
        found = estimability(
            cell.positions, cell.estimated_model, cell.conditions, cell.noise, hold=cell.hold
        )
        rows.append((cell.name, found.redundancy, cell.replicates, found.reason or ""))
    columns = ["cell", "redundancy", "replicates", "reason"]
    table = pd.DataFrame(rows, columns=columns).set_index("cell")
    table.attrs["legend"] = f"{len(table)} cells, up to {table['replicates'].sum()} calibrations"
    return table
