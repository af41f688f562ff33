"""The Monte Carlo compared with closed forms and linear theory, and what it adds to them."""

from __future__ import annotations

import numpy as np

from accelstudy.basics.shares import Z95
from accelstudy.drawing import style
from accelstudy.study.beyond_linear_theory import (
    MIN_NONLINEAR_SHARE,
    beyond_linear_theory,
    knows_all,
    noise_when_off,
)
from accelstudy.study.figures.factors import NOISES
from accelstudy.study.figures.panels import MAX_PANELS, key, narrow, panels, points
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
        groups = style.in_order(rows["group"])
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


# --- what simulation adds ------------------------------------------------------------------------

APPROACH_DISTANCE = 0.36
"""Height between two approaches; rows are 1 apart."""
LIMIT: style.Style = {"alpha": 0.3, "markersize": 3.5, "markeredgewidth": 0}
ROW_MM = 4.2


@register("beyond-linear-theory", "cells", "summary", when=knows_all, angles=False)
def draw_beyond_linear_theory(tables: Tables, study: Study) -> Figure:
    """What simulation adds to linear theory.

    How far simulated calibrations are from linear theory, which knows no bias and one variance.
    Left: bias over standard deviation. Middle: excess of the variance over that of linear theory.
    Right: the noise of the sensor from which the excess is 1 %, all other noise growing in
    proportion; the excess grows with the square of the noise. Dotted lines are an excess of 1 %,
    and the study's noise. Each mark is a set-up, with the largest number of the parameters of its
    group. A pale triangle is a limit: the number is not distinguished from zero, and lies beyond
    the triangle where it points. All marks and limits of a panel are right together with a
    probability of 95 %.
    """
    table = largest_of_groups(tables)
    approaches = sorted(set(table["approach"]))
    lines = {"excess": MIN_NONLINEAR_SHARE, "noise": float(NOISES[0].shown(study.sigma_force))}

    def draw(ax: Axes, rows: DataFrame) -> None:
        groups, seen = style.in_order(rows["group"]), rows["size"].notna()
        offset = rows["approach"].map(approaches.index) - (len(approaches) - 1) / 2
        rows = rows.assign(y=rows["group"].map(groups.index) + APPROACH_DISTANCE * offset)
        quantity = rows["quantity"].iloc[0]
        if quantity in lines:
            ax.axvline(lines[quantity], color=style.INK, linewidth=0.8, linestyle=":")
        points(ax, rows[seen], "size", markersize=2.5)
        points(ax, rows[~seen], "limit", marker=">" if quantity == "noise" else "<", **LIMIT)
        ax.set_xscale("log")
        ax.set_ylim(len(groups) - 0.5, -0.5)
        ax.set_yticks(range(len(groups)), map(style.group_label, groups))
        ax.grid(False, axis="y")

    sizes = table.groupby("title", sort=False)["group"].nunique()[:MAX_PANELS] + 1.6
    legend = [
        *style.approach_handles(approaches),
        key("at most", linestyle="", marker="<", **LIMIT),
        key("at least", linestyle="", marker=">", **LIMIT),
    ]
    return panels(
        table,
        draw,
        ROW_MM * sizes.mean() if len(table) else ROW_MM,
        row="title",
        column="label",
        title="{title}",
        xlabel="{label}",
        legend=legend,
        height_ratios=sizes,
    )


def largest_of_groups(tables: Tables) -> DataFrame:
    """The largest numbers of the parameters of each group: a row per cell, group and `quantity`.

    `size` is NaN where none of the group is distinguished from zero; `limit` then holds for all of
    the group, and at 95 % for all groups and cells together.
    """
    import pandas as pd

    rows = beyond_linear_theory(tables["cells"], tables["summary"])
    rows = rows.assign(
        group=rows["parameter"].map(style.group_of),
        title=rows["model"].map(style.model_title),
        noise=NOISES[0].shown(rows["sensor_sigma_mps2"]),
    )
    parts = []
    for name, label in (("bias", "|bias| / sd"), ("excess", "|variance / linear theory − 1|")):
        size, half = rows[name].abs(), rows[f"{name}_half"]
        numbers = {"size": size.where(size > half), "limit": size + half}
        parts.append(rows.assign(quantity=name, label=label, **numbers))
    keys = ["cell", "title", "approach", "group", "noise", "quantity", "label"]
    table = pd.concat(parts).groupby(keys, sort=False)[["size", "limit"]].max().reset_index()
    excess = table[(table["quantity"] == "excess") & (table["noise"] > 0)]
    off = {name: noise_when_off(excess["noise"], excess[name]) for name in ("size", "limit")}
    label = f"{NOISES[0].title} for {100 * MIN_NONLINEAR_SHARE:g} % / {NOISES[0].shown_unit}"
    return pd.concat([table, excess.assign(quantity="noise", label=label, **off)])
