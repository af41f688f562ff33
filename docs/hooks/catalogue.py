"""Lists of what there is to choose from: effects, errors, models, schemes, approaches, sensors."""

import inspect
import math
import re

from markdown_text import code, page, plain, table

import accelstudy
from accelstudy.approaches import get_approach
from accelstudy.basics.units import display_unit, to_attitude, to_display, unit_label
from accelstudy.campaign.importing.public import public_data
from accelstudy.data_sheets import data_sheet_names, get_data_sheet
from accelstudy.data_sheets.sheet import QUANTITIES
from accelstudy.effects import get_effect
from accelstudy.noise_effects import get_noise_effect
from accelstudy.schemes import get_scheme, scheme_families, scheme_names
from accelstudy.sensors.models import MODELS, PRESETS
from accelstudy.verbs.tables import plain_number as number

KINDS = {
    "effects": get_effect,
    "noise effects": get_noise_effect,
    "approaches": get_approach,
}


def effects(part):
    """Effects of a part, sensor or rig, one a line."""
    found = accelstudy.catalogue("effects").query("part == @part")
    rows = [(f"[`{e.Index}`](#{e.Index})", _equation(e), e.family) for e in found.itertuples()]
    return table(("effect", "what it adds", "family"), rows)


def each(kind):
    """All things of a kind, one after the other: the docstring of each, and its row."""
    rows = accelstudy.catalogue(kind).itertuples()
    return page(*(_entry(KINDS[kind](row.Index), row) for row in rows))


def _entry(thing, row):
    facts = {
        "Formula": _equation(row),
        "Parameters": ", ".join(
            f"{p.symbol} {code(p.name)}" for p in getattr(thing, "parameters", ())
        ),
        "Typical size": _typical(row),
        "Needs of each hold": getattr(row, "needs", "").replace(" and the ", ", "),
        "Family": getattr(row, "family", ""),
        "Conditions per position": getattr(thing, "n_conditions", ""),
    }
    settings = []
    for one in getattr(thing, "takes", ()):
        ends = {"above": one.above, "below": one.below}
        within = ", ".join(f"{word} {end:g}" for word, end in ends.items() if math.isfinite(end))
        default = "drawn" if math.isnan(one.default) else number(one.default)
        settings.append((code(one.name), _unit(one.unit), default, within))
    return page(
        f"## `{row.Index}`",
        plain(inspect.cleandoc(type(thing).__doc__ or "")),
        table(("", ""), [(f"**{name}**", fact) for name, fact in facts.items() if fact]),
        table(("setting", "unit", "default", "range"), settings) if settings else "",
    )


def _equation(row):
    """An equation as it is printed, with its indices set low."""
    text = getattr(row, "equation", "").replace("<", "&lt;")
    return re.sub(r"_([^\W_²³]+(?:,\w)?)", r"<sub>\1</sub>", text)


def _typical(row):
    if hasattr(row, "setting"):
        ends, unit = (row.typical_low, row.typical_high), row.unit
    elif hasattr(row, "typical_low"):
        ends = to_display((row.typical_low, row.typical_high), row.unit)
        unit = display_unit(row.unit)
    else:
        return ""
    return f"{' … '.join(map(number, ends))} {_unit(unit)} {code(getattr(row, 'setting', ''))}"


def _unit(unit):
    return "" if unit == "1" else unit_label(unit)


def models():
    """Models."""
    linked = {
        name: ", ".join(f"[{e}](effects.md#{e})" for e in own) for name, own in MODELS.items()
    }
    numbers = accelstudy.catalogue("models")["n_parameters"]
    rows = [(code(name), n, linked[name]) for name, n in numbers.items()]
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
    sheets = {name: get_data_sheet(name) for name in data_sheet_names()}
    rows = []
    for name, (unit, meaning) in QUANTITIES.items():
        values = [getattr(sheet, name) for sheet in sheets.values()]
        shown = ["" if value is None else number(to_display(value, unit)) for value in values]
        rows.append((code(name), meaning, _unit(display_unit(unit)), *shown))
    sources = [(code(name), sheet.title, sheet.source) for name, sheet in sheets.items()]
    return page(
        table(("quantity", "meaning", "unit", *map(code, sheets)), rows),
        table(("name", "sensor", "source"), sources),
    )


def public():
    """Public data."""
    rows = [
        (code(name), data.description, data.licence, f"[{data.file_name}]({data.url})")
        for name, data in public_data().items()
    ]
    return table(("name", "what it is", "licence", "file"), rows)
