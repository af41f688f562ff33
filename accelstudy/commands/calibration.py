"""Commands for measured data: calibrate a campaign, use the calibration, check its sigmas."""

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
    quiet_option,
    seed_option,
)


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
    from accelstudy.basics.units import display_unit, to_display
    from accelstudy.campaign.calibration.fit import fit_campaign
    from accelstudy.campaign.calibration.output import write_calibration
    from accelstudy.campaign.calibration.verdict import next_steps
    from accelstudy.campaign.files.format import read_campaign
    from accelstudy.files.outputs import CALIBRATION, result_folder
    from accelstudy.sensors.models import get_model

    chosen = get_model(model), get_approach(approach)
    with result_folder(out, CALIBRATION, [campaign], force) as folder, stage("calibration"):
        measured = read_campaign(campaign)
        fit = fit_campaign(measured, *chosen)
        content = write_calibration(fit, folder, campaign)
    for warning in measured.warnings:
        warn(warning)
    for entry in content["parameters"]:
        unit = entry["unit"]
        known = entry["sigma"] is not None
        sigma = f"{to_display(entry['sigma'], unit):.4f}" if known else "unknown"
        value = f"{to_display(entry['value'], unit):12.4f}"
        say(f"{entry['name']:>9} = {value} ± {sigma} {display_unit(unit)}")
    quality = content["quality"]
    say(f"{quality['state'].upper()}: {quality['verdict']}")
    what, command = next_steps(fit, quality["state"], campaign, out / "calibration.json")[0]
    say(f"{what}: {command}")
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
@seed_option
@angle_unit_option
@quiet_option
def check_sigmas_command(
    campaign: Path, model: str, approach: str, replicates: int, seed: int
) -> None:
    """Check the sigmas of a calibration by simulation.

    CAMPAIGN is the folder of the campaign that is calibrated.
    """
    from accelstudy.approaches import get_approach
    from accelstudy.campaign.calibration.fit import fit_campaign
    from accelstudy.campaign.calibration.sigma_check import check_sigmas
    from accelstudy.campaign.files.format import read_campaign
    from accelstudy.sensors.models import get_model

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
    "--columns", help="By name, or place from 0: fx=1,fy=2,fz=3,temperature=temp,vibration=5."
)
@click.option("--time", help="Column of time, by name or place.")
@click.option("--time-unit", help="One of s, ms, us and ns.")
@click.option("--rate", type=float, help="Samples per second, without a column of time.")
@click.option("--unit", help="One of m/s^2, g and counts.")
@click.option(
    "--start",
    type=click.FloatRange(min=0),
    help="Seconds from the start of the calibration session to the first row.  [default: 0]",
)
@click.option(
    "--sigma",
    type=click.FloatRange(min=0),
    help="Noise of a reading, m/s².  [default: that within the holds of the campaign]",
)
@force_option
@angle_unit_option
@quiet_option
def apply_command(
    calibration: Path,
    log: Path,
    out: Path,
    columns: str | None,
    rate: float | None,
    start: float | None,
    sigma: float | None,
    force: bool,
    **options: str | None,
) -> None:
    """Apply a CALIBRATION to a LOG and level with it.

    CALIBRATION is a calibration.json, LOG any file that `import` reads. It is read as the log of
    the campaign was; options say what is different in it. Its columns are written, and beside them
    the calibrated force, roll and pitch, with their sigmas, in the axes of the LOG. A row that
    cannot be corrected is left empty.

    Effects that depend on time count it from the start of the calibration session, and the first
    row is taken for that: right for the log of the session, and for a warm-up wherever the sensor
    is switched on as the log starts. For a log that starts later give --start. A drift is known in
    its session only: later rows are corrected by what it was at the end. Hysteresis and settling
    depend on the position before, which a log does not tell, and are not corrected.
    """
    from accelstudy.campaign.use.applying import read_calibration
    from accelstudy.campaign.use.leveling import level_log
    from accelstudy.commands.import_options import parse_columns
    from accelstudy.files.outputs import new_file

    layout = {
        **options,
        "columns": None if columns is None else parse_columns(columns),
        "rate_hz": rate,
    }
    given = {key: value for key, value in layout.items() if value is not None}
    with new_file(out, [calibration, log], force) as path:
        leveled = level_log(read_calibration(calibration), log, path, given, sigma, start)
    for warning in leveled.warnings:
        warn(warning)
    say(f"{leveled.rows - leveled.empty} of {leveled.rows} rows leveled: {out}")


@click.command("export", epilog=example("accelstudy export calibrated/calibration.json --form c"))
@click.argument("calibration", type=PATH)
@click.option("--form", default="json", show_default=True, help="One of json, yaml, c and matrix.")
def export_command(calibration: Path, form: str) -> None:
    """Print a CALIBRATION in a form that a device takes.

    CALIBRATION is a calibration.json. json and yaml carry every effect: parameters with sigmas and
    units, and the formulas to implement. c and matrix hold M in force = M · (x, y, z, 1), readings
    and forces in the axes of the log; they carry bias, scale, non-orthogonality and whatever else
    is linear in the force, and no effect that is not, or that depends on time, temperature,
    vibration or the position before.
    """
    from accelstudy.campaign.use.applying import read_calibration
    from accelstudy.campaign.use.export import export

    content = read_calibration(calibration).content
    text = export(content, form)
    if mended := content["mended"]:
        warn(f"the calibration is of mended data: {mended['reason']}")
    click.echo(text, nl=False)


COMMANDS = (calibrate_command, check_sigmas_command, apply_command, export_command)
