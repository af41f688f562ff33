"""The commands that make a campaign of a raw log, or of public data."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from accelstudy.errors import InputError
from accelstudy.options import PATH, example, force_option, quiet_option
from accelstudy.progress import say

if TYPE_CHECKING:
    from accelstudy.campaign.importing import ImportReport


@click.command(
    "import",
    epilog=example(
        "accelstudy import log.csv --out my-campaign --rate 100 --columns fx=0,fy=1,fz=2"
    ),
)
@click.argument("log", type=PATH)
@click.option("--out", type=PATH, required=True, help="Folder of the campaign.")
@click.option("--settings", "settings_path", type=PATH, help="YAML file; options overlay it.")
@click.option("--name", help="Name of the campaign.  [default: that of the file]")
@click.option("--columns", help="Names or places from 0, as fx=1,fy=2,fz=3.")
@click.option("--time", help="Column of time, by name or place.")
@click.option("--rate", type=float, help="Samples per second, without a column of time.")
@click.option("--unit", help="One of m/s^2, g and counts.  [default: m/s^2]")
@click.option("--scale", help="With counts: m/s² per count, one number or three.")
@click.option("--offset", help="With counts: reading at 0 m/s², one number or three.")
@click.option("--gravity", type=float, help="Local gravity, m/s².  [default: 9.80665]")
@click.option("--threshold", type=float, help="Sd of a window at rest, m/s², instead of chosen.")
@click.option("--means", is_flag=True, help="LOG is a table of means already.")
@click.option("--figure/--no-figure", default=True, help="Draw the log with its holds.")
@force_option
@quiet_option
def import_command(
    log: Path,
    out: Path,
    settings_path: Path | None,
    means: bool,
    figure: bool,
    force: bool,
    **options: Any,
) -> None:
    """Make a campaign of a raw LOG: find its static holds.

    LOG is text (CSV or columns), MATLAB or Parquet. Without --threshold the noise of the log
    itself says what is at rest; segmentation.png in the folder shows the outcome.
    """
    from accelstudy.campaign.importing import import_to, read_settings
    from accelstudy.outputs import CAMPAIGN, result_folder

    settings = read_settings(settings_path, _given(means=means or None, **options))
    inputs = [log, *([] if settings_path is None else [settings_path])]
    with result_folder(out, CAMPAIGN, inputs, force) as campaign:
        _, report = import_to(campaign, log, settings, figure)
    _show(report, out, figure)


@click.command(
    "public", epilog=example("accelstudy public", "accelstudy public xsens-mti --out xsens")
)
@click.argument("name", required=False)
@click.option("--out", type=PATH, help="Folder of the campaign.")
@click.option(
    "--folder",
    type=PATH,
    default="resources/public",
    show_default=True,
    help="Where the file is, in any subfolder, or is downloaded to.",
)
@force_option
@quiet_option
def public_command(name: str | None, out: Path | None, folder: Path, force: bool) -> None:
    """Make a campaign of public data, or list what there is.

    NAME is that of the data; without it they are listed. A download is checked by its sha256, and
    goes on where an earlier one broke off.
    """
    from accelstudy.campaign.importing import import_to
    from accelstudy.campaign.public import import_settings, public_data, public_file
    from accelstudy.outputs import CAMPAIGN, result_folder

    if name is None:
        for known, entry in public_data().items():
            click.echo(f"{known}: {entry.description}\n    {entry.licence}, {entry.url}")
        return
    settings = import_settings(name)
    if out is None:
        raise InputError("--out: give the folder of the campaign")
    with result_folder(out, CAMPAIGN, [folder], force) as campaign:
        _, report = import_to(campaign, public_file(name, folder), settings)
    _show(report, out)


def _show(report: ImportReport, out: Path, figure: bool = True) -> None:
    for line in report.lines():
        say(line)
    for warning in report.warnings:
        click.echo(f"warning: {warning}", err=True)
    if figure and report.holds is not None:
        say(f"figure: {out / 'segmentation.png'}")
    say(f"campaign: {out}")


def _given(
    columns: str | None,
    scale: str | None,
    offset: str | None,
    rate: float | None,
    gravity: float | None,
    threshold: float | None,
    time: str | None,
    **others: str | bool | None,
) -> dict[str, Any]:
    """Options that were given, as the settings name them."""
    content: dict[str, Any] = {
        **others,
        "columns": None if columns is None else parse_columns(columns),
        "scale": None if scale is None else _numbers("--scale", scale),
        "offset": None if offset is None else _numbers("--offset", offset),
        "rate_hz": rate,
        "time": time,
        "threshold_mps2": threshold,
        "gravity": None if gravity is None else {"value_mps2": gravity},
    }
    return {key: value for key, value in content.items() if value is not None}


def parse_columns(text: str) -> dict[str, str]:
    """Columns as an option gives them: fx=1,fy=2,fz=3."""
    pairs = [part.split("=", 1) for part in text.split(",")]
    if any(len(pair) != 2 for pair in pairs):
        raise InputError(f"--columns: expected fx=1,fy=2,fz=3 or names, not {text!r}")
    return {key.strip(): column.strip() for key, column in pairs}


def _numbers(option: str, text: str) -> list[float]:
    try:
        return [float(part) for part in text.split(",")]
    except ValueError:
        raise InputError(f"{option}: expected numbers, as 1.5 or 1,2,3, not {text!r}") from None
