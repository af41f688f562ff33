"""The command that prints a calibration for a device."""

from __future__ import annotations

from pathlib import Path

import click

from accelstudy.basics.progress import warn
from accelstudy.commands.options import PATH, example


@click.command("export", epilog=example("accelstudy export calibrated/calibration.json --form c"))
@click.argument("calibration", type=PATH)
@click.option("--form", default="json", show_default=True, help="One of json, yaml, c and matrix.")
def export_command(calibration: Path, form: str) -> None:
    """Print a CALIBRATION in a form that a device takes.

    CALIBRATION is a calibration.json. json and yaml carry every effect: parameters with sigmas and
    units, and the formulas to implement. c and matrix hold M in force = M · (x, y, z, 1), readings
    and forces in the axes of the log; they carry bias, scale, non-orthogonality and whatever else
    is linear in the force, and no effect that is not, or that depends on time, temperature,
    vibration or the position before.
    """
    from accelstudy.campaign.use.applying import read_calibration
    from accelstudy.campaign.use.export import export

    content = read_calibration(calibration).content
    text = export(content, form)
    if mended := content["mended"]:
        warn(f"the calibration is of mended data: {mended['reason']}")
    click.echo(text, nl=False)
