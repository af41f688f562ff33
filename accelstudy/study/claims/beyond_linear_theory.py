"""Claims of this project: what simulation adds to linear theory."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from accelstudy.basics.wording import counted, number
from accelstudy.study.beyond_linear_theory import OFF, noise_when_off
from accelstudy.study.claims.base import FAILS, HOLDS, OPEN, Claim, Evidence, register

Mask = NDArray[np.bool_]

BIAS = 0.01
"""Largest bias over the standard deviation that nobody has to care for."""
NOISIER = 3.0
"""Times the noise up to which linear theory is to be right: half an order of magnitude."""
MOST = 10
"""Most set-ups that a sentence names."""


class _Statement(NamedTuple):
    """A claim on the largest of a column of the evidence.

    Attributes
    ----------
    name, says : str, of the claim; what it says
    column : str, "bias" or "excess"
    limit : float, of the column
    unit, shown : the number that a reader sees for one of the column, in this unit
    bound : str, what a limit of that number is
    """

    name: str
    says: str
    column: str
    limit: float
    unit: str
    shown: Callable[[float], float]
    bound: str


_STATEMENTS = (
    _Statement(
        "bias-small",
        f"the bias of every parameter is below {100 * BIAS:g} % of its sd",
        *("bias", BIAS, "%", lambda share: 100 * share, "at most"),
    ),
    _Statement(
        "variance-linear",
        f"the variance of every parameter is within {100 * OFF:g} % of that of linear theory",
        *("excess", OFF, "%", lambda share: 100 * share, "at most"),
    ),
    _Statement(
        "noise-when-off",
        f"linear theory is off by {100 * OFF:g} % only from {NOISIER:g} times that noise on",
        *("excess", OFF / NOISIER**2, "ratio"),
        *(lambda share: float(noise_when_off(1.0, share)), "at least"),
    ),
)


@register
def claims_beyond_linear_theory(evidence: Evidence) -> Iterable[Claim]:
    """Judge each statement for each approach, by all models and schemes at the paper's noise."""
    if evidence.beyond is None:
        return
    sigma = evidence.cell.noise.sigma_force
    rows = evidence.beyond[evidence.beyond["sensor_sigma_mps2"] == sigma]
    for statement in _STATEMENTS:
        for approach in sorted(set(rows["approach"])):
            yield _claim(statement, rows[rows["approach"] == approach], approach, sigma)


def _claim(statement: _Statement, rows: pd.DataFrame, approach: str, sigma: float) -> Claim:
    """Judge a statement by the rows of an approach, of which there are some."""
    size, half = rows[statement.column].abs(), rows[f"{statement.column}_half"]
    numbers = rows.assign(size=size, low=(size - half).clip(lower=0), high=size + half)
    of_setup = numbers.groupby(["model", "scheme"], observed=True, sort=False)
    setups = of_setup[["size", "low", "high"]].max().reset_index()
    fails = (setups["low"] > statement.limit).to_numpy()
    undecided = ~fails & (setups["high"] >= statement.limit).to_numpy()
    verdict = FAILS if fails.any() else OPEN if undecided.any() else HOLDS
    low, high = sorted(statement.shown(float(setups[name].max())) for name in ("low", "high"))
    return Claim(
        claim=f"{statement.name}-{approach}",
        section="",
        statement=f"by {approach}, at a noise of {sigma * 1000:g} mm/s², {statement.says}",
        unit=statement.unit,
        paper=np.nan,
        ours=statement.shown(float(setups["size"].max())),
        ci95_low=low,
        ci95_high=high,
        verdict=verdict,
        sentence=_sentence(statement, setups, fails, undecided),
    )


def _sentence(statement: _Statement, setups: pd.DataFrame, fails: Mask, undecided: Mask) -> str:
    """Say where it fails or is not decided, and how large the number can be elsewhere."""
    unit = " times" if statement.unit == "ratio" else f" {statement.unit}"

    def said(value: float) -> str:
        return f"{number(statement.shown(value))}{unit}"

    def named(chosen: pd.DataFrame) -> str:
        each = zip(chosen["scheme"], chosen["model"], chosen["size"], strict=True)
        names = [f"{scheme} with {model} ({said(size)})" for scheme, model, size in each]
        return ", ".join([*names[:MOST], *([f"{len(names) - MOST} more"] if names[MOST:] else [])])

    parts = []
    if fails.any():
        of = counted(len(setups), "set-up")
        parts.append(f"Not so in {fails.sum()} of {of}: {named(setups[fails])}.")
    if undecided.any():
        of = counted(int(undecided.sum()), "set-up")
        parts.append(f"Not decided in {of}: {named(setups[undecided])}.")
    others = setups[~fails & ~undecided].groupby("model", observed=True, sort=False)["high"].max()
    if len(others):
        where = "Elsewhere" if parts else f"In {counted(len(setups), 'set-up')}"
        each = (f"{said(value)} with {model}" for model, value in others.items())
        parts.append(f"{where} {statement.bound} {', '.join(each)}.")
    return " ".join(parts)
