"""The command that makes a campaign of a raw log."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from accelstudy.basics.progress import say, warn
from accelstudy.basics.wording import counted
from accelstudy.commands.options import (
    PATH,
    Sectioned,
    angle_unit_option,
    example,
    force_option,
    quiet_option,
)

if TYPE_CHECKING:
    from accelstudy.campaign.importing.logs import ImportReport
    from accelstudy.campaign.session import Campaign


_SECTIONS = {
    "The log": ("columns", "sensor", "time", "time_unit", "rate"),
    "Its numbers": ("unit", "scale", "offset", "full_range", "frame"),
    "The holds": ("threshold", "exclude", "join", "figure"),
    "A table of means instead": ("means", "robot_sigma", "robot_unit"),
    "The campaign": ("out", "name", "gravity", "settings_path"),
}


@click.command(
    "import",
    cls=Sectioned,
    sections=_SECTIONS,
    epilog=example(
        "accelstudy import log.csv --out my-campaign --rate 100 --columns fx=0,fy=1,fz=2"
    ),
)
@click.argument("log", type=PATH, nargs=-1, required=True)
@click.option("--columns", help="Columns by name, or by number from 0: fx=1,fy=2,fz=3.")
@click.option("--sensor", multiple=True, help="Columns of one of several sensors: NAME=ax,ay,az.")
@click.option("--time", help="Column of the time, by name or number.")
@click.option("--time-unit", help="Unit of the time: s, ms, us or ns.  [default: s]")
@click.option("--rate", type=float, help="Samples per second, where there is no time.")
@click.option("--unit", help="Unit of the readings: m/s^2, g or counts.  [default: m/s^2]")
@click.option("--scale", help="For counts: m/s² per count, one number or three.")
@click.option("--offset", help="For counts: reading at 0 m/s².  [default: from the holds]")
@click.option("--range", "full_range", help="Measuring range, ±: 78.5 (m/s²), 8g or 32767counts.")
@click.option("--frame", help="Where x, y, z point: frd, flu (ROS), rfu …  [default: frd]")
@click.option("--threshold", type=float, help="Largest sd at rest, m/s².  [default: from the log]")
@click.option(
    "--exclude", multiple=True, help="What to leave out, and why: 13:moved, 120s-135s:moved."
)
@click.option("--join", multiple=True, help="Holds that are one: 4,5 or 120s-135s.")
@click.option("--figure/--no-figure", default=True, help="Draw the log with its holds.")
@click.option("--means", is_flag=True, help="LOG is a table with the mean of each hold.")
@click.option("--robot-sigma", type=float, help="Sd of the robot's roll and pitch, mgon.")
@click.option("--robot-unit", help="Unit of the robot's angles: gon, deg, rad.  [default: gon]")
@click.option("--out", type=PATH, required=True, help="Folder of the campaign.")
@click.option("--name", help="Name of the campaign.  [default: that of the file]")
@click.option("--gravity", type=float, help="Local gravity, m/s².  [default: 9.80665]")
@click.option(
    "--settings", "settings_path", type=PATH, help="YAML file with settings; options go before it."
)
@force_option
@angle_unit_option
@quiet_option
def import_command(
    log: tuple[Path, ...],
    out: Path,
    settings_path: Path | None,
    means: bool,
    figure: bool,
    force: bool,
    **options: Any,
) -> None:
    """Make a campaign of a raw LOG: find its static holds.

    LOG is text (CSV or columns, perhaps .gz), MATLAB or Parquet. Of several files, a folder or a
    pattern, each file is one position. The noise of the log itself tells what is at rest, unless
    --threshold does. segmentation.png in the folder shows the holds with their numbers.

    --sensor, --exclude and --join may be repeated. With --sensor each sensor has a campaign of its
    own in the folder, which is named after the log and the sensor.
    """
    from accelstudy.campaign.importing.logs import import_each
    from accelstudy.commands.import_options import files_of, settings_of
    from accelstudy.files.outputs import CAMPAIGN, result_folder

    settings = settings_of(settings_path, means=means or None, **options)
    files = files_of(log)
    folders = {name: out / name for name in settings.sensors} or {"": out}
    inputs = [*files, *([] if settings_path is None else [settings_path])]
    with ExitStack() as stack:
        campaigns = {
            name: stack.enter_context(result_folder(folder, CAMPAIGN, inputs, force))
            for name, folder in folders.items()
        }
        imported = import_each(campaigns, files, settings, figure)
    for name, result in imported.items():
        if name:
            say(f"sensor {name}")
        show_result(*result, folders[name], figure)


def show_result(campaign: Campaign, report: ImportReport, out: Path, figure: bool = True) -> None:
    """Tell what was imported, with its warnings, and where to."""
    for line in report.lines():
        say(line)
    for warning in report.warnings:
        warn(warning)
    if figure and report.holds is not None:
        say(f"figure: {out / 'segmentation.png'}")
    click.echo(f"campaign: {out} ({counted(campaign.n_positions, 'position')})")
