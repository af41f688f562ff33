"""What a claim is, what it is judged on, and how."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from accelstudy.study.cells import Cell
from accelstudy.study.summary import Fits

Array = NDArray[np.float64]

REPRODUCED = "reproduced"
NOT_REPRODUCED = "not reproduced"
SLIP = "slip in the paper"


@dataclass(frozen=True)
class Claim:
    """One claim and what became of it; numbers in `unit`, NaN where they do not apply.

    `paper` is the paper's number, `ours` ours with its 95 % confidence interval; `single_low` and
    `single_high` bound the central 95 % of single simulations, and `percentile` is where the
    paper's number lies in their distribution (default scheme).
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
    """What the claims are judged on.

    Attributes
    ----------
    fits : (scheme, approach) -> calibrations with the model of the claims
    cells : (scheme, approach) -> Cell
    scheme : str, the default scheme
    correlations : DataFrame, see `accelstudy.study.summary`
    sensitivity : DataFrame, see `accelstudy.sensitivity`, with a column `analysis`
    base_samples, resamples, seed : of the sensitivity analysis
    """

    fits: Mapping[tuple[str, str], Fits]
    cells: Mapping[tuple[str, str], Cell]
    scheme: str
    correlations: pd.DataFrame
    sensitivity: pd.DataFrame
    base_samples: int
    resamples: int
    seed: int

    @property
    def cell(self) -> Cell:
        """The gravity-based cell of the default scheme."""
        return self.cells[self.scheme, "gravity"]

    @property
    def schemes(self) -> list[str]:
        """Schemes in which both approaches were simulated."""
        return [
            s for s, approach in self.fits if approach == "gravity" and (s, "robot") in self.fits
        ]


def evidence_from(cells: Iterable[Cell], estimates: pd.DataFrame, **rest: Any) -> Evidence:
    """Collect the evidence from cells and the table of their estimates; `rest` as in `Evidence`."""
    groups = dict(iter(estimates.groupby("cell", observed=True)))
    by_key = {(cell.scheme, cell.approach): cell for cell in cells if cell.name in groups}
    fits = {key: Fits.of(cell, groups[cell.name]) for key, cell in by_key.items()}
    return Evidence(fits=fits, cells=by_key, **rest)


def verdict(holds: bool) -> str:
    """Verdict on a claim of which it is known whether it holds."""
    return REPRODUCED if holds else NOT_REPRODUCED
