"""The later stages of a study: sensitivity, claims and figures, from tables to files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from accelstudy.errors import InputError
from accelstudy.leveling_shares import leveling_shares
from accelstudy.models import get_model
from accelstudy.outputs import whole_file
from accelstudy.sensitivity import leveling_sensitivity
from accelstudy.sensor import SensorModel
from accelstudy.study.cells import study_cells
from accelstudy.study.config import StudyConfig
from accelstudy.study.tables import read_table, write_table
from accelstudy.units import to_si
from accelstudy.wording import joined

APPROACHES = ("gravity", "robot")
"""Those whose calibrations the sensitivity is analysed with."""


def analyse_sensitivity(
    study: StudyConfig, summary: str | Path, output: str | Path, provenance: Mapping[str, Any]
) -> None:
    """Analyse the sensitivity of leveling and write the table.

    Its `analysis` is "forces" for the parameter-free model (figure 4), or the approach whose
    calibration gives the sds of the parameters (figures 5 and 6).

    Parameters
    ----------
    study : StudyConfig, with `sensitivity`
    summary : path of the table of that name
    output : path of the table to write
    provenance : see `accelstudy.study.tables.origin`
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
    summary: str | Path,
    correlations: str | Path,
    output: str | Path,
    provenance: Mapping[str, Any],
) -> None:
    """Share out the variance of roll and pitch to correlated parameters, and write the table.

    The covariance matrix of a calibration has the sds that the total effects have, of the Monte
    Carlo, and the mean correlations of the adjustment's Σ_xx.

    Parameters
    ----------
    study : StudyConfig, with `sensitivity`
    summary, correlations : paths of the tables of those names
    output : path of the table to write
    provenance : see `accelstudy.study.tables.origin`
    """
    settings = study.sensitivity
    assert settings is not None
    model, truth = _sensor(study)
    names, pairs = list(model.parameter_names), read_table(correlations)
    tables = []
    for approach in APPROACHES:
        sigma = _empirical_sigma(study, approach, summary)
        own = pairs[pairs["cell"] == _cell(study, approach)]
        matrix = own.pivot_table("adjustment", "parameter_1", "parameter_2", observed=True)
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
    """Name of the cell whose calibrations count in the sensitivity analysis."""
    settings = study.sensitivity
    assert settings is not None
    return "/".join([settings.model, settings.scheme, approach])


def _empirical_sigma(study: StudyConfig, approach: str, summary: Any) -> np.ndarray:
    """Standard deviations of the parameters over the Monte Carlo, (u,), SI."""
    model, _ = _sensor(study)
    cell = _cell(study, approach)
    rows = read_table(summary)
    rows = rows[rows["cell"] == cell].set_index("parameter")
    if rows.empty or rows["sd_empirical"].isna().any():
        raise InputError(f"sensitivity: the study has no estimates of the cell {cell}")
    sigma, units = rows["sd_empirical"].to_dict(), rows["unit"].astype(str).to_dict()
    return np.array([float(to_si(sigma[p.name], units[p.name], p.unit)) for p in model.parameters])


def judge_claims(
    study: StudyConfig,
    parts: Mapping[str, Sequence[str | Path]],
    correlations: str | Path,
    sensitivity: str | Path,
    shapley: str | Path,
    outputs: Mapping[str, str],
    provenance: Mapping[str, Any],
) -> None:
    """Judge the paper's claims.

    Parameters
    ----------
    study : StudyConfig, with `sensitivity`
    parts : see `accelstudy.study.claims.evidence.evidence_from`
    correlations, sensitivity, shapley : paths of the tables
    outputs : paths of `claims`, `by_scheme` and `html`
    provenance : see `accelstudy.study.tables.origin`
    """
    from accelstudy.study.claims import evidence_from, judge
    from accelstudy.study.report import claims_page

    settings = study.sensitivity
    assert settings is not None
    cells = [
        cell
        for cell in study_cells(study)
        if cell.name == "/".join([settings.model, cell.scheme, cell.approach])
    ]
    evidence = evidence_from(
        cells,
        parts,
        scheme=settings.scheme,
        correlations=read_table(correlations),
        sensitivity=read_table(sensitivity),
        shapley=read_table(shapley),
        base_samples=settings.base_samples,
        resamples=settings.resamples,
        seed=study.seed,
    )
    claims, by_scheme = judge(evidence)
    write_table(outputs["claims"], claims, provenance)
    write_table(outputs["by_scheme"], by_scheme, provenance)
    with whole_file(outputs["html"]) as path:
        path.write_text(claims_page(claims, by_scheme), encoding="utf-8")


def draw_figures(
    study: StudyConfig, names: Sequence[str], tables: Mapping[str, Any], folder: str | Path
) -> None:
    """Draw figures from tables given by their paths, as SVG and PNG by their names in a folder.

    The first that cannot be drawn ends it; the error names that figure.
    """
    from accelstudy.figures import figure_tables, render

    read = {name: read_table(tables[name]) for name in figure_tables(*names)}
    for name in names:
        path = Path(folder, name)
        try:
            render(name, read, study, path.with_suffix(".svg"), path.with_suffix(".png"))
        except Exception as error:
            error.add_note(
                f"The figure {name!r} could not be drawn, so all of its job are missing: "
                f"{joined(names)}."
            )
            raise
