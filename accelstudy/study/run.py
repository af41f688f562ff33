"""A study in memory, without Snakemake."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from accelstudy.study.claims.verdicts import ClaimData, judge
from accelstudy.study.config import read_study
from accelstudy.study.sensitivity import sensitivity_table, shapley_table
from accelstudy.study.tables import simulated_tables


def run_study(*configurations: str | Path) -> dict[str, pd.DataFrame]:
    """Run a study without Snakemake.

    Parameters
    ----------
    *configurations : str or Path
        YAML files as of the workflow; later ones overlay earlier ones key by key.

    Returns
    -------
    dict of DataFrame
        The tables that the workflow writes, by their names: cells, summary, correlations, leveling
        and quantiles; with `sensitivity` also sensitivity and shapley, with `paper` also claims.

    Raises
    ------
    InputError
        If a file cannot be read or does not fit the schema.
    """
    study = read_study(*configurations)
    tables = simulated_tables(study.cells, study.seed)
    if study.sensitivity is not None:
        tables["sensitivity"] = sensitivity_table(study, tables["summary"])
        tables["shapley"] = shapley_table(study, tables["summary"], tables["correlations"])
    if study.paper:
        tables["claims"] = judge(ClaimData(study, tables))
    return tables
