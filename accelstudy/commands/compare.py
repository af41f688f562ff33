"""The command that compares two calibrations of one sensor."""

from __future__ import annotations

from pathlib import Path

import click

from accelstudy.basics.progress import say, stage
from accelstudy.commands.options import (
    PATH,
    Quantity,
    angle_unit_option,
    example,
    force_option,
    quiet_option,
)


@click.command(
    "compare",
    epilog=example("accelstudy compare spring/calibration.json autumn/calibration.json --out both"),
)
@click.argument("first", type=PATH)
@click.argument("second", type=PATH)
@click.option("--out", type=PATH, required=True, help="Folder to write to.")
@click.option(
    "--tilt-range",
    type=Quantity("rad"),
    default="50gon",
    show_default=True,
    help="Tilts over which the change of roll and pitch is taken.",
)
@force_option
@angle_unit_option
@quiet_option
def compare_command(first: Path, second: Path, out: Path, tilt_range: float, force: bool) -> None:
    """Say whether a sensor is still what it was.

    FIRST and SECOND are calibration.json files, the older one first. The congruence test of
    deformation analysis takes all parameters with both covariance matrices; if it rejects, the
    parameters that changed are named, at one level for all. The change is also given in roll and
    pitch. If one calibration has effects that the other lacks, it is brought to those of both.

    The folder of results gets report.html, comparison.json and a figure.
    """
    from accelstudy import compare
    from accelstudy.files.outputs import COMPARISON, result_folder

    with result_folder(out, COMPARISON, [first, second], force) as folder, stage("comparison"):
        comparison = compare(first, second, tilt_range=tilt_range)
        comparison.write(folder, out)
    click.echo(f"{comparison.state.upper()}: {comparison.verdict}")
    say(f"report: {out / 'report.html'}")
