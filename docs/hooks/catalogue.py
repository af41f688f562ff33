"""Lists of what there is to choose from: effects, errors, models, schemes, approaches, sensors."""

import inspect
import math
import re

from markdown_text import code, page, plain, table

import accelstudy
from accelstudy.approaches import approach_names, get_approach
from accelstudy.basics.units import display_unit, to_attitude, to_display, unit_label
from accelstudy.campaign.importing.public import public_data
from accelstudy.data_sheets import data_sheet_names, get_data_sheet
from accelstudy.data_sheets.sheet import QUANTITIES
from accelstudy.effects import get_effect
from accelstudy.noise_effects import get_noise_effect, noise_effect_names
from accelstudy.schemes import get_scheme, scheme_families, scheme_names
from accelstudy.sensors.models import MODELS, PRESETS, get_model
from accelstudy.verbs.tables import plain_number as number


def _unit(unit):
    return "" if unit == "1" else unit_label(unit)


def _equation(thing):
    """An equation as it is printed, with its indices set low."""
    return re.sub(r"_([^\W_²³]+(?:,\w)?)", r"<sub>\1</sub>", thing.equation.replace("<", "&lt;"))


def _entry(thing, facts):
    """What an effect, an error or an approach says of itself, facts about it, and its settings."""
    settings = []
    for setting in getattr(thing, "takes", ()):
        value = thing.settings[setting.name]
        ends = {"above": setting.above, "below": setting.below}
        within = ", ".join(f"{w} {end:g}" for w, end in ends.items() if math.isfinite(end))
        default = "drawn" if math.isnan(value) else number(value)
        settings.append((code(setting.name), _unit(setting.unit), default, within))
    return page(
        f"## `{thing.name}`",
        plain(inspect.cleandoc(type(thing).__doc__ or "")),
        table(("", ""), [(f"**{name}**", value) for name, value in facts.items() if value]),
        table(("setting", "unit", "default", "range"), settings) if settings else "",
    )


def effects(part):
    """Effects of a part, sensor or rig, one a line."""
    rows = [
        (f"[`{e.name}`](#{e.name})", _equation(e), len(e.parameters), e.family)
        for e in map(get_effect, EFFECTS.index[EFFECTS["part"] == part])
    ]
    return table(("effect", "what it adds", "parameters", "family"), rows)


def each(kind):
    """All things of a kind, one after the other."""
    get, names, facts = KINDS[kind]
    return page(*(_entry(thing, facts(thing)) for thing in map(get, names())))


def _of_effect(effect):
    unit = effect.parameters[0].unit
    low, high = map(number, to_display(effect.typical, unit))
    return {
        "Adds": _equation(effect),
        "Parameters": ", ".join(f"{p.symbol} {code(p.name)}" for p in effect.parameters),
        "Typical size": f"{low} … {high} {unit_label(display_unit(unit))}",
        "Needs of each hold": EFFECTS["needs"][effect.name].replace(" and the ", ", "),
        "Family": effect.family,
    }


def _of_noise_effect(effect):
    first, (low, high) = effect.takes[0], map(number, effect.typical)
    typical = f"{code(first.name)} is typically {low} … {high} {_unit(first.unit)}".strip()
    return {"Noise": _equation(effect), "Typical size": typical}


def _of_approach(approach):
    outside = "roll and pitch" if approach.uses_angles else "none"
    return {"Conditions per position": approach.n_conditions, "Angles from outside": outside}


EFFECTS = accelstudy.catalogue("effects").sort_values("part", ascending=False, kind="stable")
"""Those of the sensor, then those of the rig."""
KINDS = {
    "effects": (get_effect, lambda: EFFECTS.index, _of_effect),
    "noise effects": (get_noise_effect, noise_effect_names, _of_noise_effect),
    "approaches": (get_approach, approach_names, _of_approach),
}


def models():
    """Models."""
    rows = [
        (
            code(name),
            get_model(name).n_parameters,
            ", ".join(f"[{effect}](effects.md#{effect})" for effect in own),
        )
        for name, own in MODELS.items()
    ]
    return table(("model", "parameters", "effects"), rows)


def presets():
    """The presets of Table 1."""
    rows = [(p.source, code(p.model), f"[`{p.scheme}`](schemes.md)") for p in PRESETS]
    return table(("source", "model", "scheme"), rows)


def schemes():
    """Schemes."""
    rows = [
        (code(scheme.name), _positions(scheme.directions), scheme.n_positions, scheme.status,
         f"{scheme.fourth_moment:.4f}", f"{to_attitude(scheme.pole_distance):.1f}", scheme.source)
        for scheme in map(get_scheme, scheme_names())
    ]  # fmt: skip
    return table(("scheme", "positions", "n", "status", "m", "pole [gon]", "source"), rows)


def families():
    """Families of schemes, each with a member."""
    members = {name: name.replace("-N", "-24").replace("-SEED", "-7") for name in scheme_families()}
    return table(("family", "for example"), [(*map(code, pair),) for pair in members.items()])


def _positions(directions):
    """Two maps of equal area, of the directions with z positive and of those with z negative."""
    dots = []
    for x, y, z in directions:
        stretch = 20 * math.sqrt(1 / (1 + abs(z)))
        middle = 22 if z >= 0 else 68
        dots.append(
            f'<circle cx="{middle + stretch * y:.1f}" cy="{22 - stretch * x:.1f}" r="1.9"/>'
        )
    edges = "".join(f'<circle class="edge" cx="{x}" cy="22" r="20"/>' for x in (22, 68))
    return (
        f'<svg class="positions" viewBox="0 0 90 44" role="img" '
        f'aria-label="{len(directions)} positions">{edges}{"".join(dots)}</svg>'
    )


def data_sheets():
    """Data sheets, and where they come from."""
    sheets = [get_data_sheet(name) for name in data_sheet_names()]
    rows = []
    for name, (unit, meaning) in QUANTITIES.items():
        values = [getattr(sheet, name) for sheet in sheets]
        shown = ["" if value is None else f"{number(to_display(value, unit))}" for value in values]
        rows.append((code(name), meaning, _unit(display_unit(unit)), *shown))
    sources = [(code(sheet.name), sheet.title, sheet.source) for sheet in sheets]
    return page(
        table(("quantity", "meaning", "unit", *(code(sheet.name) for sheet in sheets)), rows),
        table(("name", "sensor", "source"), sources),
    )


def public():
    """Public data."""
    rows = [
        (code(name), data.description, data.licence, f"[{data.file_name}]({data.url})")
        for name, data in public_data().items()
    ]
    return table(("name", "what it is", "licence", "file"), rows)
