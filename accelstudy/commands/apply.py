"""The command that applies a calibration to a log."""

from __future__ import annotations

from pathlib import Path

import click

from accelstudy.basics.progress import warn
from accelstudy.commands.options import PATH, angle_unit_option, example, force_option, quiet_option


@click.command(
    "apply",
    epilog=example(
        "accelstudy apply calibrated/calibration.json calibration.csv --out leveled.csv"
    ),
)
@click.argument("calibration", type=PATH)
@click.argument("log", type=PATH)
@click.option("--out", type=PATH, required=True, help="CSV or Parquet file to write.")
@click.option(
    "--columns", help="By name, or place from 0: fx=1,fy=2,fz=3,temperature=temp,vibration=5."
)
@click.option("--time", help="Column of the time, by name or number.")
@click.option("--time-unit", help="Unit of the time: s, ms, us or ns.")
@click.option("--rate", type=float, help="Samples per second, where there is no time.")
@click.option("--delimiter", help="Between the columns of a text: ; or tab or blank.")
@click.option("--variable", help="Array of a MATLAB file, topic of a bag or instance of a ULog.")
@click.option("--unit", help="Unit of the readings: m/s^2, g, mg or counts.")
@click.option(
    "--start",
    type=click.FloatRange(min=0),
    help="Seconds from the start of the calibration session to the first row.  [default: 0]",
)
@click.option(
    "--sigma",
    type=click.FloatRange(min=0),
    help="Sd of a reading, m/s².  [default: as within the holds of the campaign]",
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
    the campaign was; options say what is different. The output has its columns, and beside them
    the calibrated force, roll and pitch with their sigmas, in the axes of the LOG. A row that
    cannot be corrected stays empty. Where the x axis is so near the vertical that the sigmas of
    roll and pitch do not hold, near_pole is true.

    Some effects depend on the time since the calibration session began. The first row is taken for
    that moment. This is right for the log of the session itself, and for a warm-up if the log
    begins when the sensor is switched on. For a log that begins later give --start. A drift is
    known in its session only; later rows are corrected by what it was at the end. Hysteresis and
    settling depend on the position before, which a log does not tell; they are not corrected.
    """
    from accelstudy.campaign.calibration.applying import read_calibration
    from accelstudy.campaign.calibration.leveling import level_log
    from accelstudy.commands.importing import parse_columns
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
    click.echo(f"{leveled.rows - leveled.empty} of {leveled.rows} rows leveled: {out}")
