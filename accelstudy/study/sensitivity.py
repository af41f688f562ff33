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
    settings, place, sensor = _set_up(study)
    calibrated: dict[str, dict[str, Any]] = {"forces": {}}
    for approach in APPROACHES:
        sigma = _empirical_sigma(settings, approach, summary)
        calibrated[approach] = {**sensor, "sigma_parameters": sigma}
    tables = {
        analysis: leveling_sensitivity(
            **place, base_samples=settings.base_samples, seed=study.seed, **of_parameters
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
    settings, place, sensor = _set_up(study)
    names, tables = list(settings.model.parameter_names), {}
    for approach in APPROACHES:
        sigma = _empirical_sigma(settings, approach, summary)
        of_cell = correlations[correlations["cell"] == settings.cell(approach)]
        matrix = of_cell.pivot_table("adjustment", "parameter_1", "parameter_2", observed=True)
        covariance = matrix.loc[names, names].to_numpy() * np.outer(sigma, sigma)
        tables[approach] = leveling_shares(**place, **sensor, covariance=covariance)
    return _joined(tables)


def _set_up(study: Study) -> tuple[SensitivityConfig, dict[str, Any], dict[str, Any]]:
    """Settings of the analysis; attitudes, noise and gravity; model and true parameters, SI."""
    settings = study.sensitivity
    assert settings is not None
    place: dict[str, Any] = {"roll_gon": settings.roll_gon, "pitch_gon": settings.pitch_gon}
    place |= {"sigma_force": study.noise.sensor.sigma_mps2, "g": study.gravity_mps2}
    truth = settings.model.vector(study.truth(e.spec for e in settings.model.effects))
    return settings, place, {"model": settings.model, "parameters": truth}


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
