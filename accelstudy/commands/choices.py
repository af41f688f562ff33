"""Commands that list what there is to choose from: models, effects, schemes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import click

from accelstudy.basics.errors import InputError
from accelstudy.basics.progress import say, show, stage, track
from accelstudy.commands.bridge import ANGLE_UNIT, Command
from accelstudy.verbs import kinds
from accelstudy.verbs.kinds import verb

if TYPE_CHECKING:
    import pandas as pd

INDENT = "    "


@verb
def models() -> None:
    """List sensor models, and the presets of Table 1.

    Commands take compositions, too: models and effects joined by +, as in
    bias-scale+warm_up(tau=300).

    Examples
    --------
        accelstudy models
    """
    from accelstudy.sensors.models import MODELS, PRESETS, get_model

    for name in MODELS:
        model = get_model(name)
        click.echo(f"{name} ({model.n_parameters}): {', '.join(model.parameter_names)}")
    click.echo("\nTable 1:")
    width = max(len(preset.source) for preset in PRESETS)
    for preset in PRESETS:
        click.echo(f"  {preset.source:{width}s} {preset.model} in {preset.scheme}")


@verb
def effects(
    *,
    campaign: kinds.File | None = None,
    scheme: kinds.SchemeName | None = None,
    model: kinds.ModelName = "bias-scale-nonorthogonality",
    approach: kinds.UsualApproach = None,
) -> None:
    """List all effects, or what a campaign can show of them.

    Models are composed of effects. Parameters are in the units shown, settings in SI. With
    `campaign` or `scheme` the command tells which effects can show beside the model, how large they
    must be to be detected and to be named, and with what they would be confused.

    Parameters
    ----------
    campaign : path
        Folder of a campaign.
    scheme : str
        Name of a scheme, instead of a campaign.

    Examples
    --------
        accelstudy effects
        accelstudy effects --campaign my-campaign
    """
    from accelstudy.basics.units import angle_note

    if campaign is None and scheme is None:
        click.echo(list_effects())
        say(f"\n{angle_note()}.")
        return
    if campaign is not None and scheme is not None:
        raise InputError("effects: --campaign and --scheme exclude each other; give one of them")
    from accelstudy.api.inputs import resolve
    from accelstudy.approaches import get_approach
    from accelstudy.diagnosis import visibility
    from accelstudy.schemes import get_scheme
    from accelstudy.sensors.models import get_model

    with stage("what can be shown"):
        if campaign is not None:
            examined = visibility.examine_campaign(*resolve(campaign, model, approach))
        else:
            by = get_approach(approach or "robot")
            examined = visibility.examine_scheme(get_scheme(str(scheme)), get_model(model), by)
        table = visibility.visibility_table(examined).to_string(index=False)
    click.echo(table)
    say(
        "\nMDB: size of one parameter that a test at 0.1 % detects with a probability of 80 %;"
        "\nMIB: size at which the effect can also be told from the one it is most like;"
        "\nwith: setting in which the effect shows best, of those that a diagnosis tries;"
        "\nconfused with: the nearest effects and the cosine of their signatures, 1 for the same."
        f"\n{angle_note()}."
    )


def list_effects() -> str:
    """Text on effects of the sensor and of the rig, noise effects and gross errors.

    Parameters and typical sizes are in the units shown to people, settings in SI as specs have
    them.
    """
    from accelstudy.api.catalogues import catalogue

    effects = dict(iter(catalogue("effects").groupby("part")))
    parts = {f"Effects of the {part}": effects[part] for part in ("sensor", "rig")}
    parts |= {name.capitalize(): catalogue(name) for name in ("noise effects", "gross errors")}
    return "\n\n".join("\n".join([f"{head}\n", *_items(rows)]) for head, rows in parts.items())


def _items(table: pd.DataFrame) -> Iterator[str]:
    """Lines on each row of a catalogue."""
    from accelstudy.api.catalogues import plain_number
    from accelstudy.basics.units import display_unit, to_display

    for name, row in table.iterrows():
        yield f"{name}: {row['equation']}"
        lines = [row["summary"], row["plugin"] and f"of the plug-in {row['plugin']}"]
        settings = row["settings"] and f"settings: {row['settings']}"
        if "parameters" in row:
            low, high = map(
                plain_number, to_display(row[["typical_low", "typical_high"]], row["unit"])
            )
            size = f"[{display_unit(row['unit'])}], typically {low} … {high}"
            lines += [f"{row['parameters']} {size}", settings]
            lines += [row["needs"] and f"needs the {row['needs']} of each hold"]
            lines += [row["family"] and f"family: {row['family']}"]
        elif "typical_low" in row:
            low, high = map(plain_number, (row["typical_low"], row["typical_high"]))
            unit = "" if row["unit"] == "1" else f" {row['unit']}"
            lines += [settings, f"{row['setting']} typically {low} … {high}{unit}"]
        else:
            lines.append(settings)
        yield from (f"{INDENT}{line}" for line in lines if line)


@verb
def schemes(
    names: Sequence[kinds.SchemeName] = (),
    *,
    model: kinds.ModelName = "bias-scale-nonorthogonality",
    approach: kinds.ApproachName = "gravity",
) -> None:
    """List position schemes and what they can determine.

    Parameters
    ----------
    names : sequence of str
        A scheme, such as fibonacci-60 or random-20-7. Without them all are listed.

    Examples
    --------
        accelstudy schemes --approach robot fibonacci-24 mclaren-24
    """
    import pandas as pd

    from accelstudy.approaches import get_approach
    from accelstudy.basics.units import angle_note, attitude_unit, to_attitude
    from accelstudy.design.estimability import estimability
    from accelstudy.schemes import get_scheme, scheme_families, scheme_names
    from accelstudy.sensors.models import get_model
    from accelstudy.simulation.hold_plan import check_needs_no_plan
    from accelstudy.simulation.sessions import Noise

    chosen_model, chosen_approach = get_model(model), get_approach(approach)
    check_needs_no_plan(chosen_model)
    rows = []
    for name in track(names or scheme_names(), "schemes"):
        chosen = get_scheme(name)
        determined = estimability(chosen, chosen_model, chosen_approach, blur=Noise().sigma_force)
        rows.append(
            {
                "scheme": chosen.name,
                "n": chosen.n_positions,
                "status": chosen.status,
                "rank": f"{determined.rank}/{len(determined.parameter_names)}",
                "condition": f"{determined.condition:.1f}" if determined.estimable else "-",
                "r": determined.redundancy,
                "m": f"{chosen.fourth_moment:.4f}",
                f"pole/{attitude_unit()}": f"{to_attitude(chosen.pole_distance):.1f}",
                "not estimable": ", ".join(determined.not_estimable),
            }
        )
    say(f"model {chosen_model.name}, approach {approach}\n")
    click.echo(pd.DataFrame(rows).to_string(index=False))
    say(
        "\nrank and condition: of the scaled design matrix at the ideal sensor;"
        "\nr: conditions - unknowns; m: mean of x²y²;"
        "\npole: distance to the x axis, where roll is undefined;"
        f"\n{angle_note()}."
        f"\nFamilies: {', '.join(scheme_families())}."
    )


@verb
def scheme(name: kinds.SchemeName) -> None:
    """Print the directions of a scheme, with its source.

    They are directions of gravity in the axes of the sensor, as a CSV table.

    Parameters
    ----------
    name : str
        Name of the scheme, or a file.

    Examples
    --------
        accelstudy scheme fibonacci-24
    """
    import numpy as np
    import pandas as pd

    from accelstudy.basics.units import attitude_unit, to_attitude
    from accelstudy.leveling.angles import angles_of
    from accelstudy.schemes import get_scheme

    chosen = get_scheme(name)
    show(f"# {chosen.title} ({chosen.status}): {chosen.source}")
    attitudes = to_attitude(angles_of(-chosen.directions))
    columns = ["x", "y", "z", *(f"{angle}_{attitude_unit()}" for angle in ("roll", "pitch"))]
    table = pd.DataFrame(np.hstack([chosen.directions, attitudes]), columns=columns)
    click.echo(table.to_csv(index_label="position", float_format="%.6f"), nl=False)


MODELS = Command(models, shared=())
EFFECTS = Command(effects)
SCHEMES = Command(schemes)
SCHEME = Command(scheme, shared=[ANGLE_UNIT])
