"""The command that prints a calibration for a device."""

from __future__ import annotations

from pathlib import Path

import click

from accelstudy.basics.progress import warn
from accelstudy.commands.options import PATH, example


@click.command("export", epilog=example("accelstudy export calibrated/calibration.json --form c"))
@click.argument("calibration", type=PATH)
@click.option(
    "--form", default="json", show_default=True, help="Form of the output: json, yaml, c or matrix."
)
def export_command(calibration: Path, form: str) -> None:
    """Print a CALIBRATION in a form that a device takes.

    CALIBRATION is a calibration.json. json and yaml carry every effect: parameters with sigmas and
    units, and the formulas to implement. c and matrix hold M in force = M · (x, y, z, 1), with
    readings and forces in the axes of the log. No matrix carries an effect that is not linear in
    the force, or that depends on time, temperature, vibration or the position before; for these c
    holds a function, which takes them.
    """
    from accelstudy.campaign.calibration.applying import read_calibration
    from accelstudy.campaign.calibration.export import export

    content = read_calibration(calibration).content
    text = export(content, form)
    if mended := content["mended"]:
        warn(f"the calibration is of mended data: {mended['reason']}")
    click.echo(text, nl=False)
