"""The command line: what there is to choose from, and what a configuration would do.

The study itself is run by Snakemake.
"""

from __future__ import annotations

import json
from pathlib import Path

import click

from accelstudy.basics.errors import InputError
from accelstudy.basics.progress import say, stage, track
from accelstudy.basics.units import ANGLE_UNIT_VARIABLE, angles_in
from accelstudy.commands.advise import advise_command
from accelstudy.commands.calibration import COMMANDS
from accelstudy.commands.data_sheet import data_sheet_command
from accelstudy.commands.design import design_command
from accelstudy.commands.diagnose import diagnose_command
from accelstudy.commands.importing import import_command, public_command
from accelstudy.commands.options import (
    ANGLE_UNIT,
    PATH,
    SCHEME,
    angle_unit_option,
    approach_option,
    example,
    model_option,
    quiet_option,
)
from accelstudy.commands.plan import plan_command
from accelstudy.commands.pole import pole_command
from accelstudy.commands.simulate_campaign import simulate_campaign_command

SECTIONS = {
    "Campaigns, measured or simulated": (
        "import",
        "public",
        "simulate-campaign",
        "advise",
        "calibrate",
        "diagnose",
        "check-sigmas",
        "apply",
        "export",
    ),
    "Before a calibration, and what it is worth": ("plan", "data-sheet", "pole"),
    "What there is to choose from": ("models", "effects", "schemes", "scheme", "design"),
    "Studies": ("cells", "claims", "config-schema"),
}
"""Commands in the order of use."""


class Commands(click.Group):
    """Commands in sections, that end bad input with one line and exit status 2."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Names of all commands, in the order of use."""
        return [name for names in SECTIONS.values() for name in names]

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the sections of the help."""
        width = max(map(len, self.commands))
        for title, names in SECTIONS.items():
            with formatter.section(title):
                formatter.write_dl(
                    [
                        (name.ljust(width), self.commands[name].get_short_help_str(74 - width))
                        for name in names
                    ]
                )

    def invoke(self, ctx: click.Context) -> object:
        """Run the chosen command."""
        try:
            return super().invoke(ctx)
        except InputError as error:
            click.echo(f"error: {error}", err=True)
            ctx.exit(2)


@click.group(cls=Commands)
@click.version_option(package_name="accelstudy")
@click.option(
    "--angle-unit",
    metavar="[gon|deg]",
    type=ANGLE_UNIT,
    default="gon",
    show_default=True,
    envvar=ANGLE_UNIT_VARIABLE,
    show_envvar=True,
    help="Unit in which commands, pages and figures show angles, gon or deg.",
)
@click.pass_context
def main(ctx: click.Context, angle_unit: str) -> None:
    """Monte Carlo study of accelerometer calibration for leveling.

    `snakemake --cores 2` runs the study; these commands show what it can be made of, and calibrate
    measured data with the same adjustment.
    """
    ctx.with_resource(angles_in(angle_unit))


@main.command(epilog=example("accelstudy schemes --approach robot fibonacci-24 mclaren-24"))
@model_option
@approach_option("gravity")
@click.argument("names", nargs=-1, type=SCHEME)
@angle_unit_option
@quiet_option
def schemes(model: str, approach: str, names: tuple[str, ...]) -> None:
    """List position schemes and what they can determine.

    NAMES chooses schemes (fibonacci-60, random-20-7, ...); all named ones by default.
    """
    import pandas as pd

    from accelstudy.approaches import get_approach
    from accelstudy.basics.units import angle_note, attitude_unit, to_attitude
    from accelstudy.design.estimability import estimability
    from accelstudy.schemes import get_scheme, scheme_families, scheme_names
    from accelstudy.sensors.models import get_model
    from accelstudy.simulation.hold_plan import check_needs_no_plan

    chosen_model, chosen_approach = get_model(model), get_approach(approach)
    check_needs_no_plan(chosen_model)
    rows = []
    for name in track(names or scheme_names(), "schemes"):
        scheme = get_scheme(name)
        found = estimability(scheme, chosen_model, chosen_approach)
        rows.append(
            {
                "scheme": scheme.name,
                "n": scheme.n_positions,
                "status": scheme.status,
                "rank": f"{found.rank}/{len(found.parameter_names)}",
                "condition": f"{found.condition:.1f}" if found.estimable else "-",
                "r": found.redundancy,
                "m": f"{found.fourth_moment:.4f}",
                f"pole/{attitude_unit()}": f"{to_attitude(found.pole_distance):.1f}",
                "not estimable": ", ".join(found.not_estimable),
            }
        )
    say(f"model {chosen_model.name}, approach {approach}\n")
    click.echo(pd.DataFrame(rows).to_string(index=False))
    say(
        "\nrank and condition: of the scaled design at the ideal sensor; r: conditions - unknowns;"
        "\nm: mean of x²y²; pole: distance to the x axis, where roll is undefined;"
        f"\n{angle_note()}."
        f"\nFamilies: {', '.join(scheme_families())}."
    )


@main.command(epilog=example("accelstudy scheme fibonacci-24"))
@click.argument("name", type=SCHEME)
@angle_unit_option
def scheme(name: str) -> None:
    """Print the directions of a scheme, with its source.

    They are those of gravity in the body frame, as a CSV table.
    """
    import numpy as np
    import pandas as pd

    from accelstudy.basics.units import attitude_unit, to_attitude
    from accelstudy.leveling.angles import angles_of
    from accelstudy.schemes import get_scheme

    chosen = get_scheme(name)
    click.echo(f"# {chosen.title} ({chosen.status}): {chosen.source}")
    attitudes = to_attitude(angles_of(-chosen.directions))
    columns = ["x", "y", "z", *(f"{angle}_{attitude_unit()}" for angle in ("roll", "pitch"))]
    click.echo(
        pd.DataFrame(np.hstack([chosen.directions, attitudes]), columns=columns).to_csv(
            index_label="position", float_format="%.6f"
        ),
        nl=False,
    )


@main.command(epilog=example("accelstudy models"))
def models() -> None:
    """List sensor models, and the presets of Table 1.

    Commands take compositions, too: models and effects joined by +, as in
    bias-scale+warm_up(tau=300).
    """
    from accelstudy.sensors.models import MODELS, PRESETS, get_model

    for name in MODELS:
        model = get_model(name)
        click.echo(f"{name} ({model.n_parameters}): {', '.join(model.parameter_names)}")
    click.echo("\nTable 1:")
    for preset in PRESETS:
        click.echo(f"  {preset.source:28s} {preset.model} in {preset.scheme}")


@main.command(epilog=example("accelstudy effects", "accelstudy effects --campaign my-campaign"))
@click.option("--campaign", type=PATH, help="Folder of a campaign.")
@click.option("--scheme", type=SCHEME, help="Name of a scheme, instead of a campaign.")
@model_option
@approach_option(None)
@angle_unit_option
@quiet_option
def effects(campaign: Path | None, scheme: str | None, model: str, approach: str | None) -> None:
    """List all effects, or what a campaign can show of them.

    Models are composed of effects; parameters are in the units shown, settings in SI. With a
    campaign or a scheme: which effects it can show beside the model, how large they must be to be
    detected and to be named, and with what they would be confused.
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
    from accelstudy.campaign.files.format import read_campaign
    from accelstudy.diagnosis.worth import visibility
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


@main.command(epilog=example("accelstudy cells config/config.yaml config/sweeps/positions.yaml"))
@click.argument("configs", nargs=-1, required=True, type=PATH)
def cells(configs: tuple[Path, ...]) -> None:
    """List the cells of a study and what it will take.

    Cells that cannot be estimated are listed with the reason. CONFIGS are YAML files; later ones
    overlay earlier ones, as with --configfile.
    """
    from accelstudy.design.estimability import estimability
    from accelstudy.study.cells.cell import study_cells
    from accelstudy.study.cells.effort import study_effort
    from accelstudy.study.config import read_study

    study = read_study(*configs)
    chosen = study_cells(study)
    effort = study_effort(study, chosen)
    for cell in chosen:
        found = estimability(
            cell.positions, cell.estimated_model, cell.conditions, cell.noise, hold=cell.hold
        )
        state = found.reason or f"r = {found.redundancy}, {cell.replicates} replicates"
        click.echo(f"{cell.name}: {state}")
    click.echo(f"\n{effort}")


@main.command(epilog=example("accelstudy config-schema"))
def config_schema() -> None:
    """Print the JSON schema of configurations.

    It is kept in workflow/schemas/config.schema.json.
    """
    from accelstudy.study.config import config_schema as schema

    click.echo(json.dumps(schema(), indent=2, ensure_ascii=False))


@main.command(epilog=example("accelstudy claims results/paper"))
@click.argument("results", type=PATH)
def claims(results: Path) -> None:
    """Print the verdicts on the paper's claims as Markdown.

    RESULTS is the folder of a study, such as results/paper.
    """
    from accelstudy.files.tables import read_table
    from accelstudy.study.claims.page import claims_markdown

    click.echo(claims_markdown(read_table(results / "claims.parquet")), nl=False)


for command in (
    import_command,
    public_command,
    simulate_campaign_command,
    diagnose_command,
    advise_command,
    pole_command,
    design_command,
    plan_command,
    data_sheet_command,
    *COMMANDS,
):
    main.add_command(command)
