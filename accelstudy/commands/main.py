"""The command line: all commands, in sections.

The study itself is run by Snakemake.
"""

from __future__ import annotations

from typing import Any

import click

from accelstudy.basics.errors import OPTIONS, InputError
from accelstudy.basics.units import ANGLE_UNIT_VARIABLE, angles_in
from accelstudy.commands import campaigns, choices, studies, verbs
from accelstudy.commands.bridge import ANGLE_UNITS, PLUGIN
from accelstudy.commands.ending import bad_input_as_one_line, interruptible

SECTIONS = {
    "Campaigns, measured or simulated": [
        *(campaigns.IMPORT, campaigns.PUBLIC, campaigns.SIMULATE_CAMPAIGN, campaigns.ADVISE),
        *(verbs.CALIBRATE, verbs.DIAGNOSE, verbs.LOT, verbs.CHECK_SIGMAS, campaigns.APPLY),
        *(verbs.EXPORT, verbs.COMPARE, verbs.HISTORY),
    ],
    "Before a calibration, and what it is worth": [verbs.PLAN, campaigns.DATA_SHEET],
    "What there is to choose from": [
        *(choices.MODELS, choices.EFFECTS, choices.SCHEMES, choices.SCHEME, campaigns.DESIGN),
    ],
    "Studies": [studies.INIT, studies.CELLS, studies.CLAIMS, studies.CONFIG_SCHEMA],
}
"""Commands in the order of use."""
RETIRED = {
    "pole": "the tutorial 'The foot of a pole' (examples/pole) works it out with a calibration"
}
"""Commands of earlier versions, and what takes their place."""


class Commands(click.Group):
    """Commands in sections, that end bad input with one line and exit status 2."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Names of all commands, in the order of use."""
        return [str(command.name) for commands in SECTIONS.values() for command in commands]

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the sections of the help."""
        width = max(map(len, self.commands))
        for title, commands in SECTIONS.items():
            rows = [(str(c.name).ljust(width), c.get_short_help_str(74 - width)) for c in commands]
            with formatter.section(title):
                formatter.write_dl(rows)

    def main(self, *args: Any, **kwargs: Any) -> Any:
        """Run the command line; also its help may meet a full disk."""
        token = OPTIONS.set({})
        try:
            with bad_input_as_one_line():
                return super().main(*args, **kwargs)
        finally:
            OPTIONS.reset(token)

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Find the command that is called; one of an earlier version says what to do instead."""
        if args[0] in RETIRED:
            raise InputError(f"{args[0]}: no longer a command; {RETIRED[args[0]]}")
        return super().resolve_command(ctx, args)

    def invoke(self, ctx: click.Context) -> object:
        """Run the chosen command."""
        with interruptible():
            return super().invoke(ctx)


@click.group(cls=Commands, commands=[c for commands in SECTIONS.values() for c in commands])
@click.version_option(package_name="accelstudy")
@click.option(
    "--angle-unit",
    metavar="[gon|deg]",
    type=ANGLE_UNITS,
    default="gon",
    show_default=True,
    envvar=ANGLE_UNIT_VARIABLE,
    show_envvar=True,
    help="Unit in which commands, pages and figures show angles, gon or deg.",
)
@click.option("--plugin", **PLUGIN)
@click.pass_context
def main(ctx: click.Context, angle_unit: str) -> None:
    """Monte Carlo study of accelerometer calibration for leveling.

    Snakemake runs studies. These commands calibrate measured data, plan and judge calibrations, and
    list what studies are made of.

    Results go to standard output; warnings, errors and progress go to standard error. The exit
    status is 0 with any verdict, a rejected calibration included, 1 if `plan` finds nothing that
    reaches the accuracy or the command was broken off, and 2 if an input or an option is wrong.
    """
    ctx.with_resource(angles_in(angle_unit))
