"""Pages of what there is to choose from: effects, errors, models, schemes, approaches, sensors."""

import inspect
import math
import re

import numpy as np
from markdown_text import code, page, plain, table

from accelstudy.approaches import approach_names, get_approach
from accelstudy.basics.units import display_unit, to_attitude, to_display, unit_label
from accelstudy.campaign.gross_errors import get_gross_error, gross_error_names
from accelstudy.campaign.importing.public import public_data
from accelstudy.data_sheets import data_sheet_names, get_data_sheet
from accelstudy.data_sheets.sheet import QUANTITIES
from accelstudy.effects import effect_names, get_effect
from accelstudy.noise_effects import get_noise_effect, noise_effect_names
from accelstudy.schemes import get_scheme, scheme_families, scheme_names
from accelstudy.sensors.models import MODELS, PRESETS, compose, get_model
from accelstudy.simulation.hold_plan import PROVIDES


def number(value):
    """Three digits, and never an exponent."""
    return np.format_float_positional(value, 3, fractional=False, trim="-")


def _unit(unit):
    return "" if unit == "1" else unit_label(unit)


def _equation(text):
    """An equation as it is printed, with its indices set low."""
    return re.sub(r"_([^\W_²³]+(?:,\w)?)", r"<sub>\1</sub>", text.replace("<", "&lt;"))


def _docstring(thing):
    """What a class says of itself."""
    return plain(inspect.cleandoc(type(thing).__doc__ or ""))


def _settings(thing):
    rows = []
    for setting, value in zip(thing.takes, thing.settings.values(), strict=True):
        least = f"above {setting.above:g}" if math.isfinite(setting.above) else ""
        most = f"below {setting.below:g}" if math.isfinite(setting.below) else ""
        rows.append(
            (
                code(setting.name),
                _unit(setting.unit),
                "drawn" if math.isnan(value) else number(value),
                ", ".join(filter(None, (least, most))),
            )
        )
    return table(("setting", "unit", "default", "range"), rows) if rows else ""


def _effect(effect):
    unit = effect.parameters[0].unit
    low, high = map(number, to_display(effect.typical, unit))
    columns = compose(effect.spec, (effect.spec,)).hold_columns
    facts = [
        ("Adds", _equation(effect.equation)),
        ("Parameters", ", ".join(f"{p.symbol} {code(p.name)}" for p in effect.parameters)),
        ("Typical size", f"{low} … {high} {unit_label(display_unit(unit))}"),
        ("Needs of each hold", ", ".join(column for column in columns if column in PROVIDES)),
        ("Family", effect.family),
    ]
    return page(
        f"## `{effect.name}`",
        _docstring(effect),
        table(("", ""), [(f"**{name}**", value) for name, value in facts if value]),
        _settings(effect),
    )


def effects():
    """Effects of the sensor and of the rig."""
    chosen = [get_effect(name) for name in effect_names()]
    parts = {part: [e for e in chosen if e.part == part] for part in ("sensor", "rig")}

    def listed(part):
        rows = [
            (f"[`{e.name}`](#{e.name})", _equation(e.equation), len(e.parameters), e.family)
            for e in parts[part]
        ]
        return table(("effect", "what it adds", "parameters", "family"), rows)

    return page(
        "# Effects",
        "A sensor model is a composition of effects. Parts are joined by `+`, and settings stand "
        "in brackets: `bias-scale-nonorthogonality+warm_up(tau=300)`. The names of some parameters "
        "in square brackets leave out the others: `saturation(knee=9.5)[k_sat_z]`.",
        "In the equations *f* is the specific force in the axes of the sensor, *i* one of these "
        "axes, *g* local gravity, *t* the time since the start and *T* the temperature. Typical "
        "sizes go from good to cheap equipment. Settings are in SI units. Effects of one *family* "
        "are easily taken for each other. `accelstudy effects` prints the same list.",
        "**Of the sensor**",
        listed("sensor"),
        "**Of the rig** that turns it, a robot with its encoders and its base:",
        listed("rig"),
        *map(_effect, [*parts["sensor"], *parts["rig"]]),
    )


def noise_effects():
    """Noise effects."""
    parts = []
    for effect in map(get_noise_effect, noise_effect_names()):
        low, high = map(number, effect.typical)
        first = effect.takes[0]
        typical = f"{code(first.name)} is typically {low} … {high} {_unit(first.unit)}".strip()
        facts = [("**Noise**", _equation(effect.equation)), ("**Typical size**", typical)]
        text = [_docstring(effect), table(("", ""), facts), _settings(effect)]
        parts.append(page(f"## `{effect.name}`", *text))
    return page(
        "# Noise effects",
        "The noise of the position means is white, Gaussian and of one standard deviation on all "
        "axes. A noise effect is a way in which it is not: `noise: {effects: [heavy_tails(nu=3)]}` "
        "in the configuration of a study, or `--noise-effect` of `accelstudy simulate-campaign`. "
        "The calibration does not know of it. Settings are in SI units. Several work one after the "
        "other.",
        *parts,
    )


def gross_errors():
    """Gross errors."""
    parts = [
        page(
            f"## `{error.name}`",
            _docstring(error),
            table(("", ""), [("**Data**", _equation(error.equation))]),
            _settings(error),
        )
        for error in map(get_gross_error, gross_error_names())
    ]
    return page(
        "# Gross errors",
        "A gross error is a mistake in the data, not in the sensor. `accelstudy "
        "simulate-campaign --gross` puts one in, and `accelstudy diagnose` recognises and "
        "mends it where that can be done. A setting that is *drawn* is drawn for the campaign if "
        "it is not given.",
        *parts,
    )


def models():
    """Models and the presets of Table 1."""
    rows = [
        (
            code(name),
            get_model(name).n_parameters,
            ", ".join(f"[{effect}](effects.md#{effect})" for effect in own),
        )
        for name, own in MODELS.items()
    ]
    presets = [
        (preset.source, code(preset.model), f"[`{preset.scheme}`](schemes.md)")
        for preset in PRESETS
    ]
    return page(
        "# Models",
        table(("model", "parameters", "effects"), rows),
        "Wherever a model is asked for, a composition of models and [effects](effects.md) will do "
        "(`bias-scale+warm_up(tau=300)`), and so will the path of a YAML file with a model, such "
        "as the `model.yaml` of a diagnosis. Where a file has several models, the name follows "
        "after a colon: `mine.yaml:with-all`.",
        "## Published calibrations",
        "Table 1 of the paper: who calibrates which model in which positions. A study with "
        "`presets` in its configuration simulates them all.",
        table(("source", "model", "scheme"), presets),
    )


def schemes():
    """Schemes."""
    rows = []
    for scheme in map(get_scheme, scheme_names()):
        rows.append(
            (
                code(scheme.name),
                _positions(scheme.directions),
                scheme.n_positions,
                scheme.status,
                f"{scheme.fourth_moment:.4f}",
                f"{to_attitude(scheme.pole_distance):.1f}",
                scheme.source,
            )
        )
    return page(
        "# Schemes",
        "A scheme is a list of positions: directions of gravity in the body frame, in the order of "
        "acquisition. *m* is the mean of x²y² over the positions and the pairs of axes; it is "
        "1/15 = 0.0667 on the sphere, and the closed forms of the standard deviations contain it. "
        "*Pole* is the smallest angle to the x axis, where roll is undefined. What a scheme can "
        "determine is listed by `accelstudy schemes`, and its directions by `accelstudy scheme`.",
        table(("scheme", "positions", "n", "status", "m", "pole [gon]", "source"), rows),
        "The small drawings show where gravity points in the frame of the sensor, on maps of equal "
        "area: left the half with the sensor upright, with x up and y to the right, right the half "
        "with it upside down.",
        "*exact* are the positions of the source, *standard* the usual set of that kind, "
        "*stand-in* a substitute because the source does not publish its own, and *generated* "
        "positions follow a rule.",
        "## Families",
        "A family has a member for each number: N positions (1 to 9999), and a seed where it is "
        "random.",
        table(("family", "for example"), [(code(f), code(_member(f))) for f in scheme_families()]),
        "A scheme of your own is a YAML file such as `accelstudy design` writes. Its path stands "
        "wherever a scheme is asked for. [A new scheme](../tutorials/scheme.md) shows both ways.",
    )


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


def _member(family):
    name = family.replace("-N", "-24").replace("-SEED", "-7")
    return get_scheme(name).name


def approaches():
    """Approaches."""
    parts = []
    for approach in map(get_approach, approach_names()):
        facts = [
            ("**Conditions per position**", approach.n_conditions),
            ("**Angles from outside**", "roll and pitch" if approach.uses_angles else "none"),
        ]
        parts.append(page(f"## `{approach.name}`", _docstring(approach), table(("", ""), facts)))
    return page(
        "# Approaches",
        "An approach says what is known of each position, as condition equations for the "
        "Gauss–Helmert adjustment. The equipment decides: gravity is there for everybody, a robot "
        "also tells roll and pitch.",
        *parts,
    )


def data_sheets():
    """Data sheets and public data."""
    sheets = [get_data_sheet(name) for name in data_sheet_names()]
    rows = []
    for name, (unit, meaning) in QUANTITIES.items():
        values = [getattr(sheet, name) for sheet in sheets]
        shown = ["" if value is None else f"{number(to_display(value, unit))}" for value in values]
        rows.append((code(name), meaning, _unit(display_unit(unit)), *shown))
    public = [
        (code(name), data.description, data.licence, f"[{data.file_name}]({data.url})")
        for name, data in public_data().items()
    ]
    return page(
        "# Data sheets and public data",
        "## Data sheets",
        "`--sensor` of `accelstudy plan` and `data-sheet` takes one of these names, or a "
        "YAML file like them. What a data sheet does not say is left out.",
        table(("quantity", "meaning", "unit", *(code(sheet.name) for sheet in sheets)), rows),
        table(
            ("name", "sensor", "source"),
            [(code(sheet.name), sheet.title, sheet.source) for sheet in sheets],
        ),
        "## Public data",
        "`accelstudy public NAME --out FOLDER` downloads a file, checks its sha256 and makes a "
        "campaign of it.",
        table(("name", "what it is", "licence", "file"), public),
    )
