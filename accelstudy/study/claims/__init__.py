"""The claims of Thalmann & Neuner (2018), each held against the Monte Carlo.

The paper shows one simulation, with standard deviations a posteriori. So a number of the paper
counts as reproduced if ours agrees with it within the rounding in which it is given, or if it lies
within the central 95 % of what single simulations of the same set-up show. Nothing is tuned to meet
a number; where one is not met, the verdict says by how much.
"""

from __future__ import annotations

import pandas as pd

from accelstudy.study.claims.base import (
    NOT_REPRODUCED,
    REPRODUCED,
    SLIP,
    Claim,
    Evidence,
    SchemeClaim,
)
from accelstudy.study.claims.calibration import calibration_claims, claims_by_scheme
from accelstudy.study.claims.evidence import evidence_from
from accelstudy.study.claims.leveling import leveling_claims
from accelstudy.study.claims.sensitivity import sensitivity_claims
from accelstudy.study.claims.slips import slips

__all__ = [
    "NOT_REPRODUCED",
    "REPRODUCED",
    "SLIP",
    "Claim",
    "Evidence",
    "SchemeClaim",
    "evidence_from",
    "judge",
]


def judge(evidence: Evidence) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Judge all claims.

    Returns
    -------
    claims : DataFrame, one row per `Claim`
    by_scheme : DataFrame, one row per `SchemeClaim`
    """
    by_scheme = claims_by_scheme(evidence)
    claims = [
        *leveling_claims(evidence),
        *sensitivity_claims(evidence),
        *calibration_claims(evidence, by_scheme),
        *slips(evidence),
    ]
    return pd.DataFrame(claims), pd.DataFrame(by_scheme)
