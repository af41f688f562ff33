"""The command that makes a data sheet of what was measured."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from accelstudy.basics.progress import say, stage
from accelstudy.commands.options import PATH, example, force_option, log_options, quiet_option

UNUSED = (
    "offset",
    "full_range",
    "gravity",
    "threshold",
    "window",
    "shortest",
    "robot_sigma",
    "robot_unit",
)
"""Options of an import that a data sheet does without; a file of settings may have them."""


@click.command(
    "data-sheet",
    epilog=example(
        "accelstudy data-sheet log.csv --rate 100 --columns fx=0,fy=1,fz=2 --out my-sensor.yaml"
    ),
)
@click.argument("source", type=PATH)
@click.option("--out", type=PATH, required=True, help="YAML file to write.")
@log_options
@click.option(
    "--settings",
    "settings_path",
    type=PATH,
    help="YAML file with these settings, as for an import.",
)
@force_option
@quiet_option
def data_sheet_command(
    source: Path, out: Path, settings_path: Path | None, force: bool, **options: Any
) -> None:
    """Make a data sheet of a sensor from a SOURCE.

    SOURCE is a log in which the sensor rests, the longer the better, or the folder of a campaign.
    White noise, bias instability and random walk come from the Allan deviation of the log; of a
    campaign only the noise of its positions is known. What the maker says can be added to the file,
    which `accelstudy plan --sensor` takes.
    """
    from accelstudy.commands.importing import settings_of
    from accelstudy.data_sheets.measured import sheet_of_campaign, sheet_of_log, yaml_of
    from accelstudy.files.outputs import new_file

    inputs = [source, *([] if settings_path is None else [settings_path])]
    with new_file(out, inputs, force) as path, stage("Allan deviation"):
        if source.is_dir():
            sheet = sheet_of_campaign(source)
        else:
            unused = dict.fromkeys(UNUSED)
            settings = settings_of(
                settings_path, sensor=(), exclude=(), join=(), **unused, **options
            )
            sheet = sheet_of_log(source, settings)
        path.write_text(yaml_of(sheet), encoding="utf-8")
    durations = (1.0, 10.0, 100.0) if sheet.position_sigma is None else ()
    for duration in durations:
        sigma = 1e3 * sheet.sigma_mean(duration)
        click.echo(f"sigma of the mean of {duration:g} s: {sigma:.3g} mm/s²")
    if sheet.position_sigma is not None:
        click.echo(f"sigma of the mean of a position: {1e3 * sheet.position_sigma:.3g} mm/s²")
    say(f"data sheet: {out}")
