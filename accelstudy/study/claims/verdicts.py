"""The claims of `claims.yaml`, judged by the tables of a study."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import yaml

from accelstudy.study.claims import quantities
from accelstudy.study.claims.quantities import Numbers
from accelstudy.study.config import APPROACHES, SensitivityConfig, Study

REPRODUCED, NOT_REPRODUCED, SLIP = "reproduced", "not reproduced", "slip in the paper"

SINGLE = ("single_low", "single_high", "percentile")


@dataclass(frozen=True)
class ClaimData:
    """What the claims are judged by.

    Attributes
    ----------
    study : Study, with `sensitivity`
    tables : mapping of name to DataFrame: cells, summary, correlations, sensitivity and shapley
    """

    study: Study
    tables: Mapping[str, pd.DataFrame]

    @property
    def settings(self) -> SensitivityConfig:
        """Settings of the sensitivity analysis: its model and scheme are those of the claims."""
        assert self.study.sensitivity is not None
        return self.study.sensitivity

    @cached_property
    def schemes(self) -> list[str]:
        """Schemes in which both approaches were simulated with the model of the claims."""
        cells = self.tables["cells"]
        done = set(cells["cell"][cells["estimable"].astype(bool) & (cells["n_replicates"] > 0)])
        names = dict.fromkeys(cells["scheme"].astype(str))
        return [s for s in names if all(self.settings.cell(a, s) in done for a in APPROACHES)]

    def rows(self, table: str, approach: str, scheme: str = "") -> pd.DataFrame:
        """Rows of a table that are of one cell."""
        rows = self.tables[table]
        return rows[rows["cell"] == self.settings.cell(approach, scheme)]


@cache
def claim_table() -> list[dict[str, Any]]:
    """Read the claims."""
    text = Path(__file__).with_name("claims.yaml").read_text(encoding="utf-8")
    return list(yaml.safe_load(text))


def judge(data: ClaimData) -> pd.DataFrame:
    """Judge all claims by all data.

    Returns
    -------
    DataFrame
        A row per claim, with its claim, section, statement, unit, the paper's number, ours with
        ci95_low and ci95_high, verdict, sentence, and of single simulations single_low, single_high
        and percentile, NaN where they are not asked for.
    """
    return pd.DataFrame([judge_claim(claim, data) for claim in claim_table()])


def judge_claim(claim: Mapping[str, Any], data: ClaimData) -> dict[str, Any]:
    """Judge a claim; return its row."""
    ((name, arguments),) = claim["quantity"].items()
    numbers: Numbers = dict.fromkeys(("low", "high", *SINGLE), np.nan)
    numbers["paper"] = float(claim.get("paper", "nan"))
    numbers |= getattr(quantities, name)(data, **arguments)
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
