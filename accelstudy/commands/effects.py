"""The command that lists effects, or what a campaign can show of them."""

from __future__ import annotations

from pathlib import Path

import click

from accelstudy.basics.errors import InputError
from accelstudy.basics.progress import say, stage
from accelstudy.commands.options import (
    PATH,
    SCHEME,
    angle_unit_option,
    approach_option,
    example,
    model_option,
    quiet_option,
)


@click.command(
    "effects", epilog=example("accelstudy effects", "accelstudy effects --campaign my-campaign")
)
@click.option("--campaign", type=PATH, help="Folder of a campaign.")
@click.option("--scheme", type=SCHEME, help="Name of a scheme, instead of a campaign.")
@model_option
@approach_option(None)
@angle_unit_option
@quiet_option
def effects_command(
    campaign: Path | None, scheme: str | None, model: str, approach: str | None
) -> None:
    """List all effects, or what a campaign can show of them.

    Models are composed of effects. Parameters are in the units shown, settings in SI. With
    --campaign or --scheme the command tells which effects can show beside the model, how large they
    must be to be detected and to be named, and with what they would be confused.
    """
    from accelstudy.basics.units import angle_note

    if campaign is None and scheme is None:
        from accelstudy.commands.catalogue import catalogue

        click.echo(catalogue())
        say(f"\n{angle_note()}.")
        return
    if campaign is not None and scheme is not None:
        raise InputError("effects: --campaign and --scheme exclude each other; give one of them")
    from accelstudy.approaches import get_approach
    from accelstudy.campaign.format import read_campaign
    from accelstudy.diagnosis import visibility
    from accelstudy.schemes import get_scheme
    from accelstudy.sensors.models import get_model

    chosen = get_model(model)
    with stage("what can be shown"):
        if campaign is not None:
            named = None if approach is None else get_approach(approach)
            examined = visibility.examine_campaign(read_campaign(campaign), chosen, named)
        else:
            examined = visibility.examine_scheme(
                get_scheme(str(scheme)), chosen, get_approach(approach or "robot")
            )
        table = visibility.visibility_table(examined).to_string(index=False)
    click.echo(table)
    say(
        "\nMDB: size of one parameter that a test at 0.1 % detects with a probability of 80 %;"
        "\nMIB: size at which the effect can also be told from the one it is most like;"
        "\nwith: setting in which the effect shows best, of those that a diagnosis tries;"
        "\nworst MDB: where it shows worst of them;"
        "\nconfused with: the nearest effects and the cosine of their signatures, 1 for the same."
        f"\n{angle_note()}."
    )
