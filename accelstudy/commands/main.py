"""The command line: all commands, in sections.

The study itself is run by Snakemake.
"""

from __future__ import annotations

from typing import Any

import click

from accelstudy.basics.errors import BY_COMMAND, InputError
from accelstudy.basics.units import ANGLE_UNIT_VARIABLE, angles_in
from accelstudy.commands.advise import advise_command
from accelstudy.commands.apply import apply_command
from accelstudy.commands.cells import cells_command
from accelstudy.commands.claims import claims_command
from accelstudy.commands.config_schema import config_schema_command
from accelstudy.commands.data_sheet import data_sheet_command
from accelstudy.commands.design import design_command
from accelstudy.commands.effects import effects_command
from accelstudy.commands.ending import bad_input_as_one_line, interruptible
from accelstudy.commands.importing import import_command
from accelstudy.commands.init import init_command
from accelstudy.commands.models import models_command
from accelstudy.commands.options import ANGLE_UNIT, plugin_option
from accelstudy.commands.public import public_command
from accelstudy.commands.scheme import scheme_command
from accelstudy.commands.schemes import schemes_command
from accelstudy.commands.simulate_campaign import simulate_campaign_command
from accelstudy.commands.verbs import (
    CALIBRATE,
    CHECK_SIGMAS,
    COMPARE,
    DIAGNOSE,
    EXPORT,
    HISTORY,
    LOT,
    PLAN,
)

SECTIONS: dict[str, tuple[click.Command, ...]] = {
    "Campaigns, measured or simulated": (
        import_command,
        public_command,
        simulate_campaign_command,
        advise_command,
        CALIBRATE,
        DIAGNOSE,
        LOT,
        CHECK_SIGMAS,
        apply_command,
        EXPORT,
        COMPARE,
        HISTORY,
    ),
    "Before a calibration, and what it is worth": (
        PLAN,
        data_sheet_command,
    ),
    "What there is to choose from": (
        models_command,
        effects_command,
        schemes_command,
        scheme_command,
        design_command,
    ),
    "Studies": (
        init_command,
        cells_command,
        claims_command,
        config_schema_command,
    ),
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
            with formatter.section(title):
                formatter.write_dl(
                    [
                        (str(command.name).ljust(width), command.get_short_help_str(74 - width))
                        for command in commands
                    ]
                )

    def main(self, *args: Any, **kwargs: Any) -> Any:
        """Run the command line; also its help may meet a full disk."""
        token = BY_COMMAND.set(True)
        try:
            with bad_input_as_one_line():
                return super().main(*args, **kwargs)
        finally:
            BY_COMMAND.reset(token)

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Find the command that is called; one of an earlier version says what to do instead."""
        if args[0] in RETIRED:
            raise InputError(f"{args[0]}: no longer a command; {RETIRED[args[0]]}")
        return super().resolve_command(ctx, args)

    def invoke(self, ctx: click.Context) -> object:
        """Run the chosen command."""
        from accelstudy.basics.plugins import at_work  # which help does without

        with interruptible(), at_work():
            return super().invoke(ctx)


@click.group(cls=Commands, commands=[each for commands in SECTIONS.values() for each in commands])
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
@plugin_option()
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


# After the command's name it is taken, too, without a line in the help of each.
for command in main.commands.values():
    plugin_option(hidden=True)(command)
