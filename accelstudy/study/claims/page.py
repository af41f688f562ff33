"""Tables for people: the claims and their verdicts as a page and as Markdown."""

from __future__ import annotations

import math

import pandas as pd

from accelstudy.basics.wording import interval, number

SWEEP = "config/sweeps/positions.yaml"
"""A study for readers of the claims who want one of their own."""


def claims_page(claims: pd.DataFrame, by_scheme: pd.DataFrame) -> str:
    """Page (HTML, self-contained) with all claims and their verdicts."""
    from accelstudy.pages import render  # which shows numbers as here

    return render(
        "study/claims/page.html.j2",
        claims=claims.to_dict("records"),
        schemes=by_scheme.to_dict("records"),
        next_steps=[
            ("See what another study would run", f"accelstudy cells config/config.yaml {SWEEP}"),
            ("Run it", f"snakemake --cores 2 --configfile {SWEEP}"),
        ],
    )


def claims_markdown(claims: pd.DataFrame) -> str:
    """The claims as a table in Markdown, one row each."""
    lines = [
        "| section | claim | paper | ours (95 % interval) | verdict | |",
        "|---|---|---|---|---|---|",
    ]
    for row in claims.to_dict("records"):
        unit = "" if row["unit"] in ("1", "ratio") else f" {row['unit']}"
        paper = "–" if math.isnan(row["paper"]) else f"{number(row['paper'])}{unit}"
        ours = f"{number(row['ours'])}{unit}"
        spread = interval(row["ci95_low"], row["ci95_high"])
        ours += f" ({spread})" if spread else ""
        lines.append(
            f"| {row['section']} | {row['statement']} | {paper} | {ours} | "
            f"**{row['verdict']}** | {row['sentence']} |"
        )
    return "\n".join(lines) + "\n"
