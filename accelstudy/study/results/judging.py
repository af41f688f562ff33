"""The paper's claims, judged by the tables of a study: results as tables and a page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from accelstudy.files.outputs import whole_file
from accelstudy.files.tables import read_table, write_table
from accelstudy.study.cells.of_study import study_cells
from accelstudy.study.claims import evidence_from, judge
from accelstudy.study.claims.page import claims_page
from accelstudy.study.config import StudyConfig


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
    provenance : see `accelstudy.files.tables.origin`
    """
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
