"""The command that sets up a study of one's own."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from accelstudy.basics.progress import say, warn
from accelstudy.commands.options import PATH, SENSOR, Name, example, force_option

if TYPE_CHECKING:
    from accelstudy.study.new_study import NewSensor


@click.command(
    "init",
    epilog=example("accelstudy init my-study", "accelstudy init mine --sensor adxl355"),
)
@click.argument("folder", type=PATH)
@click.option(
    "--template",
    type=Name("template", "accelstudy.study.new_study", "TEMPLATES"),
    metavar="[study|campaigns]",
    default="study",
    show_default=True,
    help="What to set up: a study, or a batch of campaigns.",
)
@click.option(
    "--sensor",
    type=SENSOR,
    help="Your sensor: a data sheet (a name or a file), or the folder of a campaign.  [default: "
    "that of the paper]",
)
@force_option
def init_command(folder: Path, template: str, sensor: str | None, force: bool) -> None:
    """Set up a study of your own in a new FOLDER.

    It gets a Snakefile, a small configuration to edit, profiles and a README. The workflow itself
    stays in the installed package.

    With --sensor the configuration has the noise and the errors of your sensor: of a data sheet, or
    as the calibration of a campaign finds them.
    """
    from importlib.util import find_spec

    from accelstudy.basics.errors import InputError, UnknownNameError
    from accelstudy.study.new_study import RETIRED, TEMPLATES, new_study

    if template in RETIRED:
        raise InputError(f"--template {template}: no longer a template; {RETIRED[template]}")
    if template not in TEMPLATES:
        raise UnknownNameError("template", template, TEMPLATES)
    name = new_study(folder, template, _sensor(sensor), force)
    say(f"{template}: {folder}")
    say(f"Edit {folder / 'config' / 'config.yaml'}; then, in {folder}: snakemake --cores 2")
    say(f"Results will be in {folder / 'results' / name}.")
    if find_spec("snakemake") is None:
        warn("Snakemake is not installed, which runs the study: pip install 'accelstudy[workflow]'")


def _sensor(given: str | None) -> NewSensor | None:
    """Read the sensor from a data sheet or a campaign."""
    from accelstudy.data_sheets import get_data_sheet
    from accelstudy.planning.question import USUAL_HOLD
    from accelstudy.study.new_study import OF_THE_PAPER, NewSensor

    if given is None:
        return None
    if Path(given).is_dir():
        return _sensor_of_campaign(Path(given))
    sheet = get_data_sheet(given)
    errors: dict[str, tuple[float, ...]] = dict(OF_THE_PAPER)
    source = {}
    for name in errors:
        if (size := getattr(sheet, name)) is not None:
            errors[name] = (size, -size, size)
            source[name] = f"of the size in the data sheet {sheet.name}"
    known = sheet.velocity_random_walk is not None
    mean = f"the mean of {USUAL_HOLD:g} s" if known else "the mean of a position"
    return NewSensor(
        sigma=sheet.sigma_mean(USUAL_HOLD),
        noise=f"{mean}, by the data sheet {sheet.name}",
        errors=errors,
        source=source,
    )


def _sensor_of_campaign(folder: Path) -> NewSensor:
    """Calibrate a campaign, and take what was found for the truth."""
    from accelstudy.campaign.calibration.fit import fit_campaign
    from accelstudy.campaign.format import read_campaign
    from accelstudy.data_sheets.measured import sheet_of_campaign
    from accelstudy.sensors.models import get_model
    from accelstudy.study.new_study import OF_THE_PAPER, NewSensor

    sheet, campaign = sheet_of_campaign(folder), read_campaign(folder)
    model = get_model("bias-scale-nonorthogonality")
    fit = fit_campaign(campaign, model)
    found = dict(zip(model.parameter_names, fit.parameters.tolist(), strict=True))
    errors = {
        effect.name: tuple(found[parameter.name] for parameter in effect.parameters)
        for effect in model.effects
    }
    robot = {} if campaign.sigma_angle is None else {"sigma_angle": campaign.sigma_angle}
    return NewSensor(
        sigma=sheet.sigma_mean(1.0),
        noise=f"as {campaign.name} states it",
        gravity=campaign.gravity,
        errors=errors,
        source=dict.fromkeys(OF_THE_PAPER, f"as the calibration of {campaign.name} finds them"),
        campaign=folder,
        **robot,
    )
