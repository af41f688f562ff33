"""The sensitivity of leveling, from the tables of a study."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import pandas as pd

from accelstudy.basics.errors import InputError
from accelstudy.basics.units import to_si
from accelstudy.files.tables import read_table, write_table
from accelstudy.leveling.sensitivity import leveling_sensitivity
from accelstudy.leveling.shares import leveling_shares
from accelstudy.sensors.models import get_model
from accelstudy.sensors.sensor import SensorModel
from accelstudy.study.config import StudyConfig

Tables: TypeAlias = str | Path | Sequence[str | Path]

APPROACHES = ("gravity", "robot")
"""The approaches with whose calibrations the sensitivity is analysed."""


def analyse_sensitivity(
    study: StudyConfig, summary: Tables, output: str | Path, provenance: Mapping[str, Any]
) -> None:
    """Analyse the sensitivity of leveling and write the table.

    Its `analysis` is "forces" for the parameter-free model (figure 4), or the approach whose
    calibration gives the sds of the parameters (figures 5 and 6).

    Parameters
    ----------
    study : StudyConfig, with `sensitivity`
    summary : paths of tables of that name with all cells that are analysed
    output : path of the table to write
    provenance : see `accelstudy.files.tables.origin`
    """
    settings = study.sensitivity
    assert settings is not None
    model, truth = _sensor(study)
    tables = []
    for analysis in ("forces", *APPROACHES):
        calibrated: dict[str, Any] = {}
        if analysis != "forces":
            sigma = _empirical_sigma(study, analysis, summary)
            calibrated = {"model": model, "parameters": truth, "sigma_parameters": sigma}
        table = leveling_sensitivity(
            settings.roll_gon,
            settings.pitch_gon,
            study.sigma_force,
            settings.base_samples,
            settings.resamples,
            study.seed,
            g=study.gravity_mps2,
            **calibrated,
        )
        table.insert(0, "analysis", analysis)
        tables.append(table)
    write_table(output, pd.concat(tables, ignore_index=True), provenance)


def analyse_shapley(
    study: StudyConfig,
    summary: Tables,
    correlations: Tables,
    output: str | Path,
    provenance: Mapping[str, Any],
) -> None:
    """Divide the variance of roll and pitch among correlated parameters, and write the table.

    The covariance matrix of a calibration has the sds of the Monte Carlo, as for the total effects,
    and the mean correlations of the adjustment's Σ_xx.

    Parameters
    ----------
    study : StudyConfig, with `sensitivity`
    summary, correlations : paths of tables of those names, as in `analyse_sensitivity`
    output : path of the table to write
    provenance : see `accelstudy.files.tables.origin`
    """
    settings = study.sensitivity
    assert settings is not None
    model, truth = _sensor(study)
    names, pairs = list(model.parameter_names), read_table(correlations)
    tables = []
    for approach in APPROACHES:
        sigma = _empirical_sigma(study, approach, summary)
        of_cell = pairs[pairs["cell"] == _cell(study, approach)]
        matrix = of_cell.pivot_table("adjustment", "parameter_1", "parameter_2", observed=True)
        table = leveling_shares(
            settings.roll_gon,
            settings.pitch_gon,
            study.sigma_force,
            model,
            truth,
            matrix.loc[names, names].to_numpy() * np.outer(sigma, sigma),
            settings.base_samples,
            study.seed,
            study.gravity_mps2,
        )
        table.insert(0, "analysis", approach)
        tables.append(table)
    write_table(output, pd.concat(tables, ignore_index=True), provenance)


def _sensor(study: StudyConfig) -> tuple[SensorModel, np.ndarray]:
    """Model of the sensitivity analysis, and its true parameters, (u,), SI."""
    settings = study.sensitivity
    assert settings is not None
    model = get_model(settings.model, study.models)
    return model, model.vector(study.truth(e.spec for e in model.effects))


def _cell(study: StudyConfig, approach: str) -> str:
    """Name of the cell whose calibrations the sensitivity analysis uses."""
    settings = study.sensitivity
    assert settings is not None
    return "/".join([settings.model, settings.scheme, approach])


def _empirical_sigma(study: StudyConfig, approach: str, summary: Tables) -> np.ndarray:
    """Standard deviations of the parameters over the Monte Carlo, (u,), SI."""
    model, _ = _sensor(study)
    cell = _cell(study, approach)
    rows = read_table(summary)
    rows = rows[rows["cell"] == cell].set_index("parameter")
    if rows.empty or rows["sd_empirical"].isna().any():
        raise InputError(f"sensitivity: the study has no estimates of the cell {cell}")
    sigma, units = rows["sd_empirical"].to_dict(), rows["unit"].astype(str).to_dict()
    return np.array([float(to_si(sigma[p.name], units[p.name], p.unit)) for p in model.parameters])
