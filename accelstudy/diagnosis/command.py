"""The command that diagnoses a campaign."""

from __future__ import annotations

from pathlib import Path

import click

from accelstudy.options import force_option

_PATH = click.Path(path_type=Path)


@click.command("diagnose")
@click.argument("campaign", type=_PATH)
@click.option("--out", type=_PATH, required=True, help="Folder to write to.")
@click.option("--model", default="bias-scale-nonorthogonality", show_default=True)
@click.option("--approach", help="gravity or robot.  [default: robot if the campaign has one]")
@click.option("--seed", default=1, show_default=True, type=click.IntRange(min=0))
@click.option(
    "--replicates",
    default=1000,
    show_default=True,
    type=click.IntRange(min=100),
    help="Sessions simulated with the old and with the new model.",
)
@force_option
def diagnose_command(
    campaign: Path,
    out: Path,
    model: str,
    approach: str | None,
    seed: int,
    replicates: int,
    force: bool,
) -> None:
    """Find what a sensor model lacks to explain a measured CAMPAIGN (a folder).

    Tells missing effects, wrong noise and gross errors apart, adds what is missing to the model and
    tests it on positions that were not used.
    """
    from accelstudy.diagnosis.output import diagnose_folder
    from accelstudy.diagnosis.wording import verdict_lines

    diagnosis = diagnose_folder(campaign, out, model, approach, seed, replicates, force)
    for warning in diagnosis.campaign.warnings:
        click.echo(f"warning: {warning}", err=True)
    for line in verdict_lines(diagnosis):
        click.echo(line)
    click.echo(f"report: {out / 'report.html'}")
