"""The claims of `claims.yaml`, judged by the tables of a study."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from accelstudy.basics.wording import counted, number
from accelstudy.files.outputs import whole_file
from accelstudy.files.tables import read_table, write_table
from accelstudy.study.beyond_linear_theory import (
    beyond_linear_theory,
    knows_all,
    noise_when_off,
)
from accelstudy.study.claims import quantities
from accelstudy.study.claims.page import claims_page
from accelstudy.study.claims.quantities import ESTIMATED, Evidence, Numbers, claim_table
from accelstudy.study.config import Study

REPRODUCED, NOT_REPRODUCED, SLIP = "reproduced", "not reproduced", "slip in the paper"
HOLDS, FAILS, OPEN = "holds", "does not hold", "not decided"

TABLES = ("cells", "summary", "correlations", "sensitivity", "shapley")
"""What the claims are judged by, beside estimates."""
SINGLE = ("single_low", "single_high", "percentile")


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

    @cache
    def estimates_of(cell: str) -> pd.DataFrame:
        return read_table(estimates, columns=ESTIMATED, rows=("cell", [cell]))

    read = {name: read_table(tables[name]) for name in TABLES}
    evidence = Evidence(study, read, estimates_of)
    claims = judge(evidence)
    write_table(outputs["claims"], claims, provenance)
    write_table(outputs["by_scheme"], evidence.by_scheme, provenance)
    with whole_file(outputs["html"]) as path:
        path.write_text(claims_page(claims, evidence.by_scheme), encoding="utf-8")


def judge(evidence: Evidence) -> pd.DataFrame:
    """Judge all claims by all evidence: those of the paper, then those of this project.

    Returns
    -------
    DataFrame
        A row per claim, with its claim, section (empty for a claim of this project), statement,
        unit, the paper's number, ours with ci95_low and ci95_high, verdict, sentence, and of single
        simulations single_low, single_high and percentile, NaN where they are not asked for.
    """
    study, tables = evidence.study, evidence.tables
    claims = [judge_claim(claim, evidence) for claim in claim_table()["paper"]]
    if knows_all(study):
        beyond = beyond_linear_theory(tables["cells"], tables["summary"])
        claims += judge_simulation(beyond, study.sigma_force)
    return pd.DataFrame(claims)


def judge_claim(claim: Mapping[str, Any], evidence: Evidence) -> dict[str, Any]:
    """Judge a claim of the paper; return its row."""
    ((name, arguments),) = claim["quantity"].items()
    numbers: Numbers = dict.fromkeys(("low", "high", *SINGLE), np.nan)
    numbers["paper"] = float(claim.get("paper", "nan"))
    numbers |= getattr(quantities, name)(evidence, **arguments)
    sentence = claim["sentence"].format(**numbers)
    verdict = SLIP
    if rule := claim.get("rule"):
        reproduced = pd.eval(rule, engine="python", local_dict=numbers)
        verdict = REPRODUCED if reproduced else NOT_REPRODUCED
    return {
        **{key: claim[key] for key in ("claim", "section", "statement", "unit")},
        **{"paper": numbers["paper"], "ours": numbers["value"]},
        **{"ci95_low": numbers["low"], "ci95_high": numbers["high"], "verdict": verdict},
        "sentence": re.sub(r"(?<!\w)-(?=\d)", "−", sentence),
        **{key: numbers[key] for key in SINGLE},
    }


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
    size, half = rows[claim["quantity"]].abs(), rows[f"{claim['quantity']}_half"]
    ends = rows.assign(value=size, low=(size - half).clip(lower=0), high=size + half)
    names = ["value", "low", "high"]
    setups = ends.groupby(["model", "scheme"], observed=True, sort=False)[names].max().reset_index()
    if claim["unit"] == "%":
        setups[names] *= 100
        worst, most, unit = "max", "largest", " %"
    else:  # the noise from which linear theory is off; it falls with the excess
        setups[names] = noise_when_off(1.0, setups[["value", "high", "low"]])
        worst, most, unit = "min", "smallest", " times"
    holds, fails = (np.asarray(setups.eval(claim[rule]), bool) for rule in ("holds", "fails"))
    each = setups.groupby("model", observed=True, sort=False)["value"].agg(f"idx{worst}")
    shown = ", ".join(
        f"{number(row['value'])}{unit} with {row['model']} ({row['scheme']})"
        for row in setups.loc[each].to_dict("records")
    )
    not_so, not_decided = fails.sum(), (~holds & ~fails).sum()
    extreme = setups[names].agg(worst)
    return {
        "claim": f"{claim['claim']}-{approach}",
        "section": "",
        "statement": f"by {approach}, at a noise of {sigma * 1000:g} mm/s², {claim['statement']}",
        **{"unit": claim["unit"], "paper": np.nan, "ours": float(extreme["value"])},
        **{"ci95_low": float(extreme["low"]), "ci95_high": float(extreme["high"])},
        "verdict": FAILS if fails.any() else HOLDS if holds.all() else OPEN,
        "sentence": f"Not so in {not_so} and not decided in {not_decided} of "
        f"{counted(len(setups), 'set-up')}. The {most} of each model: {shown}.",
    }
