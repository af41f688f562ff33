"""Verbs on studies, which Snakemake runs, and on what they are made of."""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike
from typing import TYPE_CHECKING, Annotated, Any

from accelstudy.basics.arguments import path_of
from accelstudy.basics.errors import InputError
from accelstudy.verbs import kinds
from accelstudy.verbs.kinds import Names, verb

if TYPE_CHECKING:
    import pandas as pd


CatalogueName = Annotated[str, Names("catalogue", "accelstudy.verbs.tables:KINDS")]


@verb
def catalogue(kind: CatalogueName) -> pd.DataFrame:
    """List effects, models, schemes, approaches and the like.

    Sizes of effects are in the units that people read, settings and data sheets in SI. A model is
    also any composition of models and effects joined by +, as bias-scale+warm_up(tau=300).

    Parameters
    ----------
    kind : str
        What is listed: effects, models, schemes, approaches, data-sheets or public-data.

    Returns
    -------
    DataFrame
        A row per item, by its name.

    Examples
    --------
        accelstudy catalogue models
    """
    from accelstudy.verbs.tables import rows_of

    return rows_of(kind)


@verb
def list_effects(
    *,
    campaign: kinds.CampaignOrPath | None = None,
    scheme: kinds.SchemeName | None = None,
    model: kinds.ModelName = "bias-scale-nonorthogonality",
    approach: kinds.UsualApproach = None,
) -> pd.DataFrame:
    """List all effects, or what a campaign can show of them.

    Models are composed of effects. Parameters are in the units shown, settings in SI. With
    `campaign` or `scheme` the command says which effects can show beside the model, how large they
    must be to be detected and to be named, and with which others they would be confused.

    Parameters
    ----------
    campaign : Campaign or path
        Folder of a campaign.
    scheme : str
        Name of a scheme, instead of a campaign.

    Returns
    -------
    DataFrame
        A row per effect: as ``catalogue("effects")`` or, of a campaign or a scheme, of each effect
        that the model leaves out, in the units that people read.

    Examples
    --------
        accelstudy effects
        accelstudy effects --campaign my-campaign
    """
    from accelstudy.verbs import tables

    if campaign is None and scheme is None:
        return tables.rows_of("effects")
    return tables.visible_effects(campaign, scheme, model, approach)


@verb
def list_schemes(
    names: Sequence[kinds.SchemeName] = (),
    *,
    model: kinds.ModelName = "bias-scale-nonorthogonality",
    approach: kinds.ApproachName = "gravity",
) -> pd.DataFrame:
    """List position schemes and what they can determine.

    Parameters
    ----------
    names : sequence of str
        A scheme, such as fibonacci-60 or random-20-7. Without them all are listed.

    Returns
    -------
    DataFrame
        A row per scheme, in the units that the names of the columns say.

    Examples
    --------
        accelstudy schemes --approach robot fibonacci-24 mclaren-24
    """
    from accelstudy.verbs.tables import scheme_table

    return scheme_table(names, model, approach)


@verb
def scheme(name: kinds.SchemeName) -> pd.DataFrame:
    """Print the directions of a scheme, with its source.

    They are directions of gravity in the axes of the sensor, as a CSV table.

    Parameters
    ----------
    name : str
        Name of the scheme, or a file.

    Returns
    -------
    DataFrame
        A row per position: x, y and z, and roll and pitch in the unit that the names say. Title and
        source of the scheme stand in ``attrs["title"]``.

    Examples
    --------
        accelstudy scheme fibonacci-24
    """
    from accelstudy.verbs.tables import directions

    return directions(name)


@verb
def init(
    folder: str | PathLike[str],
    *,
    force: kinds.Force = False,
) -> str:
    """Set up a study of your own in a new folder.

    It gets a Snakefile, a small configuration to edit, profiles and a README. The workflow itself
    stays in the installed package.

    Parameters
    ----------
    folder : path
        The new folder.

    Returns
    -------
    str
        What to do next, in lines.

    Examples
    --------
        accelstudy init my-study
    """
    from importlib.util import find_spec

    from accelstudy.study.new_study import new_study

    place = path_of("folder", folder)
    results = place / "results" / new_study(place, force)
    lines = [
        f"study: {place}",
        f"Edit {place / 'config' / 'config.yaml'}; then, in {place}: snakemake --cores 2",
        f"Results will be in {results}.",
    ]
    if find_spec("snakemake") is None:
        lines.append("Snakemake runs it, and is missing: pip install 'accelstudy[workflow]'")
    return "\n".join(lines)


@verb
def cells(configs: Sequence[str | PathLike[str]]) -> pd.DataFrame:
    """List the cells of a study.

    Cells that cannot be estimated are listed with the reason.

    Parameters
    ----------
    configs : sequence of path
        YAML files; a later one overlays those before it, as with Snakemake's --configfile.

    Returns
    -------
    DataFrame
        A row per cell, by its name: redundancy, replicates, and the reason why it cannot be
        estimated, empty if it can.

    Examples
    --------
        accelstudy cells config/config.yaml
    """
    from accelstudy.verbs.tables import cell_table

    return cell_table(configs)


@verb
def claims(results: str | PathLike[str]) -> str:
    """Print the verdicts on the paper's claims as Markdown.

    Parameters
    ----------
    results : path
        Folder of a study, such as results/paper.

    Returns
    -------
    str
        Table in Markdown; its numbers are in claims.parquet.

    Examples
    --------
        accelstudy claims results/paper
    """
    from accelstudy.files.tables import read_table
    from accelstudy.study.claims.page import claims_markdown

    table = path_of("results", results) / "claims.parquet"
    if not table.exists():
        raise InputError(f"{table}: no such file; a study with paper: true has one")
    return claims_markdown(read_table(table))


@verb
def config_schema() -> dict[str, Any]:
    """Print the JSON schema of configurations.

    Editors check a configuration against it while you write.

    Returns
    -------
    dict
        The schema.

    Examples
    --------
        accelstudy config-schema
    """
    from accelstudy.study.config import config_schema as schema

    return schema()
