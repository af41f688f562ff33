"""The command that follows a sensor over its calibrations."""

from __future__ import annotations

import math
from datetime import datetime
from pathlib import Path

import click

from accelstudy.basics.dates import read_date
from accelstudy.basics.errors import InputError
from accelstudy.basics.progress import say, stage
from accelstudy.basics.wording import counted
from accelstudy.commands.options import (
    PATH,
    Quantity,
    angle_unit_option,
    example,
    force_option,
    given_once,
    quiet_option,
)
from accelstudy.commands.plan import Confidence


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
    type=Confidence(),
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
    confidence: float | None,
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
    from accelstudy.campaign.calibration.applying import read_calibration
    from accelstudy.epochs.history import history_of
    from accelstudy.epochs.history_output import write_history
    from accelstudy.epochs.interval import Interval
    from accelstudy.files.outputs import HISTORY, result_folder

    given_once(calibrations, "calibration")
    if dates and len(dates) != len(calibrations):
        raise InputError(
            f"--date: {counted(len(dates), 'date')} for "
            f"{counted(len(calibrations), 'calibration')}; give one for each, in their order, as "
            "--date 2026-03-01"
        )
    if confidence is None:
        raise InputError("--confidence: a probability, such as 95%, not rms")
    with result_folder(out, HISTORY, calibrations, force) as folder, stage("history"):
        read = [read_calibration(path) for path in calibrations]
        first: dict[bytes, Path] = {}
        for path, one in zip(calibrations, read, strict=True):
            # Noise never repeats: the same numbers are one campaign, whatever the file is called.
            if (same := first.setdefault(one.parameters.tobytes(), path)) != path:
                raise InputError(f"{path}: has the numbers of {same}; each campaign counts once")
        given = dates or [one.content["date"] for one in read]
        wheres = ["--date"] * len(dates) or [f"{path}: date" for path in calibrations]
        when = [_date(text, where) for text, where in zip(given, wheres, strict=True)]
        history = history_of(read, when)
        interval = None
        if tilt_accuracy is not None:
            interval = Interval(history, tilt_accuracy, tilt_range, confidence)
        content = write_history(history, folder, interval)
    click.echo(f"{content['state'].upper()}: {content['verdict']}")
    say(f"report: {out / 'report.html'}")


def _date(text: str | None, where: str) -> datetime:
    if text is None:
        raise InputError(
            f"{where}: missing; give --date for each calibration, or calibrate again with `date` "
            "in the header of the campaign"
        )
    try:
        return read_date(text)
    except InputError as error:
        raise InputError(f"{where}: {error}") from None
