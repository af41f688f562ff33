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
    from accelstudy.api.calibrations import resolve
    from accelstudy.campaign.calibration.fit import fit_campaign
    from accelstudy.campaign.calibration.output import write_calibration
    from accelstudy.campaign.calibration.wording import (
        approach_words,
        interval_words,
        next_steps,
        parameter_lines,
    )
    from accelstudy.files.outputs import CALIBRATION, result_folder
    from accelstudy.sensors.frames import axes_note

    inputs = [campaign] if prior is None else [campaign, prior]
    with result_folder(out, CALIBRATION, inputs, force) as folder, stage("calibration"):
        fit = fit_campaign(*resolve(campaign, model, approach, prior))
        content = write_calibration(fit, folder, campaign, out)
    for warning in fit.campaign.warnings:
        warn(warning)
    for line in parameter_lines(content):
        say(line)
    if content["sigmas_95"] is not None:
        say(f"±: {interval_words(fit)}")
    quality = content["quality"]
    say(approach_words(fit))
    say(axes_note(None if fit.campaign.log is None else fit.campaign.log.frame))
    click.echo(f"{quality['state'].upper()}: {quality['verdict']}")
    what, command = next_steps(fit, quality["state"], campaign, out / "calibration.json")[0]
    say(f"{what}: {command}")
    say(f"report: {out / 'report.html'}")
