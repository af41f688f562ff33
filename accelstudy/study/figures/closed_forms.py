"""The Monte Carlo compared with closed forms and linear theory."""

from __future__ import annotations

import numpy as np

from accelstudy.basics.shares import Z95
from accelstudy.drawing import style
from accelstudy.study.figures.panels import key, narrow, panels, points
from accelstudy.study.figures.registry import Axes, DataFrame, Figure, Study, Tables, register

BAND = "#DDDDDD"
GAP = 0.25
"""Space between two groups of parameters, whose width is 1."""


@register("closed-forms", "summary", angles=False)
def monte_carlo_against_theory(tables: Tables, study: Study) -> Figure:
    """Monte Carlo against closed forms and linear theory.

    Empirical standard deviation of each parameter of each cell over the expected one: from the
    closed forms where they apply (left), from linear theory elsewhere (right). The empirical ones
    are plain, without a control variate, so that they owe nothing to linear theory. The grey band
    is where 95 % of the points are expected from the number of simulated calibrations alone, and
    the share that lies in it is written below. Points are ordered by approach and by that number.
    """
    table = ratios_to_theory(tables["summary"])

    def draw(ax: Axes, rows: DataFrame) -> None:
        ax.axhline(1, color=style.INK, linewidth=0.6)
        ax.grid(False, axis="x")
        groups = style.sort_groups(rows["group"])
        for i, group in enumerate(groups):
            members = rows[rows["group"] == group].sort_values(["approach", "half"])
            members = members.assign(x=i * (1 + GAP) + np.linspace(0, 1, len(members)))
            low, high = 1 - members["half"], 1 + members["half"]
            ax.fill_between(members["x"], low, high, step="mid", color=BAND, linewidth=0)
            points(ax, members, y="ratio", markersize=1.6, markeredgewidth=0)
        names = [narrow(style.group_label(group)) for group in groups]
        ax.set_xticks(np.arange(len(groups)) * (1 + GAP) + 0.5, names)
        ax.tick_params(axis="x", length=0)

    legend = [
        *style.approach_handles(table["approach"].unique()),
        key("where 95 % are expected", color=BAND, linewidth=6),
        key("equal", linewidth=0.6),
    ]
    return panels(
        table,
        draw,
        60,
        column="theory",
        xlabel="within the band: {share}",
        ylabel="plain empirical sd / expected sd",
        legend=legend,
        width_ratios=table.groupby("theory")["group"].nunique().clip(lower=2),
    )


def ratios_to_theory(summary: DataFrame) -> DataFrame:
    """Parameters with `ratio`, the plain empirical over the expected sd, and `half` of its band.

    `share` says how many of all that are compared with the same `theory` lie within the band.
    """
    exact = summary["sd_closed_form"].notna()
    expected = summary["sd_closed_form"].where(exact, summary["sd_linear"])
    table = summary.assign(
        group=summary["parameter"].map(style.group_of),
        theory=np.where(exact, "closed form", "linear theory (other cells)"),
        ratio=summary["sd_plain"] / expected,
        half=Z95 / np.sqrt(2 * (summary["n_converged"].astype(float).clip(lower=2) - 1)),
    )
    table = table[(summary["n_converged"] > 1) & np.isfinite(table["ratio"])]
    within = (table["ratio"] - 1).abs() <= table["half"]
    shares = {
        theory: f"{100 * its.mean():.1f} % of {len(its)} sds"
        for theory, its in within.groupby(table["theory"])
    }
    return table.assign(share=table["theory"].map(shares)).sort_values("theory", kind="stable")
