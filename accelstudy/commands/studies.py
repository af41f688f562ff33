"""Commands about studies, which Snakemake runs."""

from __future__ import annotations

import json
from collections.abc import Sequence
from os import PathLike
from pathlib import Path
from typing import Annotated

import click

from accelstudy.basics.progress import say, warn
from accelstudy.commands.bridge import Command
from accelstudy.verbs import kinds
from accelstudy.verbs.kinds import verb

TEMPLATES = kinds.Names("template", "accelstudy.study.new_study", "TEMPLATES")


@verb
def init(
    folder: str | PathLike[str],
    *,
    template: Annotated[str, TEMPLATES] = "study",
    force: kinds.Force = False,
) -> None:
    """Set up a study of your own in a new folder.

    It gets a Snakefile, a small configuration to edit, profiles and a README. The workflow itself
    stays in the installed package.

    Parameters
    ----------
    folder : path
        The new folder.
    template : str
        What to set up: study, or campaigns for a batch of campaigns.

    Examples
    --------
        accelstudy init my-study
    """
    from importlib.util import find_spec

    from accelstudy.basics.errors import InputError, UnknownNameError
    from accelstudy.study.new_study import RETIRED, TEMPLATES, new_study

    if template in RETIRED:
        raise InputError(f"--template {template}: no longer a template; {RETIRED[template]}")
    if template not in TEMPLATES:
        raise UnknownNameError("template", template, TEMPLATES)
    place = Path(folder)
    name = new_study(place, template, force)
    say(f"{template}: {place}")
    say(f"Edit {place / 'config' / 'config.yaml'}; then, in {place}: snakemake --cores 2")
    say(f"Results will be in {place / 'results' / name}.")
    if find_spec("snakemake") is None:
        warn("Snakemake is not installed, which runs the study: pip install 'accelstudy[workflow]'")


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


INIT = Command(
    init,
    shared=(),
    retired={"--sensor": "set `noise` and `sensor` in config/config.yaml of the new folder"},
)
CELLS = Command(cells, shared=())
CLAIMS = Command(claims, shared=())
CONFIG_SCHEMA = Command(config_schema, shared=())
