"""The claims of `claims.yaml`, judged by the tables of a study."""

from __future__ import annotations

import operator
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from string import Formatter
from typing import Any

import numpy as np
import pandas as pd
import yaml

from accelstudy.basics.wording import counted, number
from accelstudy.files.outputs import whole_file
from accelstudy.files.tables import read_table, write_table
from accelstudy.study.beyond_linear_theory import (
    beyond_linear_theory,
    knows_all,
    noise_when_off,
)
from accelstudy.study.cell import Cell
from accelstudy.study.claims import quantities
from accelstudy.study.claims.page import claims_page
from accelstudy.study.claims.quantities import Evidence, Numbers
from accelstudy.study.claims.reductions import reductions
from accelstudy.study.config import Study
from accelstudy.study.replicates import read_replicates

REPRODUCED, NOT_REPRODUCED, SLIP = "reproduced", "not reproduced", "slip in the paper"
HOLDS, FAILS, OPEN = "holds", "does not hold", "not decided"

TABLES = ("cells", "summary", "correlations", "sensitivity", "shapley")
"""What the claims are judged by, beside estimates."""
COLUMNS = (
    *("claim", "section", "statement", "unit", "paper", "ours", "ci95_low", "ci95_high"),
    *("verdict", "sentence", "single_low", "single_high", "percentile"),
)
"""Columns of the claims; `section` is empty for a claim of this project."""
SCHEME_COLUMNS = (
    *("claim", "scheme", "paper", "mean", "single_low", "median", "single_high", "percentile"),
)
RELATIONS = {
    **{"at most": operator.le, "at least": operator.ge},
    **{"below": operator.lt, "above": operator.gt},
}
MOST = 10
"""Most set-ups that a sentence names."""


@cache
def claim_table() -> dict[str, list[dict[str, Any]]]:
    """Read the claims."""
    text = Path(__file__).with_name("claims.yaml").read_text(encoding="utf-8")
    return dict(yaml.safe_load(text))


def judge_claims(
    study: Study,
    estimates: Sequence[str | Path],
    tables: Mapping[str, str | Path],
    outputs: Mapping[str, str],
    provenance: Mapping[str, Any],
) -> None:
    """Judge the paper's claims, and those of this project.

    Parameters
    ----------
    study : Study, with `sensitivity`
    estimates : files with the estimates of the cells that the claims use
    tables : paths of the tables of `TABLES`, by their names
    outputs : paths of `claims`, `by_scheme` and `html`
    provenance : see `accelstudy.files.tables.origin`
    """
    claimed = [cell for cell in study.cells if is_claimed(study, cell)]
    stored = ((cell, read_replicates(estimates, cell)) for cell in claimed)
    calibrations = ((cell, replicates) for cell, replicates in stored if replicates is not None)
    reduced = reductions(calibrations, papers_reductions())
    claims, by_scheme = judge(study, {name: read_table(tables[name]) for name in TABLES}, reduced)
    write_table(outputs["claims"], claims, provenance)
    write_table(outputs["by_scheme"], by_scheme, provenance)
    with whole_file(outputs["html"]) as path:
        path.write_text(claims_page(claims, by_scheme), encoding="utf-8")


def is_claimed(study: Study, cell: Cell) -> bool:
    """Whether the claims use the estimates of a cell: it has their model, and the usual noise."""
    assert study.sensitivity is not None
    return cell.name == study.sensitivity.cell(cell.approach, cell.scheme)


def papers_reductions() -> dict[str, float]:
    """The paper's reduction, %, of the sd of each effect."""
    rows = claim_table()["by_scheme"]
    return {row["of"]: row["paper"] for row in rows if row["quantity"] == "reductions"}


def judge(
    study: Study, tables: Mapping[str, pd.DataFrame], reductions: pd.DataFrame
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Judge all claims.

    Parameters
    ----------
    study : Study, with `sensitivity`
    tables : mapping of name to DataFrame, those of `TABLES`
    reductions : DataFrame, see `accelstudy.study.claims.reductions`

    Returns
    -------
    claims : DataFrame, with `COLUMNS`: those of the paper, then those of this project
    by_scheme : DataFrame, with `SCHEME_COLUMNS`
    """
    evidence, rows = Evidence(study, tables, reductions, pd.DataFrame()), claim_table()
    parts = [
        getattr(quantities, row["quantity"])(evidence, row["of"]).assign(
            claim=row["claim"], paper=float(row["paper"])
        )
        for row in rows["by_scheme"]
    ]
    by_scheme = pd.concat(parts, ignore_index=True)[list(SCHEME_COLUMNS)]
    evidence = Evidence(study, tables, reductions, by_scheme)
    claims = [judge_claim(row, evidence) for row in rows["paper"]]
    if knows_all(study):
        beyond = beyond_linear_theory(tables["cells"], tables["summary"])
        claims += judge_simulation(beyond, study.sigma_force)
    return pd.DataFrame(claims).reindex(columns=list(COLUMNS)), by_scheme


def judge_claim(claim: Mapping[str, Any], evidence: Evidence) -> dict[str, Any]:
    """Judge a claim of the paper; return its row."""
    ((name, arguments),) = claim["quantity"].items()
    ours: Numbers = {"paper": float(claim.get("paper", "nan")), "low": np.nan, "high": np.nan}
    ours |= getattr(quantities, name)(evidence, **arguments)
    return {
        **{key: claim[key] for key in ("claim", "section", "statement", "unit")},
        "paper": ours["paper"],
        **{"ours": ours["value"], "ci95_low": ours["low"], "ci95_high": ours["high"]},
        "verdict": _verdict(claim.get("rule"), ours),
        "sentence": _Sentence().format(claim["sentence"], **ours),
        **{key: ours[key] for key in ("single_low", "single_high", "percentile") if key in ours},
    }


def _verdict(rule: str | None, ours: Numbers) -> str:
    """Verdict by a rule such as "off at most 0.5 or outside at most 0"."""
    if rule is None:
        return SLIP
    paper, nothing = ours["paper"], np.nan

    def outside(low: str, high: str) -> float:
        low_end, high_end = ours.get(low, nothing), ours.get(high, nothing)
        return float(np.maximum(np.maximum(low_end - paper, paper - high_end), 0))

    distances = {
        "off": round(abs(ours["value"] - paper), 3),
        "outside": outside("low", "high"),
        "outside_single": outside("single_low", "single_high"),
    }
    for condition in rule.split(" or "):
        name, *relation, limit = condition.split()
        if RELATIONS[" ".join(relation)]({**distances, **ours}[name], float(limit)):
            return REPRODUCED
    return NOT_REPRODUCED


class _Sentence(Formatter):
    """A text with numbers, whose minus is a minus and no hyphen."""

    def format_field(self, value: Any, format_spec: str) -> str:
        text = str(super().format_field(value, format_spec))
        return text if isinstance(value, str) else text.replace("-", "−")


# --- what simulation adds ------------------------------------------------------------------------


def judge_simulation(beyond: pd.DataFrame, sigma: float) -> list[dict[str, Any]]:
    """Judge what simulation adds, for each approach, by all models and schemes at one noise.

    Parameters
    ----------
    beyond : DataFrame, see `accelstudy.study.beyond_linear_theory`
    sigma : float, noise of the sensor, m/s²
    """
    rows = beyond[beyond["sensor_sigma_mps2"] == sigma]
    return [
        _judge_approach(claim, rows[rows["approach"] == approach], approach, sigma)
        for claim in claim_table()["project"]
        for approach in sorted(set(rows["approach"]))
    ]


def _judge_approach(
    claim: Mapping[str, Any], rows: pd.DataFrame, approach: str, sigma: float
) -> dict[str, Any]:
    """Judge a claim by the rows of an approach: by the largest number of each set-up.

    It holds if the interval of each set-up says so, and does not if that of one denies it.
    """
    column = "bias" if claim["quantity"] == "bias" else "excess"
    size, half = rows[column].abs(), rows[f"{column}_half"]
    numbers = rows.assign(size=size, low=(size - half).clip(lower=0), high=size + half)
    of_setup = numbers.groupby(["model", "scheme"], observed=True, sort=False)
    setups = of_setup[["size", "low", "high"]].max().reset_index()
    for end in ("size", "low", "high"):
        percent = 100 * setups[end]
        noisy = claim["quantity"] == "noise"
        setups[end] = noise_when_off(1.0, setups[end]) if noisy else percent
    # The end of its interval at which a set-up may still be right, and that at which it surely is.
    if "most" in claim:
        fails, holds = setups["low"] > claim["most"], setups["high"] < claim["most"]
        worst, bound = setups[["size", "low", "high"]].max(), "at most"
    else:
        fails, holds = setups["low"] < claim["least"], setups["high"] > claim["least"]
        worst, bound = setups[["size", "low", "high"]].min(), "at least"
    undecided = ~fails & ~holds
    low, high = sorted((worst["low"], worst["high"]))
    unit = " times" if claim["unit"] == "ratio" else f" {claim['unit']}"

    def named(chosen: pd.DataFrame) -> str:
        names = [
            f"{row['scheme']} with {row['model']} ({number(row['size'])}{unit})"
            for row in chosen.to_dict("records")
        ]
        return ", ".join([*names[:MOST], *([f"{len(names) - MOST} more"] if names[MOST:] else [])])

    parts, all_of = [], counted(len(setups), "set-up")
    if fails.any():
        parts.append(f"Not so in {fails.sum()} of {all_of}: {named(setups[fails])}.")
    if undecided.any():
        some = counted(int(undecided.sum()), "set-up")
        parts.append(f"Not decided in {some}: {named(setups[undecided])}.")
    others = setups[holds].groupby("model", observed=True, sort=False)["high"]
    if holds.any():
        where = "Elsewhere" if parts else f"In {all_of}"
        limits = others.max() if "most" in claim else others.min()
        each = (f"{number(value)}{unit} with {model}" for model, value in limits.items())
        parts.append(f"{where} {bound} {', '.join(each)}.")
    statement = f"by {approach}, at a noise of {sigma * 1000:g} mm/s², {claim['statement']}"
    return {
        "claim": f"{claim['claim']}-{approach}",
        **{"section": "", "statement": statement, "unit": claim["unit"], "paper": np.nan},
        **{"ours": float(worst["size"]), "ci95_low": low, "ci95_high": high},
        "verdict": FAILS if fails.any() else OPEN if undecided.any() else HOLDS,
        "sentence": " ".join(parts),
    }
