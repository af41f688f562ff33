"""Commands for which a verb is enough."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from accelstudy.basics.progress import say, warn
from accelstudy.commands.bridge import QUIET, Command
from accelstudy.files import outputs
from accelstudy.verbs import calibrations, planning, sensors

LEVELED = (
    "roll = atan2(-f_y, -f_z) and pitch = atan2(f_x, hypot(f_y, f_z)) of the calibrated force in "
    "frd (guide 'On a device'); `accelstudy apply` gives them with their sigmas"
)
"""Replacement of the option `--level`, which earlier versions had."""


def run_check_sigmas(**given: Any) -> None:
    """Print the check of sigmas, and what it can find."""
    table = calibrations.check_sigmas(**given)
    click.echo(table.to_string(index=False, float_format=lambda value: f"{value:.4g}"))
    say("sigma: as the adjustment claims it; ratio: sigma / sd_empirical.")
    click.echo(table.attrs["finds"])


def run_export(calibration: Path, form: str) -> None:
    """Print a calibration in a form that a device takes, and warn of what the form cannot hold."""
    from accelstudy.campaign.calibration.export import export, losses
    from accelstudy.campaign.calibration.sensor_calibration import sensor_of

    sensor = sensor_of(calibration)
    text = export(sensor, form)
    if mended := sensor.content.get("mended"):
        warn(f"the calibration is of mended data: {mended['reason']}")
    for loss in losses(sensor, form):
        warn(loss)
    click.echo(text, nl=False)


CALIBRATE = Command(calibrations.calibrate, writes=outputs.CALIBRATION)
DIAGNOSE = Command(
    calibrations.diagnose,
    writes=outputs.DIAGNOSIS,
    retired={"--replicates": "nothing is simulated; model.yaml is a study that does it"},
)
LOT = Command(sensors.lot, writes=outputs.LOT, reads=sensors.folders_of)
CHECK_SIGMAS = Command(calibrations.check_sigmas, run_check_sigmas)
EXPORT = Command(calibrations.export, run_export, retired={"--level": LEVELED}, shared=[QUIET])
COMPARE = Command(sensors.compare, writes=outputs.COMPARISON)
HISTORY = Command(sensors.history, writes=outputs.HISTORY)
PLAN = Command(
    planning.plan,
    writes=outputs.PLAN,
    out="Folder for the table, the figure and a study.",
    optional=True,
    sections={
        "What is asked": "tilt_accuracy tilt_range sensor sigma history equipment confidence",
        "What is tried": "holds schemes max_time max_positions replicates seed",
        "What the equipment takes": "moving_time robot_moving_time robot_setup_time robot_sigma",
    },
    retired={"--reference": "`accelstudy import --reference-log` takes a calibrated sensor"},
)
