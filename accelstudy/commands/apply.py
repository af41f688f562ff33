"""The command that applies a calibration to a log."""

from __future__ import annotations

from pathlib import Path

import click

from accelstudy.basics.progress import say, warn
from accelstudy.commands.options import PATH, angle_unit_option, example, force_option, quiet_option


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
