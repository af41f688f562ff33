"""Commands for measured data: calibrate a campaign, use the calibration, check its sigmas."""

from __future__ import annotations

from pathlib import Path

import click

from accelstudy.options import force_option

PATH = click.Path(path_type=Path)


@click.command("calibrate")
@click.argument("campaign", type=PATH)
@click.option("--model", default="bias-scale-nonorthogonality", show_default=True)
@click.option("--approach", default="gravity", show_default=True)
@click.option("--out", type=PATH, required=True, help="folder to write to")
@force_option
def calibrate_command(campaign: Path, model: str, approach: str, out: Path, force: bool) -> None:
    """Calibrate a measured CAMPAIGN (a folder) and report on it."""
    from accelstudy.approaches import get_approach
    from accelstudy.campaign.fit import fit_campaign
    from accelstudy.campaign.format import read_campaign
    from accelstudy.campaign.output import write_calibration
    from accelstudy.models import get_model
    from accelstudy.outputs import CALIBRATION, result_folder

    chosen = get_model(model), get_approach(approach)
    with result_folder(out, CALIBRATION, [campaign], force) as folder:
        measured = read_campaign(campaign)
        content = write_calibration(fit_campaign(measured, *chosen), folder)
    for warning in measured.warnings:
        click.echo(f"warning: {warning}", err=True)
    for entry in content["parameters"]:
        shown = entry["shown"]
        sigma = "unknown" if shown["sigma"] is None else f"{shown['sigma']:.4f}"
        click.echo(f"{entry['name']:>9} = {shown['value']:12.4f} ± {sigma} {shown['unit']}")
    click.echo(content["quality"]["verdict"])
    click.echo(f"report: {out / 'report.html'}")


@click.command("check-sigmas")
@click.argument("campaign", type=PATH)
@click.option("--model", default="bias-scale-nonorthogonality", show_default=True)
@click.option("--approach", default="gravity", show_default=True)
@click.option("--replicates", default=2000, show_default=True, type=click.IntRange(min=2))
@click.option("--seed", default=1, show_default=True, type=click.IntRange(min=0))
def check_sigmas_command(
    campaign: Path, model: str, approach: str, replicates: int, seed: int
) -> None:
    """Check by simulation the sigmas that the calibration of a CAMPAIGN claims."""
    from accelstudy.approaches import get_approach
    from accelstudy.campaign.fit import fit_campaign
    from accelstudy.campaign.format import read_campaign
    from accelstudy.campaign.monte_carlo import check_sigmas
    from accelstudy.models import get_model

    fit = fit_campaign(read_campaign(campaign), get_model(model), get_approach(approach))
    table = check_sigmas(fit, replicates, seed)
    click.echo(table.to_string(index=False, float_format=lambda value: f"{value:.4g}"))
    click.echo("sigma: as the adjustment claims it; ratio: sigma / sd_empirical.")


@click.command("apply")
@click.argument("calibration", type=PATH)
@click.argument("log", type=PATH)
@click.option("--out", type=PATH, required=True, help="CSV or Parquet file to write")
@click.option("--columns", default="fx,fy,fz", show_default=True, help="names of the three columns")
@click.option("--sigma", type=float, help="noise of a reading, m/s²; that of a position by default")
@force_option
def apply_command(
    calibration: Path, log: Path, out: Path, columns: str, sigma: float | None, force: bool
) -> None:
    """Apply a CALIBRATION (calibration.json) to a LOG (CSV or Parquet) and level with it.

    The log is in the unit of the campaign. Adds the calibrated force, roll and pitch with sigmas.
    """
    from accelstudy.campaign.applying import read_calibration
    from accelstudy.campaign.log_leveling import level_log
    from accelstudy.outputs import new_file

    with new_file(out, [calibration, log], force) as path:
        level_log(read_calibration(calibration), log, path, columns.split(","), sigma)


@click.command("export")
@click.argument("calibration", type=PATH)
@click.option("--form", default="json", show_default=True, help="json, yaml, c or matrix")
def export_command(calibration: Path, form: str) -> None:
    """Print a CALIBRATION (calibration.json) in a form that a device or program takes."""
    from accelstudy.campaign.applying import read_calibration
    from accelstudy.campaign.export import export

    click.echo(export(read_calibration(calibration).content, form), nl=False)


COMMANDS = (calibrate_command, check_sigmas_command, apply_command, export_command)
