"""The jobs that diagnose: truths and answers are written as rows of tables."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np

from accelstudy.adjustment.quality import Solution, column_basis
from accelstudy.diagnosis.pipeline import judge
from accelstudy.diagnosis.result import Verdict
from accelstudy.effects import effects_without
from accelstudy.files.tables import write_table
from accelstudy.sensors.models import get_model
from studies.hidden.campaigns import (
    SCHEMA,
    C,
    Made,
    Make,
    Row,
    made_of,
    rows_table,
    simulated,
    tried,
)
from studies.hidden.cells import Cell
from studies.hidden.config import HiddenConfig


def run_chunk(
    config: HiddenConfig,
    campaigns: Iterable[tuple[Cell, int]],
    outputs: Mapping[str, str | Path],
    provenance: Mapping[str, Any],
) -> None:
    """Diagnose the campaigns of a chunk.

    Parameters
    ----------
    config : HiddenConfig
    campaigns : of (Cell, number of the campaign)
    outputs : paths of the tables truths, outcomes and seconds; the times stand apart, as they
        differ in every run
    provenance : see `accelstudy.files.tables.origin`
    """
    rows = [*diagnosed(campaigns, simulated(config.seed), config.model, config.diagnosis_seed)]
    for i, name in enumerate(("truths", "outcomes", "seconds")):
        table = rows_table((row[i] for row in rows), SCHEMA[name])
        write_table(outputs[name], table, provenance)


def diagnosed(
    campaigns: Iterable[tuple[C, int]], make: Make[C], model: str, seed: int
) -> Iterator[tuple[Row, Row, Row]]:
    """Rows of truth, outcome and time of campaigns.

    The diagnosis gets the campaign and nothing else. One that fails is a row with its error.

    Parameters
    ----------
    campaigns : of (Cell, number of the campaign)
    make : makes a campaign
    model : name of the model that is diagnosed
    seed : of each diagnosis
    """
    sensor_model = get_model(model)
    for cell, k in campaigns:
        made, truth = made_of(cell, k, make)
        start = process_time()

        def answer(made: Made) -> Row:
            verdict = judge(made.campaign, sensor_model, seed=seed)
            return outcome(verdict) | made.of_answer(verdict)

        with effects_without(cell.removed):
            answered, error = tried(answer, made, f"{cell.name} {k}")
        key = {"cell": cell.name, "campaign": k}
        yield (
            {**key, **truth},
            {**key, **(answered or {}), "error": error or truth["failed"]},
            {**key, "seconds": process_time() - start},
        )


def outcome(d: Verdict) -> Row:
    """Row of the table of outcomes."""
    test, held = d.global_test, d.gap.held_out
    fits = (d.base, d.final.solution) if d.verdict == "learned" else ()
    explanations = [
        {
            "names": list(one.names),
            "classes": [list(names) for names in one.classes],
            "posterior": _rounded(one.posterior),
        }
        for one in d.credible_set
    ]
    return {
        "verdict": d.verdict,
        "found": json.dumps([one.name for one in d.effects]),
        "specs": json.dumps([one.spec for one in d.effects]),
        "found_classes": json.dumps([list(one.equivalence_class) for one in d.effects]),
        "positions": json.dumps([one.position for one in d.effects]),
        "posteriors": json.dumps([_rounded(one.posterior) for one in d.effects]),
        "credible_set": json.dumps(explanations),
        "place": json.dumps(d.place),
        "fits": json.dumps([fit_squares(one) for one in fits]),
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


def fit_squares(solution: Solution) -> dict[str, Any]:
    """Sums of squares of the residuals of a fit, by kind, and what white noise leaves of them.

    With H = U Uᵀ of the conditions, U an orthonormal basis of the columns of Ã, residuals of unit
    weight have the sum of squares tr (I − H)² on average. Rows of Ã beside the conditions, those of
    parameters with a prior, only hold the parameters.
    """
    rows = solution.misclosures.size
    basis = column_basis(solution.design)[:rows]
    noise = rows - 2 * np.sum(basis**2) + np.sum((basis.T @ basis) ** 2)
    squares = np.sum(solution.residuals**2, axis=0)
    values = {"force": np.sum(squares[:3]), "angle": np.sum(squares[3:]), "noise": noise}
    return {name: _rounded(float(value)) for name, value in values.items()}


def _rounded(probability: float | None) -> float | None:
    return None if probability is None else float(f"{probability:.6g}")
