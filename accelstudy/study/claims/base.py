"""What a claim is, the evidence for it, and how it is judged."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from accelstudy.study.cell import Cell
from accelstudy.study.monte_carlo.distributions import Controlled
from accelstudy.study.monte_carlo.statistics import Statistics

Array = NDArray[np.float64]

REPRODUCED = "reproduced"
NOT_REPRODUCED = "not reproduced"
SLIP = "slip in the paper"
HOLDS = "holds"
FAILS = "does not hold"
OPEN = "not decided"


@dataclass(frozen=True)
class Claim:
    """One claim and its verdict; numbers in `unit`, NaN where they do not apply.

    `section` is where the paper makes it, and empty for a claim of this project. `paper` is the
    paper's number, `ours` ours with its 95 % confidence interval; `single_low` and `single_high`
    bound the central 95 % of single simulations, and `percentile` is where the paper's number lies
    in their distribution (default scheme).
    """

    claim: str
    section: str
    statement: str
    unit: str
    paper: float
    ours: float
    ci95_low: float
    ci95_high: float
    verdict: str
    sentence: str
    single_low: float = np.nan
    single_high: float = np.nan
    percentile: float = np.nan


@dataclass(frozen=True)
class SchemeClaim:
    """Distribution of single simulations in one scheme, and where the paper's number lies in it."""

    claim: str
    scheme: str
    paper: float
    mean: float
    single_low: float
    median: float
    single_high: float
    percentile: float


@dataclass(frozen=True)
class Evidence:
    """The evidence by which the claims are judged.

    Attributes
    ----------
    statistics : (scheme, approach) -> what the calibrations with the model of the claims come to
    ratios : (scheme, effect) -> distribution over single simulations of the mean sigma a posteriori
        of the effect's parameters, robot-aided over gravity-based; where both have redundancy
    cells : (scheme, approach) -> Cell
    scheme : str, the default scheme
    correlations : DataFrame, see `accelstudy.study.summary`
    sensitivity : DataFrame, see `accelstudy.leveling.sensitivity`, with a column `analysis`
    shapley : DataFrame, see `accelstudy.leveling.shares`, with a column `analysis`
    base_samples, resamples, seed : of the sensitivity analysis
    beyond : DataFrame, see `accelstudy.study.beyond_linear_theory`; None where linear theory does
        not know all that is simulated
    """

    statistics: Mapping[tuple[str, str], Statistics]
    ratios: Mapping[tuple[str, str], Controlled]
    cells: Mapping[tuple[str, str], Cell]
    scheme: str
    correlations: pd.DataFrame
    sensitivity: pd.DataFrame
    shapley: pd.DataFrame
    base_samples: int
    resamples: int
    seed: int
    beyond: pd.DataFrame | None = None

    @property
    def cell(self) -> Cell:
        """The gravity-based cell of the default scheme."""
        return self.cells[self.scheme, "gravity"]

    @property
    def schemes(self) -> list[str]:
        """Schemes in which both approaches were simulated."""
        return schemes_with_both(self.statistics)


Judge: TypeAlias = "Callable[[Evidence], Iterable[Claim | SchemeClaim]]"
_JUDGES: list[Judge] = []


def register(judge: Judge) -> Judge:
    """Register a function that judges claims, and says how they stand in each scheme."""
    _JUDGES.append(judge)
    return judge


def judge(evidence: Evidence) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Judge all claims.

    Returns
    -------
    claims : DataFrame, one row per `Claim`, by section, then slips, then those of this project
    by_scheme : DataFrame, one row per `SchemeClaim`
    """
    rows = [row for judge_family in _JUDGES for row in judge_family(evidence)]
    claims = [row for row in rows if isinstance(row, Claim)]
    claims.sort(key=lambda claim: (not claim.section, claim.verdict == SLIP, claim.section))
    by_scheme = [row for row in rows if isinstance(row, SchemeClaim)]
    return pd.DataFrame(claims), pd.DataFrame(by_scheme)


def schemes_with_both(pairs: Iterable[tuple[str, str]]) -> list[str]:
    """Schemes that occur with both approaches, in order."""
    pairs = list(pairs)
    return [s for s, approach in pairs if approach == "gravity" and (s, "robot") in pairs]


def verdict(holds: bool) -> str:
    """Verdict on a claim that holds or does not."""
    return REPRODUCED if holds else NOT_REPRODUCED
