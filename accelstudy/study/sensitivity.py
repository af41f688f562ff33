"""The sensitivity of leveling, from the tables of a study."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from accelstudy.basics.errors import InputError
from accelstudy.basics.units import to_si
from accelstudy.leveling.sensitivity import leveling_sensitivity
from accelstudy.leveling.shares import leveling_shares
from accelstudy.study.config import APPROACHES, SensitivityConfig, Study


def sensitivity_table(study: Study, summary: pd.DataFrame) -> pd.DataFrame:
    """Analyse the sensitivity of leveling.

    Its `analysis` is "forces" for the parameter-free model (figure 4), or the approach whose
    calibration gives the sds of the parameters (figures 5 and 6).

    Parameters
    ----------
    study : Study, with `sensitivity`
    summary : DataFrame, the table of that name, with all cells that are analysed
    """
    settings, sensor = _sensor(study)
    calibrated: dict[str, dict[str, Any]] = {"forces": {}}
    for approach in APPROACHES:
        sigma = _empirical_sigma(settings, approach, summary)
        calibrated[approach] = {**sensor, "sigma_parameters": sigma}
    tables = {
        analysis: leveling_sensitivity(
            settings.roll_gon,
            settings.pitch_gon,
            study.noise.sensor.sigma_mps2,
            settings.base_samples,
            study.seed,
            g=study.gravity_mps2,
            **of_parameters,
        )
        for analysis, of_parameters in calibrated.items()
    }
    return _joined(tables)


def shapley_table(study: Study, summary: pd.DataFrame, correlations: pd.DataFrame) -> pd.DataFrame:
    """Divide the variance of roll and pitch among correlated parameters.

    The covariance matrix of a calibration has the sds of the Monte Carlo, as for the total effects,
    and the mean correlations of the adjustment's Σ_xx.

    Parameters
    ----------
    study : Study, with `sensitivity`
    summary, correlations : DataFrame, the tables of those names, as of `sensitivity_table`
    """
    settings, sensor = _sensor(study)
    names, tables = list(settings.model.parameter_names), {}
    for approach in APPROACHES:
        sigma = _empirical_sigma(settings, approach, summary)
        of_cell = correlations[correlations["cell"] == settings.cell(approach)]
        matrix = of_cell.pivot_table("adjustment", "parameter_1", "parameter_2", observed=True)
        tables[approach] = leveling_shares(
            settings.roll_gon,
            settings.pitch_gon,
            study.noise.sensor.sigma_mps2,
            covariance=matrix.loc[names, names].to_numpy() * np.outer(sigma, sigma),
            g=study.gravity_mps2,
            **sensor,
        )
    return _joined(tables)


def _sensor(study: Study) -> tuple[SensitivityConfig, dict[str, Any]]:
    """Settings of the analysis; its model, and the true parameters of this, (u,), SI."""
    settings = study.sensitivity
    assert settings is not None
    truth = settings.model.vector(study.truth(e.spec for e in settings.model.effects))
    return settings, {"model": settings.model, "parameters": truth}


def _empirical_sigma(
    settings: SensitivityConfig, approach: str, summary: pd.DataFrame
) -> np.ndarray:
    """Standard deviations of the parameters over the Monte Carlo, (u,), SI."""
    cell = settings.cell(approach)
    rows = summary[summary["cell"] == cell].set_index("parameter")
    if rows.empty or rows["sd_empirical"].isna().any():
        raise InputError(f"sensitivity: the study has no estimates of the cell {cell}")
    sigma, unit = rows["sd_empirical"], rows["unit"]
    parameters = settings.model.parameters
    return np.array([float(to_si(sigma[p.name], str(unit[p.name]), p.unit)) for p in parameters])


def _joined(tables: dict[str, pd.DataFrame]) -> pd.DataFrame:
    return pd.concat(tables, names=["analysis"]).reset_index("analysis").reset_index(drop=True)
