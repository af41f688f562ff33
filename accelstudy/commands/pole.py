"""The command that tells what a tilt sensor is worth on a pole."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import click
from click.core import ParameterSource

from accelstudy.basics.progress import say, stage, warn
from accelstudy.commands.options import (
    PATH,
    SCHEME,
    SENSOR,
    Sectioned,
    angle_unit_option,
    approach_option,
    example,
    force_option,
    history_option,
    model_option,
    quantity_option,
    quiet_option,
    seed_option,
)
from accelstudy.pole.setup import (
    HOLD,
    KINDS,
    LINEAR,
    ROBOT_SIGMA,
    TILT_RANGE,
    TILT_SIGMA,
    check_one_kind,
    quantities,
)

Command = TypeVar("Command", bound=Callable[..., Any])

_SECTIONS: dict[str, list[str]] = {
    "The sensor": ["sensor", "calibration", "tilt_sigma", "mounting"],
    "Its calibration, if there is none yet": [*LINEAR],
}
for _name, _given in quantities().items():
    _SECTIONS.setdefault(_given.section, []).append(_name)
_SECTIONS["What is worked out"] = ["tilt_range", "replicates", "seed", "out"]


def _setup_options(command: Command) -> Command:
    """Add an option for each quantity of a pole."""
    for name, given in quantities().items():
        command = quantity_option(name, given)(command)
    return command


@click.command(
    "pole",
    cls=Sectioned,
    sections=_SECTIONS,
    epilog=example(
        "accelstudy pole --length 2m --sensor adxl355 --scheme mclaren-24 --approach gravity "
        "--tilt-range 50gon --out pole"
    ),
)
@click.option(
    "--sensor", type=SENSOR, required=True, help="A data sheet: its name, or a YAML file."
)
@history_option
@click.option("--calibration", type=PATH, help="A calibration.json of the sensor.")
@quantity_option("tilt_sigma", TILT_SIGMA)
@click.option(
    "--mounting",
    default="frd",
    show_default=True,
    help="Where x, y, z of the sensor point on the upright pole: d is down along it, f and r are "
    "forward and right.",
)
@model_option
@click.option(
    "--scheme",
    type=SCHEME,
    default="mclaren-24",
    show_default=True,
    help="Positions; `accelstudy schemes` lists them.",
)
@approach_option("gravity")
@quantity_option("hold", HOLD)
@quantity_option("robot_sigma", ROBOT_SIGMA)
@_setup_options
@quantity_option("tilt_range", TILT_RANGE)
@click.option(
    "--replicates",
    default=1000,
    show_default=True,
    type=click.IntRange(min=2, max=1_000_000),
    help="Readings of the Monte Carlo at each of 3 tilts in 16 directions.",
)
@seed_option
@click.option("--out", type=PATH, required=True, help="Folder to write to.")
@force_option
@angle_unit_option
@quiet_option
def pole_command(
    sensor: str,
    history: Path | None,
    calibration: Path | None,
    tilt_sigma: float | None,
    mounting: str,
    model: str,
    scheme: str,
    approach: str,
    hold: float,
    robot_sigma: float,
    tilt_range: float,
    replicates: int,
    seed: int,
    out: Path,
    force: bool,
    **given: Any,
) -> None:
    """Tell how wrong the foot of a tilted pole is, and why.

    A GNSS antenna or a prism sits on top of a pole, which leans while its foot stands on the point.
    Roll and pitch of the sensor and a heading lead from the top to the foot. Each source of error
    is told apart over the tilt: the calibration, noise, drift and temperature of the sensor, its
    mounting, the heading, the bending and the length of the pole, the position of the top. A
    quantity of 0 leaves its source out.
    """
    from accelstudy.data_sheets import get_data_sheet
    from accelstudy.files.outputs import POLE, result_folder
    from accelstudy.pole.output import write_pole
    from accelstudy.pole.sensor import (
        from_calibration,
        from_linear_theory,
        from_tilt_sigma,
    )
    from accelstudy.pole.setup import Setup
    from accelstudy.pole.statement import budget_text
    from accelstudy.sensors.frames import parse_frame

    setup, frame, sheet = Setup(**given), parse_frame(mounting), get_data_sheet(sensor)
    if history is not None:
        from accelstudy.data_sheets.measured import with_history

        sheet = with_history(sheet, history)
    source_of = click.get_current_context().get_parameter_source
    typed = [n for kind in KINDS for n in kind if source_of(n) is ParameterSource.COMMANDLINE]
    check_one_kind({name: f"--{name.replace('_', '-')}" for name in typed})
    inputs = [path for path in (calibration, history) if path is not None]
    with result_folder(out, POLE, inputs, force) as folder, stage("budget of the pole"):
        if calibration is not None:
            calibrated = from_calibration(calibration, sheet, frame)
        elif tilt_sigma is not None:
            calibrated = from_tilt_sigma(tilt_sigma, sheet, frame)
        else:
            calibrated = from_linear_theory(
                model, scheme, approach, sheet, hold, robot_sigma, frame
            )
        result = write_pole(setup, calibrated, tilt_range, replicates, seed, folder)
    for warning in calibrated.warnings:
        warn(warning)
    say(f"sensor {sheet.name}; {calibrated.origin}\n")
    click.echo(budget_text(result.shown))
    say("")
    for sentence in result.sentences:
        click.echo(sentence)
    say(f"figure: {out / 'budget.png'}")
