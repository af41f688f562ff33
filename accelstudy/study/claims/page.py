"""The judged claims as a page and as Markdown."""

from __future__ import annotations

from typing import Any

import pandas as pd

from accelstudy.basics.wording import interval, number

SWEEP = "config/sweeps/positions.yaml"
"""A study for readers of the claims who want one of their own."""
Rows = list[dict[Any, str]]
"""Rows of a table, each with its texts by the heads of the columns."""


def claims_page(claims: pd.DataFrame) -> str:
    """Page (HTML, self-contained) with all claims and their verdicts."""
    from accelstudy.pages import render  # which shows numbers as here

    return render(
        "study/claims/page.html.j2",
        claims=claim_rows(claims),
        next_steps=[
            ("See what another study would run", f"accelstudy cells config/config.yaml {SWEEP}"),
            ("Run it", f"snakemake --cores 2 --configfile {SWEEP}"),
        ],
    )


def claims_markdown(claims: pd.DataFrame) -> str:
    """The claims as a table in Markdown, one row each."""
    rows = claim_rows(claims)
    bold = [{**row, "verdict": f"**{row['verdict']}**"} for row in rows]
    lines = [[*rows[0]], ["---"] * len(rows[0]), *(row.values() for row in bold)]
    return "".join(f"| {' | '.join(cells)} |\n" for cells in lines)


def claim_rows(claims: pd.DataFrame) -> Rows:
    """Return what readers see of the claims."""
    rows = []
    for claim in claims.to_dict("records"):
        unit = "" if claim["unit"] in ("1", "ratio") else f" {claim['unit']}"
        spread = interval(claim["ci95_low"], claim["ci95_high"])
        ours = f"{number(claim['ours'])}{unit}" + (f" ({spread})" if spread else "")
        row = {
            "section": claim["section"],
            "claim": claim["statement"],
            "paper": "–" if pd.isna(claim["paper"]) else f"{number(claim['paper'])}{unit}",
            "ours (95 % interval)": ours,
            "verdict": claim["verdict"],
            "why": claim["sentence"],
        }
        rows.append(row)
    return rows
