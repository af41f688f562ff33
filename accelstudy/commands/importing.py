"""The command that makes a campaign of a raw log."""

from __future__ import annotations

import glob
import math
import re
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from accelstudy.basics.errors import InputError
from accelstudy.basics.names import natural
from accelstudy.basics.progress import say, warn
from accelstudy.basics.units import UNITS
from accelstudy.basics.wording import counted
from accelstudy.commands.options import (
    PATH,
    Sectioned,
    angle_unit_option,
    example,
    force_option,
    log_options,
    quiet_option,
)

if TYPE_CHECKING:
    from accelstudy.campaign.beside import Beside
    from accelstudy.campaign.importing.making import ImportReport
    from accelstudy.campaign.importing.settings import ImportSettings
    from accelstudy.campaign.session import Campaign

_RANGE = re.compile(r"\s*([0-9.eE+-]+)\s*(.*?)\s*")

_SECTIONS = {
    "The log": ("columns", "sensor", "time", "time_unit", "rate", "delimiter", "variable"),
    "Its numbers": ("unit", "scale", "offset", "full_range", "frame"),
    "The holds": ("threshold", "window", "shortest", "exclude", "join", "figure"),
    "A log of blocks instead": ("block",),
    "A table of means instead": ("means", "robot_sigma", "robot_unit"),
    "A calibrated sensor beside it": (
        "reference_log",
        "reference",
        "reference_columns",
        "reference_offset",
    ),
    "The campaign": ("out", "name", "gravity", "settings_path"),
}


@click.command(
    "import",
    cls=Sectioned,
    sections=_SECTIONS,
    epilog=example(
        "accelstudy import calibration.csv --out my-campaign",
        "accelstudy import log.csv --out by-number --rate 100 --columns fx=0,fy=1,fz=2",
        "accelstudy import calibration.csv --out beside "
        "--reference-log ref.csv --reference calibrated/calibration.json",
    ),
)
@click.argument("log", type=PATH, nargs=-1, required=True)
@log_options
@click.option("--sensor", multiple=True, help="Columns of one of several sensors: NAME=ax,ay,az.")
@click.option("--offset", help="For counts: reading at 0 m/s².  [default: from the holds]")
@click.option("--range", "full_range", help="Measuring range, ±: 78.5 (m/s²), 8g or 32767counts.")
@click.option("--frame", help="Where x, y, z point: frd, flu, rfu …  [default: frd; of ROS flu]")
@click.option("--threshold", type=float, help="Largest sd at rest, m/s².  [default: from the log]")
@click.option(
    "--window",
    type=float,
    help="Seconds over which rest is judged.  [default: 1; of a slow log 9 samples]",
)
@click.option("--shortest", type=float, help="Shortest hold, s, without its ends.  [default: 1]")
@click.option(
    "--exclude", multiple=True, help="What to leave out, and why: 13:moved, 120s-135s:moved."
)
@click.option("--join", multiple=True, help="Holds that are one: 4,5 or 120s-135s.")
@click.option("--figure/--no-figure", default=True, help="Draw the log with its holds.")
@click.option(
    "--block", type=int, help="Samples of each position, in a log without the moves between them."
)
@click.option("--means", is_flag=True, help="LOG is a table with the mean of each hold.")
@click.option("--robot-sigma", type=float, help="Sd of the robot's roll and pitch, mgon.")
@click.option("--robot-unit", help="Unit of the robot's angles: gon, deg, rad.  [default: gon]")
@click.option(
    "--reference-log", type=PATH, help="Raw log of a calibrated sensor on one plate with it."
)
@click.option("--reference", type=PATH, help="The calibration.json of that sensor.")
@click.option(
    "--reference-columns",
    help="Its columns: fx=a,fy=b,fz=c,time=t.  [default: as in the log of its calibration]",
)
@click.option(
    "--reference-offset",
    type=float,
    help="Seconds to add to its times.  [default: 0; without times both logs begin together]",
)
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
    reference_log: Path | None,
    reference: Path | None,
    reference_columns: str | None,
    reference_offset: float | None,
    **options: Any,
) -> None:
    """Make a campaign of a raw LOG: find its static holds.

    LOG is text (CSV or columns, perhaps .gz), MATLAB, Parquet, a bag of ROS 1 or 2 (extra ros) or
    a ULog of PX4 (extra px4). Of several files, a folder or a pattern, each file is one position.
    The noise of the log itself tells what is at rest, unless --threshold does. segmentation.png in
    the folder shows the holds with their numbers.

    --sensor, --exclude and --join may be repeated. With --sensor each sensor has a campaign of its
    own in the folder, which is named after the log and the sensor.

    With --reference-log and --reference a calibrated sensor on the same plate takes the place of a
    robot: it tells roll and pitch of each hold. Its times are of the same clock as those of LOG.
    """
    from accelstudy.campaign.importing.logs import import_each
    from accelstudy.files.outputs import CAMPAIGN, result_folder

    settings = settings_of(settings_path, means=means or None, **options)
    beside = _reference(reference_log, reference, reference_columns, reference_offset)
    files = files_of(log)
    folders = {name: out / name for name in settings.sensors} or {"": out}
    others = (settings_path, reference_log, reference)
    inputs = [*files, *(path for path in others if path is not None)]
    with ExitStack() as stack:
        campaigns = {
            name: stack.enter_context(result_folder(folder, CAMPAIGN, inputs, force))
            for name, folder in folders.items()
        }
        imported = import_each(campaigns, files, settings, figure, beside)
    for name, result in imported.items():
        if name:
            say(f"sensor {name}")
        show_result(*result, folders[name], figure)


def _reference(
    log: Path | None, calibration: Path | None, columns: str | None, offset: float | None
) -> Beside | None:
    """A reference, as the options say."""
    if log is None and calibration is None:
        given = {"--reference-columns": columns, "--reference-offset": offset}
        for option in (option for option, value in given.items() if value is not None):
            raise InputError(f"{option}: goes with --reference-log and --reference")
        return None
    if calibration is None:
        raise InputError("--reference-log: give the calibration.json of that sensor by --reference")
    if log is None:
        raise InputError("--reference: give the raw log of that sensor by --reference-log")
    if offset is not None and not math.isfinite(offset):
        raise InputError(f"--reference-offset: expected a number of seconds, not {offset}")
    from accelstudy.campaign.beside import Beside, ReferenceLog

    places = {} if columns is None else parse_columns(columns, "--reference-columns")
    return Beside.of(ReferenceLog(log, calibration, places, offset))


def show_result(campaign: Campaign, report: ImportReport, out: Path, figure: bool = True) -> None:
    """Tell what was imported, with its warnings, and where to."""
    for line in report.lines():
        say(line)
    for warning in report.warnings:
        warn(warning)
    if figure and report.holds is not None:
        say(f"figure: {out / 'segmentation.png'}")
    click.echo(f"campaign: {out} ({counted(campaign.n_positions, 'position')})")


def settings_of(
    path: Path | None,
    *,
    columns: str | None,
    sensor: Sequence[str],
    scale: str | None,
    offset: str | None,
    full_range: str | None,
    rate: float | None,
    gravity: float | None,
    threshold: float | None,
    window: float | None,
    shortest: float | None,
    robot_sigma: float | None,
    robot_unit: str | None,
    exclude: Sequence[str],
    join: Sequence[str],
    **others: Any,
) -> ImportSettings:
    """Settings from a YAML file, overlaid with the options that were given.

    Raises
    ------
    InputError
        If an option or a key is wrong.
    """
    from accelstudy.campaign.importing.settings import parse_settings, read_settings

    robot = {"angle_sigma_mgon": robot_sigma, "unit": robot_unit}
    content: dict[str, Any] = {
        **others,
        "columns": None if columns is None else parse_columns(columns),
        "sensors": dict(_sensor(text) for text in sensor) or None,
        "scale": None if scale is None else _numbers("--scale", scale),
        "offset": None if offset is None else _numbers("--offset", offset),
        "rate_hz": rate,
        "threshold_mps2": threshold,
        "window_s": window,
        "shortest_s": shortest,
        "gravity": None if gravity is None else {"value_mps2": gravity},
        "robot": {k: v for k, v in robot.items() if v is not None} or None,
        "exclude": list(exclude) or None,
        "join": list(join) or None,
    }
    given = {key: value for key, value in content.items() if value is not None}
    settings = read_settings(path, given)
    if full_range is None:
        return settings
    range_mps2 = _range(full_range, settings)
    given = settings.model_dump(exclude_unset=True)
    return parse_settings({**given, "range_mps2": range_mps2}, "--range")


def files_of(given: Sequence[Path]) -> list[Path]:
    """Files that are meant by files, folders and patterns.

    Those of a folder or a pattern come in the order of their names, and pos2 before pos10. So do
    files in the order of the alphabet, which is how a shell lists them.

    Raises
    ------
    InputError
        If there is none.
    """
    from accelstudy.campaign.importing.recorded import BAG_OF_FOLDER

    files: list[Path] = []
    for path in given:
        if path.is_dir() and not (path / BAG_OF_FOLDER).is_file():
            inside = [p for p in path.iterdir() if p.is_file() and not p.name.startswith(".")]
        elif glob.has_magic(str(path)) and not path.exists():
            inside = [Path(p) for p in glob.glob(str(path)) if Path(p).is_file()]
        else:
            files.append(path)
            continue
        if not inside:
            raise InputError(f"{path}: no file there")
        files += sorted(inside, key=natural)
    if files == sorted(files):
        files.sort(key=natural)
    twice = [path for path in files if files.count(path) > 1]
    if twice:
        raise InputError(f"{twice[0]}: the file is given twice")
    return files


def parse_columns(text: str, option: str = "--columns") -> dict[str, str]:
    """Columns as an option gives them: fx=1,fy=2,fz=3."""
    pairs = [part.split("=", 1) for part in text.split(",")]
    if any(len(pair) != 2 for pair in pairs):
        raise InputError(f"{option}: expected fx=1,fy=2,fz=3 or names, not {text!r}")
    return {key.strip(): column.strip() for key, column in pairs}


def _sensor(text: str) -> tuple[str, list[str]]:
    name, _, columns = text.partition("=")
    places = [column.strip() for column in columns.split(",")]
    if len(places) != 3 or not all(places):
        raise InputError(f"--sensor: expected a name and three columns, as a=1,2,3, not {text!r}")
    return name.strip(), places


def _numbers(option: str, text: str) -> list[float]:
    try:
        return [float(part) for part in text.split(",")]
    except ValueError:
        raise InputError(f"{option}: expected numbers, as 1.5 or 1,2,3, not {text!r}") from None


def _range(text: str, settings: ImportSettings) -> float:
    """Range in m/s², of a number with or without a unit."""
    match = _RANGE.fullmatch(text)
    unit = match[2] or "m/s^2" if match else ""
    sizes = {**UNITS["m/s^2"], "m/s²": 1.0}
    if unit == "counts" and settings.scale is not None:
        sizes["counts"] = float(max(map(abs, settings.scale)))
    if match is None or unit not in sizes:
        raise InputError(f"--range: expected a number in m/s², g or counts, as 4g, not {text!r}")
    (number,) = _numbers("--range", match[1])
    return number * sizes[unit]
