"""The judged claims as a page and as Markdown."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import pandas as pd

from accelstudy.basics.wording import interval, number

SWEEP = "config/sweeps/positions.yaml"
"""A study for readers of the claims who want one of their own."""


def claims_page(claims: pd.DataFrame, by_scheme: pd.DataFrame) -> str:
    """Page (HTML, self-contained) with all claims and their verdicts."""
    from accelstudy.pages import render  # which shows numbers as here

    papers, own = _papers_and_own(claims)
    return render(
        "study/claims/page.html.j2",
        papers=papers,
        own=own,
        schemes=by_scheme.to_dict("records"),
        next_steps=[
            ("See what another study would run", f"accelstudy cells config/config.yaml {SWEEP}"),
            ("Run it", f"snakemake --cores 2 --configfile {SWEEP}"),
        ],
    )


def claims_markdown(claims: pd.DataFrame) -> str:
    """The claims as tables in Markdown, one row each: those of the paper, then of this project."""
    papers, own = _papers_and_own(claims)
    lines = [
        "| section | claim | paper | ours (95 % interval) | verdict | |",
        "|---|---|---|---|---|---|",
    ]
    for row in papers:
        paper = "–" if math.isnan(row["paper"]) else f"{number(row['paper'])}{row['unit']}"
        lines.append(f"| {row['section']} | {row['statement']} | {paper} | {_judged(row)}")
    if own:
        lines += ["", "| claim of this project | found (95 % interval) | verdict | |"]
        lines += ["|---|---|---|---|"]
        lines += [f"| {row['statement']} | {_judged(row)}" for row in own]
    return "\n".join(lines) + "\n"


def _papers_and_own(claims: pd.DataFrame) -> tuple[list[dict[Any, Any]], list[dict[Any, Any]]]:
    """Claims of the paper, and those of this project, each unit as it follows a number."""
    shown = claims.assign(unit=["" if u in ("1", "ratio") else f" {u}" for u in claims["unit"]])
    papers, own = (shown[(shown["section"] != "") == paper] for paper in (True, False))
    return papers.to_dict("records"), own.to_dict("records")


def _judged(row: Mapping[Any, Any]) -> str:
    """Number, verdict and sentence, as the last cells of a row in Markdown."""
    spread = interval(row["ci95_low"], row["ci95_high"])
    ours = f"{number(row['ours'])}{row['unit']}" + (f" ({spread})" if spread else "")
    return f"{ours} | **{row['verdict']}** | {row['sentence']} |"
