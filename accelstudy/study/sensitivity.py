"""The sensitivity of leveling, from the tables of a study."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from accelstudy.basics.errors import InputError
from accelstudy.basics.units import to_si
from accelstudy.leveling.sensitivity import leveling_sensitivity
from accelstudy.leveling.shares import leveling_shares
from accelstudy.sensors.sensor import SensorModel
from accelstudy.study.config import Study

APPROACHES = ("gravity", "robot")
"""The approaches with whose calibrations the sensitivity is analysed."""


def sensitivity_table(study: Study, summary: pd.DataFrame) -> pd.DataFrame:
    """Analyse the sensitivity of leveling.

    Its `analysis` is "forces" for the parameter-free model (figure 4), or the approach whose
    calibration gives the sds of the parameters (figures 5 and 6).

    Parameters
    ----------
    study : Study, with `sensitivity`
    summary : DataFrame, the table of that name, with all cells that are analysed
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
    return pd.concat(tables, ignore_index=True)


def shapley_table(study: Study, summary: pd.DataFrame, correlations: pd.DataFrame) -> pd.DataFrame:
    """Divide the variance of roll and pitch among correlated parameters.

    The covariance matrix of a calibration has the sds of the Monte Carlo, as for the total effects,
    and the mean correlations of the adjustment's Σ_xx.

    Parameters
    ----------
    study : Study, with `sensitivity`
    summary, correlations : DataFrame, the tables of those names, as of `sensitivity_table`
    """
    settings = study.sensitivity
    assert settings is not None
    model, truth = _sensor(study)
    names = list(model.parameter_names)
    tables = []
    for approach in APPROACHES:
        sigma = _empirical_sigma(study, approach, summary)
        of_cell = correlations[correlations["cell"] == settings.cell(approach)]
        matrix = of_cell.pivot_table("adjustment", "parameter_1", "parameter_2", observed=True)
        table = leveling_shares(
            settings.roll_gon,
            settings.pitch_gon,
            study.sigma_force,
            model,
            truth,
            matrix.loc[names, names].to_numpy() * np.outer(sigma, sigma),
            study.gravity_mps2,
        )
        table.insert(0, "analysis", approach)
        tables.append(table)
    return pd.concat(tables, ignore_index=True)


def _sensor(study: Study) -> tuple[SensorModel, np.ndarray]:
    """Model of the sensitivity analysis, and its true parameters, (u,), SI."""
    settings = study.sensitivity
    assert settings is not None
    model = settings.model
    return model, model.vector(study.truth(e.spec for e in model.effects))


def _empirical_sigma(study: Study, approach: str, summary: pd.DataFrame) -> np.ndarray:
    """Standard deviations of the parameters over the Monte Carlo, (u,), SI."""
    settings = study.sensitivity
    assert settings is not None
    cell = settings.cell(approach)
    rows = summary[summary["cell"] == cell].set_index("parameter")
    if rows.empty or rows["sd_empirical"].isna().any():
        raise InputError(f"sensitivity: the study has no estimates of the cell {cell}")
    sigma, units = rows["sd_empirical"].to_dict(), rows["unit"].astype(str).to_dict()
    return np.array(
        [float(to_si(sigma[p.name], units[p.name], p.unit)) for p in settings.model.parameters]
    )
