"""The command that checks the sigmas of a calibration by simulation."""

from __future__ import annotations

from pathlib import Path

import click

from accelstudy.basics.progress import say
from accelstudy.commands.options import (
    PATH,
    angle_unit_option,
    approach_option,
    example,
    model_option,
    quiet_option,
    seed_option,
)


@click.command(
    "check-sigmas", epilog=example("accelstudy check-sigmas my-campaign --replicates 500")
)
@click.argument("campaign", type=PATH)
@model_option
@approach_option(None)
@click.option(
    "--replicates",
    default=2000,
    show_default=True,
    type=click.IntRange(min=2),
    help="Simulated campaigns.",
)
@seed_option
@angle_unit_option
@quiet_option
def check_sigmas_command(
    campaign: Path, model: str, approach: str | None, replicates: int, seed: int
) -> None:
    """Check the sigmas of a calibration by simulation.

    CAMPAIGN is the folder of the campaign that is calibrated. It is simulated with the noise that
    its sigmas are from. So the check finds whether the adjustment turns that noise into the right
    sigmas, and not whether the noise is right.
    """
    from accelstudy.api.calibrations import resolve
    from accelstudy.campaign.calibration.fit import fit_campaign
    from accelstudy.campaign.calibration.sigma_check import check_sigmas, what_it_finds

    fit = fit_campaign(*resolve(campaign, model, approach))
    table = check_sigmas(fit, replicates, seed)
    click.echo(table.to_string(index=False, float_format=lambda value: f"{value:.4g}"))
    say("sigma: as the adjustment claims it; ratio: sigma / sd_empirical.")
    click.echo(what_it_finds(fit))
