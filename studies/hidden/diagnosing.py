"""One job of the study: campaigns are made and diagnosed, and truths and answers written apart."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np

from accelstudy.adjustment.quality import Solution, column_basis
from accelstudy.campaign.session import Campaign
from accelstudy.diagnosis.pipeline import judge
from accelstudy.diagnosis.result import Verdict
from accelstudy.effects import effects_without
from accelstudy.files.tables import write_table
from accelstudy.sensors.models import get_model
from studies.hidden.campaigns import Row, made, rows_table, tried
from studies.hidden.cells import Cell
from studies.hidden.config import HiddenConfig
from studies.hidden.judging import LEARNED


def run_chunk(
    config: HiddenConfig,
    campaigns: Iterable[tuple[Cell, int]],
    outputs: Mapping[str, str | Path],
    provenance: Mapping[str, Any],
) -> None:
    """Diagnose the campaigns of a chunk.

    The diagnosis gets the campaign and nothing else. One that fails is a row with its error. The
    times stand apart, as they differ in every run.

    Parameters
    ----------
    config : HiddenConfig
    campaigns : of (Cell, number of the campaign)
    outputs : paths of the tables truths, outcomes and seconds
    provenance : see `accelstudy.files.tables.origin`
    """
    model = get_model(config.model)
    rows: dict[str, list[Row]] = {name: [] for name in outputs}

    def answer(campaign: Campaign) -> Row:
        return outcome(judge(campaign, model, seed=config.diagnosis_seed))

    for cell, k in campaigns:
        campaign, truth = made(cell, k, config.seed)
        start = process_time()
        with effects_without(cell.removed):
            answered, error = tried(answer, campaign, f"{cell.name} {k}")
        key = {"cell": cell.name, "campaign": k}
        rows["truths"].append({**key, **truth})
        rows["outcomes"].append({**key, **(answered or {}), "error": error or truth["failed"]})
        rows["seconds"].append({**key, "seconds": process_time() - start})
    for name, path in outputs.items():
        write_table(path, rows_table(name, rows[name]), provenance)


def outcome(d: Verdict) -> Row:
    """Row of the table of outcomes."""
    test, held = d.global_test, d.gap.held_out
    learned = d.verdict == LEARNED
    return {
        "verdict": d.verdict,
        "found": json.dumps([one.name for one in d.effects]),
        "specs": json.dumps([one.spec for one in d.effects]),
        "found_classes": json.dumps([list(one.equivalence_class) for one in d.effects]),
        "positions": json.dumps([one.position for one in d.effects]),
        "posteriors": json.dumps([_rounded(one.posterior) for one in d.effects]),
        "credible_set": json.dumps(
            [
                {
                    "names": list(one.names),
                    "classes": [list(names) for names in one.classes],
                    "posterior": _rounded(one.posterior),
                }
                for one in d.credible_set
            ]
        ),
        "place": json.dumps(d.place),
        "fits": json.dumps([_fit(one) for one in (d.base, d.final.solution)] if learned else []),
        "confirmed": bool(d.gap.confirmed),
        "statement": d.gap.statement or "",
        "held_out_z": np.nan if held is None else float(held.z),
        "sigma0_before": float(d.gap.before),
        "sigma0_after": np.nan if d.gap.after is None else float(d.gap.after),
        "p_size": np.nan if test is None else float(test.p_value),
        "redundancy": d.base.redundancy,
        "positions_used": d.campaign.n_positions,
        "reason": d.reason,
    }


def _fit(solution: Solution) -> dict[str, Any]:
    """Sums of squares of the residuals of a fit, by kind, and what white noise leaves of them.

    With H = U Uᵀ of the conditions, U an orthonormal basis of the columns of Ã, residuals of unit
    weight have the sum of squares tr (I − H)² on average. Rows of Ã beside the conditions, those of
    parameters with a prior, only hold the parameters.
    """
    rows = solution.misclosures.size
    basis = column_basis(solution.design)[:rows]
    noise = rows - 2 * np.sum(basis**2) + np.sum((basis.T @ basis) ** 2)
    squares = np.sum(solution.residuals**2, axis=0)
    return {
        "force": _rounded(float(np.sum(squares[:3]))),
        "angle": _rounded(float(np.sum(squares[3:]))),
        "noise": _rounded(float(noise)),
    }


def _rounded(probability: float | None) -> float | None:
    return None if probability is None else float(f"{probability:.6g}")
