"""Commands for measured data: calibrate a campaign, use the calibration, check its sigmas."""

from __future__ import annotations

from pathlib import Path

import click

from accelstudy.options import (
    PATH,
    angle_unit_option,
    approach_option,
    example,
    force_option,
    model_option,
    quiet_option,
)
from accelstudy.progress import say


@click.command("calibrate", epilog=example("accelstudy calibrate my-campaign --out calibrated"))
@click.argument("campaign", type=PATH)
@click.option("--out", type=PATH, required=True, help="Folder to write to.")
@model_option
@approach_option("gravity")
@force_option
@angle_unit_option
@quiet_option
def calibrate_command(campaign: Path, model: str, approach: str, out: Path, force: bool) -> None:
    """Calibrate a CAMPAIGN (a folder) and report on it."""
    from accelstudy.approaches import get_approach
    from accelstudy.campaign.fit import fit_campaign
    from accelstudy.campaign.format import read_campaign
    from accelstudy.campaign.output import write_calibration
    from accelstudy.models import get_model
    from accelstudy.outputs import CALIBRATION, result_folder
    from accelstudy.units import display_unit, to_display

    chosen = get_model(model), get_approach(approach)
    with result_folder(out, CALIBRATION, [campaign], force) as folder:
        measured = read_campaign(campaign)
        content = write_calibration(fit_campaign(measured, *chosen), folder)
    for warning in measured.warnings:
        click.echo(f"warning: {warning}", err=True)
    for entry in content["parameters"]:
        unit = entry["unit"]
        known = entry["sigma"] is not None
        sigma = f"{to_display(entry['sigma'], unit):.4f}" if known else "unknown"
        value = f"{to_display(entry['value'], unit):12.4f}"
        say(f"{entry['name']:>9} = {value} ± {sigma} {display_unit(unit)}")
    say(content["quality"]["verdict"])
    say(f"report: {out / 'report.html'}")


@click.command(
    "check-sigmas", epilog=example("accelstudy check-sigmas my-campaign --replicates 500")
)
@click.argument("campaign", type=PATH)
@model_option
@approach_option("gravity")
@click.option(
    "--replicates",
    default=2000,
    show_default=True,
    type=click.IntRange(min=2),
    help="Simulated campaigns.",
)
@click.option(
    "--seed",
    default=1,
    show_default=True,
    type=click.IntRange(min=0),
    help="Of all random numbers.",
)
@angle_unit_option
@quiet_option
def check_sigmas_command(
    campaign: Path, model: str, approach: str, replicates: int, seed: int
) -> None:
    """Check the sigmas of a calibration by simulation.

    CAMPAIGN is the folder of the campaign that is calibrated.
    """
    from accelstudy.approaches import get_approach
    from accelstudy.campaign.fit import fit_campaign
    from accelstudy.campaign.format import read_campaign
    from accelstudy.campaign.monte_carlo import check_sigmas
    from accelstudy.models import get_model

    fit = fit_campaign(read_campaign(campaign), get_model(model), get_approach(approach))
    table = check_sigmas(fit, replicates, seed)
    click.echo(table.to_string(index=False, float_format=lambda value: f"{value:.4g}"))
    say("sigma: as the adjustment claims it; ratio: sigma / sd_empirical.")


@click.command(
    "apply",
    epilog=example("accelstudy apply calibrated/calibration.json log.csv --out leveled.csv"),
)
@click.argument("calibration", type=PATH)
@click.argument("log", type=PATH)
@click.option("--out", type=PATH, required=True, help="CSV or Parquet file to write.")
@click.option(
    "--columns", default="fx,fy,fz", show_default=True, help="Names of the three columns."
)
@click.option(
    "--sigma", type=float, help="Noise of a reading, m/s².  [default: that of a position]"
)
@force_option
@angle_unit_option
@quiet_option
def apply_command(
    calibration: Path, log: Path, out: Path, columns: str, sigma: float | None, force: bool
) -> None:
    """Apply a CALIBRATION to a LOG and level with it.

    CALIBRATION is a calibration.json, LOG is CSV or Parquet in the unit of the campaign. Adds the
    calibrated force, roll and pitch with sigmas.
    """
    from accelstudy.campaign.applying import read_calibration
    from accelstudy.campaign.log_leveling import level_log
    from accelstudy.outputs import new_file

    with new_file(out, [calibration, log], force) as path:
        level_log(read_calibration(calibration), log, path, columns.split(","), sigma)


@click.command("export", epilog=example("accelstudy export calibrated/calibration.json --form c"))
@click.argument("calibration", type=PATH)
@click.option("--form", default="json", show_default=True, help="One of json, yaml, c and matrix.")
def export_command(calibration: Path, form: str) -> None:
    """Print a CALIBRATION in a form that a device takes.

    CALIBRATION is a calibration.json.
    """
    from accelstudy.campaign.applying import read_calibration
    from accelstudy.campaign.export import export

    click.echo(export(read_calibration(calibration).content, form), nl=False)


COMMANDS = (calibrate_command, check_sigmas_command, apply_command, export_command)
