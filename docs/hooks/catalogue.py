"""Lists of what there is to choose from: effects, errors, models, schemes, approaches, sensors."""

import inspect
import math
import re

from markdown_text import code, page, plain, table

import accelstudy
from accelstudy.approaches import get_approach
from accelstudy.basics.units import shown_unit, to_attitude, to_display
from accelstudy.data_sheets import data_sheet_names, get_data_sheet
from accelstudy.data_sheets.sheet import MEANINGS, QUANTITIES
from accelstudy.effects import get_effect
from accelstudy.noise_effects import get_noise_effect
from accelstudy.schemes import get_scheme, scheme_families, scheme_names
from accelstudy.verbs.tables import plain_number as number

GETTERS = {"noise": get_noise_effect, "sensor": get_effect, "rig": get_effect}


def effects(part):
    """Effects of a part, sensor or rig, one a line."""
    found = accelstudy.catalogue("effects").query("part == @part")
    rows = [(f"[`{e.Index}`](#{e.Index})", _low(e.equation), e.family) for e in found.itertuples()]
    return table(("effect", "what it adds", "family"), rows)


def each(kind, *parts):
    """All things of a kind, or of parts of it: the docstring of each, and its row."""
    rows = accelstudy.catalogue(kind).fillna("")
    rows = rows[rows["part"].isin(parts)] if parts else rows
    return page(*(_entry(name, dict(row)) for name, row in rows.iterrows()))


def _entry(name, row):
    thing = GETTERS.get(row.pop("part", ""), get_approach)(name)
    row.pop("summary", "")
    forms = {"equation": _low, "parameters": code, "settings": code}
    facts = [
        (f"**{key.replace('_', ' ')}**", forms.get(key, str)(value))
        for key, value in row.items()
        if value
    ]
    return page(
        f"## `{name}`", plain(inspect.cleandoc(type(thing).__doc__ or "")), table(("", ""), facts)
    )


def _low(text):
    """Text with the indices of its symbols set low."""
    return re.sub(r"_([^\W_²³]+(?:,\w)?)", r"<sub>\1</sub>", text.replace("<", "&lt;"))


def models():
    """Models."""
    rows = accelstudy.catalogue("models").itertuples()
    return table(("model", "", "parameters"), [(code(r[0]), r[2], code(r[1])) for r in rows])


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
    circles = [f'<circle class="edge" cx="{x}" cy="22" r="20"/>' for x in (22, 68)]
    for x, y, z in directions:
        middle, size = 22 if z >= 0 else 68, 20 / math.sqrt(1 + abs(z))
        circles.append(f'<circle cx="{middle + size * y:.1f}" cy="{22 - size * x:.1f}" r="1.9"/>')
    head = (
        f'class="positions" viewBox="0 0 90 44" role="img" aria-label="{len(directions)} positions"'
    )
    return f"<svg {head}>{''.join(circles)}</svg>"


def data_sheets():
    """Data sheets, and where they come from."""
    sheets = {name: get_data_sheet(name) for name in data_sheet_names()}
    rows = []
    for name, quantity in QUANTITIES.items():
        values = (getattr(sheet, name) for sheet in sheets.values())
        shown = ("" if v is None else number(to_display(v, quantity.unit)) for v in values)
        rows.append((code(name), MEANINGS[name], shown_unit(quantity.unit), *shown))
    sources = [(code(name), sheet.title, sheet.source) for name, sheet in sheets.items()]
    return page(
        table(("quantity", "meaning", "unit", *map(code, sheets)), rows),
        table(("name", "sensor", "source"), sources),
    )


def public():
    """Public data."""
    rows = [
        (code(one.Index), one.description, one.licence, f"[{one.url.split('/')[-1]}]({one.url})")
        for one in accelstudy.catalogue("public-data").itertuples()
    ]
    return table(("name", "what it is", "licence", "file"), rows)
