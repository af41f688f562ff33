"""The command line: all commands, in sections, and what is of the terminal alone.

The study itself is run by Snakemake.
"""

from __future__ import annotations

from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import Any

import click

from accelstudy.basics.errors import OPTIONS, InputError
from accelstudy.commands.bridge import ANGLE_UNIT, PLUGIN, Command
from accelstudy.commands.ending import bad_input_as_one_line, interruptible
from accelstudy.files import outputs
from accelstudy.files.outputs import new_file
from accelstudy.verbs import calibrations, campaigns, planning, retired, sensors, studies
from accelstudy.verbs.kinds import PATH


def simulate_campaign(
    out: Path, truth: Path | None, force: bool, name: str | None, **keywords: Any
) -> None:
    """Write a simulated campaign and, apart from it, the truth."""
    from accelstudy.campaign.format import write_campaign

    # The truth enters first and is moved last: it may be meant for a folder that is made here.
    with (
        nullcontext() if truth is None else new_file(truth, force=force) as truth_file,
        outputs.CAMPAIGN.place(out, force=force) as folder,
    ):
        campaign = campaigns.simulate_campaign(name=name or out.resolve().name, **keywords)
        write_campaign(campaign, folder)
        if truth_file is not None:
            outputs.write_yaml(truth_file, campaign.truth)
    click.echo(f"campaign: {out} ({campaign.n_positions} positions)")


def new_table(path: Path, *how: Any) -> AbstractContextManager[Path]:
    """Return the place of a table, which is no spreadsheet; see `new_file`."""
    if path.suffix.lower() in (".xlsx", ".xls", ".ods"):
        raise InputError(f"{path}: a spreadsheet is not written; let it end in .csv or .parquet")
    return new_file(path, *how)


SECTIONS = {
    "Campaigns, measured or simulated": [
        Command(
            campaigns.find_holds,
            "import",
            make="accelstudy.campaign.log_import:LogImport.of",
            writes=outputs.CAMPAIGN.place,
            options=[
                click.Option(
                    ["--figure/--no-figure"], default=True, help="Draw the log with its holds."
                )
            ],
            sections={
                "The log": "columns time time_unit rate variable",
                "Its numbers": "unit scale offset range frame",
                "The holds": "threshold window trim shortest exclude figure",
                "A log of blocks instead": "block",
                "A table of means instead": "means robot_sigma robot_unit",
                "A calibrated sensor beside it": "reference_log reference reference_columns "
                "reference_offset",
                "The campaign": "out name gravity settings",
            },
        ),
        Command(
            campaigns.public,
            make="accelstudy.campaign.log_import:LogImport.of_public",
            writes=outputs.CAMPAIGN.place,
        ),
        Command(
            campaigns.simulate_campaign,
            run=simulate_campaign,
            writes=outputs.CAMPAIGN.place,
            options=[click.Option(["--truth"], type=PATH, help="YAML file for the truth.")],
            sections={
                "What is written": "out truth name seed",
                "The sensor": "model effects size noise_effects",
                "Its noise": "sigma sigma_known robot_sigma n_samples",
                "The holds": "scheme repeats repeat_first order approach yaw gravity",
                "Their conditions": "interval temperature temperature_order vibration",
            },
        ),
        Command(planning.advise),
        Command(calibrations.calibrate, writes=outputs.CALIBRATION.place),
        Command(calibrations.diagnose, writes=outputs.DIAGNOSIS.place),
        Command(sensors.batch, writes=outputs.BATCH.place),
        Command(sensors.lot, writes=outputs.LOT.place),
        Command(calibrations.check_sigmas),
        Command(
            calibrations.apply,
            make=calibrations.level_log,
            writes=new_table,
            out="CSV or Parquet file to write.",
        ),
        Command(calibrations.export),
        Command(sensors.compare, writes=outputs.HISTORY.place),
        Command(sensors.history, writes=outputs.HISTORY.place),
    ],
    "Before a calibration, and what it is worth": [
        Command(
            planning.plan,
            writes=outputs.PLAN.place,
            optional=True,
            sections={
                "What is asked": "tilt_accuracy tilt_range sensor sigma history equipment "
                "confidence",
                "What is tried": "holds max_time max_positions replicates seed",
                "What the equipment takes": "moving_time robot_moving_time robot_setup_time "
                "robot_sigma",
            },
        ),
        Command(planning.data_sheet, writes=new_file, out="YAML file to write."),
    ],
    "What there is to choose from": [
        Command(studies.catalogue),
        Command(studies.list_effects, "effects"),
        Command(studies.list_schemes, "schemes"),
        Command(studies.scheme),
        Command(
            planning.find_positions,
            "design",
            writes="accelstudy.planning.design:new_scheme",
            out="YAML file for the positions.",
            sections={
                "The calibration": "model approach positions sigma robot_sigma gravity_sigma",
                "What the positions are to be good for": "criterion tilt_range after",
                "What the positions must keep to": "attitudes roll pitch pole_distance",
            },
        ),
    ],
    "Studies": [
        Command(studies.init),
        Command(studies.cells),
        Command(studies.claims),
        Command(studies.config_schema),
    ],
}
"""Commands in the order of use."""


class Commands(click.Group):
    """Commands in sections, that end bad input with one line and exit status 2."""

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

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Read what stands before a command, of which earlier versions took more."""
        try:
            return super().parse_args(ctx, args)
        except click.NoSuchOption as error:
            if error.option_name in (*PLUGIN.opts, *ANGLE_UNIT.opts):
                raise InputError(f"{error.option_name}: give it after the command") from None
            raise

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Find the command that is called; one of an earlier version says what to do instead."""
        if args[0] in retired.COMMANDS:
            raise InputError(f"{args[0]}: no longer a command; {retired.COMMANDS[args[0]]}")
        return super().resolve_command(ctx, args)

    def invoke(self, ctx: click.Context) -> object:
        """Run the chosen command."""
        with interruptible():
            return super().invoke(ctx)


@click.group(cls=Commands, commands=[c for commands in SECTIONS.values() for c in commands])
@click.version_option(package_name="accelstudy")
def main() -> None:
    """Calibrate tri-axial accelerometers for leveling, and study such calibrations.

    The commands plan a calibration, calibrate measured data, and judge the result; Snakemake runs
    studies by Monte Carlo simulation.

    Results go to standard output; warnings, errors and progress go to standard error. The exit
    status is 0 with any verdict, a rejected calibration included, 1 if `plan` finds nothing that
    reaches the accuracy, 2 if an input or an option is wrong, and 130 after Ctrl-C.
    """
