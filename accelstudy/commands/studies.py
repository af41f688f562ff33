"""Commands about studies, which Snakemake runs."""

from __future__ import annotations

import json
from collections.abc import Sequence
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import click

import accelstudy
from accelstudy.basics.progress import say, warn
from accelstudy.commands.bridge import Command
from accelstudy.verbs import kinds
from accelstudy.verbs.kinds import verb

if TYPE_CHECKING:
    from accelstudy.study.new_study import NewSensor

TEMPLATES = kinds.Names("template", "accelstudy.study.new_study", "TEMPLATES")


@verb
def init(
    folder: str | PathLike[str],
    *,
    template: Annotated[str, TEMPLATES] = "study",
    sensor: kinds.SensorName | None = None,
    force: kinds.Force = False,
) -> None:
    """Set up a study of your own in a new folder.

    It gets a Snakefile, a small configuration to edit, profiles and a README. The workflow itself
    stays in the installed package.

    With `sensor` the configuration has the noise and the errors of your sensor: of a data sheet, or
    as the calibration of a campaign finds them.

    Parameters
    ----------
    folder : path
        The new folder.
    template : str
        What to set up: study, or campaigns for a batch of campaigns.
    sensor : str
        Your sensor: a data sheet (a name or a file), or the folder of a campaign. [default: that of
        the paper]

    Examples
    --------
        accelstudy init my-study
        accelstudy init mine --sensor adxl355
    """
    from importlib.util import find_spec

    from accelstudy.basics.errors import InputError, UnknownNameError
    from accelstudy.study.new_study import RETIRED, TEMPLATES, new_study

    if template in RETIRED:
        raise InputError(f"--template {template}: no longer a template; {RETIRED[template]}")
    if template not in TEMPLATES:
        raise UnknownNameError("template", template, TEMPLATES)
    place = Path(folder)
    name = new_study(place, template, None if sensor is None else sensor_of(sensor), force)
    say(f"{template}: {place}")
    say(f"Edit {place / 'config' / 'config.yaml'}; then, in {place}: snakemake --cores 2")
    say(f"Results will be in {place / 'results' / name}.")
    if find_spec("snakemake") is None:
        warn("Snakemake is not installed, which runs the study: pip install 'accelstudy[workflow]'")


def sensor_of(given: str) -> NewSensor:
    """Sensor of a data sheet; or of a campaign, whose calibration is taken for the truth."""
    from accelstudy.api.inputs import fit_of
    from accelstudy.data_sheets import get_data_sheet
    from accelstudy.planning.question import USUAL_HOLD
    from accelstudy.sensors.models import NINE
    from accelstudy.study.new_study import OF_THE_PAPER, NewSensor

    if Path(given).is_dir():
        sheet, fit = accelstudy.data_sheet(given), fit_of(given, NINE, None)
        found = dict(zip(fit.model.parameter_names, fit.parameters.tolist(), strict=True))
        campaign = fit.campaign
        robot = {} if campaign.sigma_angle is None else {"sigma_angle": campaign.sigma_angle}
        return NewSensor(
            sigma=sheet.sigma_mean(1.0),
            noise=f"as {campaign.name} states it",
            gravity=campaign.gravity,
            errors={
                effect.name: tuple(found[one.name] for one in effect.parameters)
                for effect in fit.model.effects
            },
            source=dict.fromkeys(OF_THE_PAPER, f"as the calibration of {campaign.name} finds them"),
            campaign=Path(given),
            **robot,
        )
    sheet = get_data_sheet(given)
    known = {name: size for name in OF_THE_PAPER if (size := getattr(sheet, name)) is not None}
    mean = (
        f"the mean of {USUAL_HOLD:g} s"
        if sheet.position_sigma is None
        else "the mean of a position"
    )
    return NewSensor(
        sigma=sheet.sigma_mean(USUAL_HOLD),
        noise=f"{mean}, by the data sheet {sheet.name}",
        errors={**OF_THE_PAPER, **{name: (size, -size, size) for name, size in known.items()}},
        source=dict.fromkeys(known, f"of the size in the data sheet {sheet.name}"),
    )


@verb
def cells(configs: Sequence[str | PathLike[str]]) -> None:
    """List the cells of a study.

    Cells that cannot be estimated are listed with the reason.

    Parameters
    ----------
    configs : sequence of path
        YAML files; a later one overlays those before it, as with Snakemake's --configfile.

    Examples
    --------
        accelstudy cells config/config.yaml
    """
    from accelstudy.design.estimability import estimability
    from accelstudy.study.config import read_study

    study = read_study(*map(Path, configs))
    for cell in study.cells:
        found = estimability(
            cell.positions, cell.estimated_model, cell.conditions, cell.noise, hold=cell.hold
        )
        state = found.reason or f"r = {found.redundancy}, {cell.replicates} replicates"
        click.echo(f"{cell.name}: {state}")
    replicates = sum(cell.replicates for cell in study.cells)
    click.echo(f"\n{len(study.cells)} cells, up to {replicates} calibrations")


@verb
def claims(results: str | PathLike[str]) -> None:
    """Print the verdicts on the paper's claims as Markdown.

    Parameters
    ----------
    results : path
        Folder of a study, such as results/paper.

    Examples
    --------
        accelstudy claims results/paper
    """
    from accelstudy.files.tables import read_table
    from accelstudy.study.claims.page import claims_markdown

    click.echo(claims_markdown(read_table(Path(results) / "claims.parquet")), nl=False)


@verb
def config_schema() -> None:
    """Print the JSON schema of configurations.

    Editors check a configuration against it while you write.

    Examples
    --------
        accelstudy config-schema
    """
    from accelstudy.study.config import config_schema as schema

    click.echo(json.dumps(schema(), indent=2, ensure_ascii=False))


INIT = Command(init, shared=())
CELLS = Command(cells, shared=())
CLAIMS = Command(claims, shared=())
CONFIG_SCHEMA = Command(config_schema, shared=())
