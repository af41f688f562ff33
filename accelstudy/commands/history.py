"""The command that follows a sensor over its calibrations."""

from __future__ import annotations

import math
from pathlib import Path

import click

from accelstudy.basics.progress import say, stage
from accelstudy.commands.options import (
    PATH,
    Quantity,
    angle_unit_option,
    example,
    force_option,
    given_once,
    quiet_option,
)


@click.command(
    "history",
    epilog=example(
        "accelstudy history spring/calibration.json autumn/calibration.json "
        "winter/calibration.json --date 2025-04-01 --date 2025-10-01 --date 2026-01-15 --out years"
    ),
)
@click.argument("calibrations", type=PATH, nargs=-1, required=True, metavar="CALIBRATION...")
@click.option(
    "--date",
    "dates",
    multiple=True,
    help="Date of a calibration, as 2026-03-01 or 2026-03-01T14:00; one for each, in their order.  "
    "[default: those of the campaigns]",
)
@click.option("--out", type=PATH, required=True, help="Folder to write to.")
@click.option(
    "--tilt-accuracy",
    type=Quantity("rad", 1e-9, math.pi / 2),
    help="Ask how long the last calibration stays this accurate in roll and pitch, as 10mgon.",
)
@click.option(
    "--tilt-range",
    type=Quantity("rad", 1e-3, math.pi / 2),
    default="50gon",
    show_default=True,
    help="Largest tilt at which the accuracy is wanted.",
)
@click.option(
    "--confidence",
    metavar="CONFIDENCE",
    default="95%",
    show_default=True,
    help="Probability with which it stays so.",
)
@force_option
@angle_unit_option
@quiet_option
def history_command(
    calibrations: tuple[Path, ...],
    dates: tuple[str, ...],
    out: Path,
    tilt_accuracy: float | None,
    tilt_range: float,
    confidence: str,
    force: bool,
) -> None:
    """Say how a sensor changes over time.

    CALIBRATION are three or more calibration.json files of one sensor. For each parameter there
    is a rate with its interval, and the scatter from session to session, as by switching the
    sensor off and on. All tests together have one level. If calibrations differ in their effects,
    they are brought to those that all of them have.

    With --tilt-accuracy it says how long the last calibration is good enough, and what a new one
    would gain.

    The folder of results gets report.html, history.json, history.parquet and a figure.
    """
    from accelstudy import history
    from accelstudy.files.outputs import HISTORY, result_folder

    given_once(calibrations, "calibration")
    with result_folder(out, HISTORY, calibrations, force) as folder, stage("history"):
        found = history(
            calibrations,
            dates=dates,
            tilt_accuracy=tilt_accuracy,
            tilt_range=tilt_range,
            confidence=confidence,
        )
        found.write(folder, out)
    click.echo(f"{found.state.upper()}: {found.verdict}")
    say(f"report: {out / 'report.html'}")
