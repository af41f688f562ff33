"""The command that diagnoses a campaign."""

from __future__ import annotations

from pathlib import Path

import click

from accelstudy.basics.progress import say, warn
from accelstudy.commands.options import (
    PATH,
    angle_unit_option,
    approach_option,
    example,
    force_option,
    model_option,
    prior_option,
    quiet_option,
    seed_option,
)


@click.command("diagnose", epilog=example("accelstudy diagnose my-campaign --out diagnosed"))
@click.argument("campaign", type=PATH)
@click.option("--out", type=PATH, required=True, help="Folder to write to.")
@model_option
@approach_option(None)
@prior_option
@seed_option
@click.option(
    "--replicates",
    default=1000,
    show_default=True,
    type=click.IntRange(min=100),
    help="Sessions simulated with either model; fewer beyond 500 positions.",
)
@force_option
@angle_unit_option
@quiet_option
def diagnose_command(
    campaign: Path,
    out: Path,
    model: str,
    approach: str | None,
    prior: Path | None,
    seed: int,
    replicates: int,
    force: bool,
) -> None:
    """Find what a sensor model lacks to explain a CAMPAIGN.

    CAMPAIGN is a folder. The command tells missing effects, wrong noise and gross errors apart. It
    adds what is missing to the model, and tests it on positions that were not used.
    """
    from accelstudy.diagnosis.report.output import diagnose_folder
    from accelstudy.diagnosis.report.words import verdict_lines
    from accelstudy.sensors.frames import FRD, axes_note

    diagnosis = diagnose_folder(campaign, out, model, approach, seed, replicates, force, prior)
    for warning in diagnosis.campaign.warnings:
        warn(warning)
    if diagnosis.recognised is not None:
        warn(f"calibration.json is of mended data: {diagnosis.recognised.reason}")
    verdict, *lines = verdict_lines(diagnosis)
    click.echo(verdict)
    for line in lines:
        say(line)
    if (log := diagnosis.campaign.log) is not None and log.frame != FRD.name:
        say(axes_note(log.frame))
    say(f"report: {out / 'report.html'}")
