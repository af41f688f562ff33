"""What simulation adds to linear theory, which knows no bias and one variance."""

from __future__ import annotations

import numpy as np
import scipy

from accelstudy.drawing import style
from accelstudy.study.figures.factors import NOISES
from accelstudy.study.figures.panels import MAX_PANELS, handle, panels, points
from accelstudy.study.figures.registry import Axes, DataFrame, Figure, Study, Tables, register

MIN_NONLINEAR_SHARE = 0.01
"""Share of the variance from which linear theory counts as off."""
APPROACH_DISTANCE = 0.36
"""Height between two approaches; rows are 1 apart."""
LIMIT: style.Style = {"alpha": 0.3, "markersize": 3.5, "markeredgewidth": 0}
ROW_MM = 4.2


@register(
    *("beyond-linear-theory", "cells", "summary"),
    # Calibrations know of all that is simulated, and linear theory with them.
    when=lambda study: study.simulated_effects is None and not study.noise.effects,
    angles=False,
)
def beyond_linear_theory(tables: Tables, study: Study) -> Figure:
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
        groups, seen = style.sort_groups(rows["group"]), rows["size"].notna()
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
        handle("at most", linestyle="", marker="<", **LIMIT),
        handle("at least", linestyle="", marker=">", **LIMIT),
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

    rows = bias_and_excess(tables["cells"], tables["summary"])
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
    # The excess grows with the square of the noise; where there is none, that noise is infinite.
    off = {
        name: excess["noise"] * np.sqrt(MIN_NONLINEAR_SHARE / excess[name])
        for name in ("size", "limit")
    }
    label = f"{NOISES[0].title} for {100 * MIN_NONLINEAR_SHARE:g} % / {NOISES[0].shown_unit}"
    return pd.concat([table, excess.assign(quantity="noise", label=label, **off)])


def bias_and_excess(cells: DataFrame, summary: DataFrame) -> DataFrame:
    """Bias and excess of the variance of each parameter of each cell, with their uncertainties.

    Parameters
    ----------
    cells, summary : tables of a study

    Returns
    -------
    DataFrame
        Rows of `summary` with `bias` over the standard deviation, `excess` (the variance over that
        of linear theory, less 1), and `bias_half` and `excess_half`: half the width of intervals
        that hold all numbers of their column together with a probability of 95 %.
    """
    compared = (cells["control"] == "linear") & (cells["n_converged"] > 1)
    compared &= cells["gravity_error_mps2"] == 0
    rows = summary[summary["cell"].isin(cells["cell"][compared])]
    relative = (rows["sd_empirical"] / rows["sd_linear"]) ** 2
    errors = {
        "bias": rows["bias_se"] / rows["sd_empirical"],
        "excess": 2 * relative * rows["sd_se"] / rows["sd_empirical"],
    }
    rows = rows.assign(bias=rows["bias"] / rows["sd_empirical"], excess=relative - 1)
    known = np.isfinite(errors["bias"]) & np.isfinite(errors["excess"])
    both_tails = 0.05 / max(int(known.sum()), 1)
    sigmas = scipy.special.stdtrit(rows["n_converged"] - 1, 1 - both_tails / 2)
    halves = {f"{name}_half": sigmas * error for name, error in errors.items()}
    return rows.assign(**halves)[known]
