"""One job of the study: campaigns are made and diagnosed, and truths and answers written apart."""

from __future__ import annotations

import json
import logging
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
import pandas as pd

from accelstudy.campaign import Campaign
from accelstudy.diagnosis.pipeline import diagnose
from accelstudy.diagnosis.result import Diagnosis
from accelstudy.effects import effects_without
from accelstudy.errors import InputError
from accelstudy.hidden.cells import Cell
from accelstudy.hidden.config import HiddenConfig
from accelstudy.hidden.physics import Truth, generate
from accelstudy.hidden.tables import SCHEMA
from accelstudy.models import get_model
from accelstudy.study.tables import write_table

Row = dict[str, Any]


def run_chunk(
    config: HiddenConfig,
    campaigns: Iterable[tuple[Cell, int]],
    outputs: Mapping[str, str | Path],
    provenance: Mapping[str, Any],
) -> None:
    """Diagnose the campaigns of a chunk.

    The diagnosis is given the campaign, and nothing else. One that fails is a row with its error.
    How long each took stands apart, as it is another time in every run.

    Parameters
    ----------
    config : HiddenConfig
    campaigns : of (Cell, number of the campaign)
    outputs : paths of the tables truths, outcomes and seconds
    provenance : see `accelstudy.study.tables.origin`
    """
    model = get_model(config.model)
    rows: dict[str, list[Row]] = {name: [] for name in outputs}

    def answer(campaign: Campaign) -> Row:
        return _outcome(diagnose(campaign, model, seed=config.diagnosis_seed))

    for cell, k in campaigns:
        campaign, truth = _made(cell, k, config.seed)
        start = process_time()
        with effects_without(cell.removed):
            answered, error = _tried(answer, campaign, f"{cell.name} {k}")
        key = {"cell": cell.name, "campaign": k}
        rows["truths"].append({**key, **truth})
        rows["outcomes"].append({**key, **(answered or {}), "error": error or truth["failed"]})
        rows["seconds"].append({**key, "seconds": process_time() - start})
    for name, path in outputs.items():
        write_table(path, _table(name, rows[name]), provenance)


def run_baselines(
    config: HiddenConfig,
    campaigns: Iterable[tuple[Cell, int]],
    output: str | Path,
    provenance: Mapping[str, Any],
) -> None:
    """Let the simpler methods answer to some of the campaigns; parameters as in `run_chunk`.

    Where none of them can work, as the model cannot be fitted, they find nothing, with the error.
    """
    from accelstudy.hidden.baselines import METHODS, answers  # slow, and diagnosing does without

    model, rows = get_model(config.model), []

    def answer(campaign: Campaign) -> list[Row]:
        return [
            {"method": method, "detected": detected, "found": json.dumps(names), "error": ""}
            for method, (detected, names) in answers(campaign, model)
        ]

    for cell, k in campaigns:
        if cell.one_in(config.baselines_every, k):
            campaign, truth = _made(cell, k, config.seed)
            with effects_without(cell.removed):
                answered, error = _tried(answer, campaign, f"{cell.name} {k}")
            nothing = {"detected": False, "found": "[]", "error": error or truth["failed"]}
            answered = answered or [{"method": method, **nothing} for method in METHODS]
            rows += [{"cell": cell.name, "campaign": k, **row} for row in answered]
    write_table(output, _table("baselines", rows), provenance)


def _table(name: str, rows: list[Row]) -> pd.DataFrame:
    return pd.DataFrame(rows, columns=[*SCHEMA[name]]).astype(SCHEMA[name])


def _made(cell: Cell, k: int, seed: int) -> tuple[Campaign | None, Row]:
    """Make a campaign and the row of its truth; None if it could not be made."""
    made, error = _tried(
        lambda own: generate(cell.case, own), cell.seed(seed, k), f"{cell.name} {k}: not made"
    )
    campaign, truth = made or (None, None)
    return campaign, _truth(cell, truth, error)


def _tried(work: Callable[[Any], Any], given: Any, what: str) -> tuple[Any, str]:
    """Return what comes of what is given, and the error if nothing does; None comes of None."""
    if given is None:
        return None, ""
    try:
        return work(given), ""
    except InputError as error:
        logging.info("%s: %s", what, error)
        return None, f"refused: {error}"
    except OSError:  # a full disk, say, which is no matter of this campaign
        raise
    except Exception as error:
        logging.exception("%s", what)
        return None, f"{type(error).__name__}: {' '.join(str(error).split())[:200]}"


def _truth(cell: Cell, truth: Truth | None, error: str) -> Row:
    """Row of the table of truths; of a campaign that could not be made what was wanted."""
    case = cell.case
    known = {} if truth is None else truth.to_dict()
    oracle = known.get("oracle") or {}
    gross = known.get("gross") or {}
    # What a session cannot show, or is not in the catalogue, is nothing that can be named rightly.
    classes = [] if case.set in ("invisible", "outside") else known.get("classes", [])
    left = [[name for name in one if name not in cell.removed] for one in classes]
    return {
        "set": case.set,
        "what": cell.what,
        "size": cell.size,
        "design": case.design,
        "approach": case.approach,
        "sigma": "given" if case.sigma_known else "not given",
        "classes": json.dumps([one for one in left if one]),
        "effects": json.dumps(known.get("effects", [])),
        "noise": json.dumps(known.get("noise")),
        "gross": json.dumps(gross),
        "gross_name": gross.get("name", ""),
        "oracle_detected": oracle.get("detected"),
        "oracle_best": json.dumps(oracle.get("best", [])),
        "oracle_told": json.dumps(oracle.get("told", [])),
        "oracle_alternatives": oracle.get("alternatives"),
        "left": json.dumps(known.get("left", [])),
        "sensor": json.dumps(known.get("sensor")),
        "seed": json.dumps(known.get("seed")),
        "failed": error,
    }


def _outcome(d: Diagnosis) -> Row:
    """Row of the table of outcomes."""
    test, held = d.global_test, d.gap.held_out
    return {
        "verdict": d.verdict,
        "found": json.dumps([one.name for one in d.found]),
        "specs": json.dumps([one.spec for one in d.found]),
        "found_classes": json.dumps([list(one.equivalence_class) for one in d.found]),
        "positions": json.dumps([one.position for one in d.found]),
        "posteriors": json.dumps([_rounded(one.posterior) for one in d.found]),
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


def _rounded(probability: float | None) -> float | None:
    return None if probability is None else float(f"{probability:.6g}")
