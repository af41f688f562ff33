"""The command that calibrates a campaign."""

from __future__ import annotations

from pathlib import Path

import click

from accelstudy.basics.progress import say, stage, warn
from accelstudy.commands.options import (
    PATH,
    angle_unit_option,
    approach_option,
    example,
    force_option,
    model_option,
    prior_option,
    quiet_option,
)


@click.command("calibrate", epilog=example("accelstudy calibrate my-campaign --out calibrated"))
@click.argument("campaign", type=PATH)
@click.option("--out", type=PATH, required=True, help="Folder to write to.")
@model_option
@approach_option(None)
@prior_option
@force_option
@angle_unit_option
@quiet_option
def calibrate_command(
    campaign: Path, model: str, approach: str | None, prior: Path | None, out: Path, force: bool
) -> None:
    """Calibrate a CAMPAIGN (a folder) and report on it.

    The folder of results gets report.html for you, calibration.json for `apply`, `export` and
    programs, positions.parquet and figures. Parameters are in the axes frd (forward, right, down),
    whatever those of the log are.
    """
    from accelstudy.approaches import get_approach
    from accelstudy.basics.units import display_unit
    from accelstudy.basics.wording import estimate
    from accelstudy.campaign.calibration.fit import fit_campaign
    from accelstudy.campaign.calibration.output import write_calibration
    from accelstudy.campaign.calibration.wording import approach_words, interval_words, next_steps
    from accelstudy.campaign.format import read_campaign
    from accelstudy.campaign.of_type import with_type
    from accelstudy.files.outputs import CALIBRATION, result_folder
    from accelstudy.sensors.frames import axes_note
    from accelstudy.sensors.models import get_model

    chosen = get_model(model), None if approach is None else get_approach(approach)
    inputs = [campaign] if prior is None else [campaign, prior]
    with result_folder(out, CALIBRATION, inputs, force) as folder, stage("calibration"):
        measured = with_type(read_campaign(campaign), prior, chosen[0])
        fit = fit_campaign(measured, *chosen)
        content = write_calibration(fit, folder, campaign, out)
    for warning in measured.warnings:
        warn(warning)
    for entry in content["parameters"]:
        value, sigma = estimate(entry["value"], entry["sigma"], entry["unit"])
        say(f"{entry['name']:>9} = {value:>12} ± {sigma} {display_unit(entry['unit'])}")
    if content["sigmas_95"] is not None:
        say(f"±: {interval_words(fit)}")
    quality = content["quality"]
    say(approach_words(fit))
    say(axes_note(None if measured.log is None else measured.log.frame))
    click.echo(f"{quality['state'].upper()}: {quality['verdict']}")
    what, command = next_steps(fit, quality["state"], campaign, out / "calibration.json")[0]
    say(f"{what}: {command}")
    say(f"report: {out / 'report.html'}")
