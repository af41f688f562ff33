"""The command that prints a calibration for a device."""

from __future__ import annotations

from pathlib import Path

import click

from accelstudy.basics.progress import warn
from accelstudy.commands.options import PATH, example, retired_option

LEVELED = (
    "roll = atan2(-f_y, -f_z) and pitch = atan2(f_x, hypot(f_y, f_z)) of the calibrated force in "
    "frd (guide 'On a device'); `accelstudy apply` gives them with their sigmas"
)
"""What to do instead of `--level`."""


@click.command("export", epilog=example("accelstudy export calibrated/calibration.json --form c"))
@click.argument("calibration", type=PATH)
@click.option(
    "--form", default="json", show_default=True, help="Form: json, yaml, c, matrix or px4."
)
@retired_option("--level", LEVELED, is_flag=True)
def export_command(calibration: Path, form: str) -> None:
    """Print a CALIBRATION in a form that a device takes.

    CALIBRATION is a calibration.json. json and yaml carry every effect: parameters with sigmas and
    units, and the formulas to implement. matrix holds M in force = M · (x, y, z, 1), if nothing but
    the force matters, and that linearly.

    c is a header in C99 with the function accel_calibrate. It takes the reading and, where effects
    depend on them, temperature, time and vibration. What depends on the position before is refused.

    px4 is a parameter file for PX4: an offset, a scale and a polynomial of the temperature for each
    axis, closest to the calibration over all attitudes. What PX4 cannot hold is said, with the
    errors of roll and pitch that it leaves.

    Readings and forces are in the axes of the log.
    """
    from accelstudy.campaign.calibration.applying import read_calibration
    from accelstudy.campaign.calibration.export import export, losses

    content = read_calibration(calibration).content
    text = export(content, form)
    if mended := content["mended"]:
        warn(f"the calibration is of mended data: {mended['reason']}")
    for loss in losses(content, form):
        warn(loss)
    click.echo(text, nl=False)
