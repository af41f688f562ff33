"""The Monte Carlo compared with closed forms and linear theory, and what it adds to them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from accelstudy.basics.shares import Z95
from accelstudy.basics.units import display_unit, unit_label
from accelstudy.drawing.style import (
    INK,
    Style,
    approach_handles,
    group_label,
    group_of,
    in_order,
    log_ticks,
    model_title,
)
from accelstudy.study.beyond_linear_theory import (
    OFF,
    beyond_linear_theory,
    knows_all,
    noise_when_off,
)
from accelstudy.study.figures.factors import NOISES
from accelstudy.study.figures.panels import DARK, Panel, key, panels, points
from accelstudy.study.figures.registry import Tables, register

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from accelstudy.study.config import Study

BAND = "#DDDDDD"
GAP = 0.25
"""Space between two groups of parameters, whose width is 1."""


@register(
    "closed-forms",
    tables=("summary",),
    angles=False,
)
def monte_carlo_against_theory(tables: Tables, study: Study) -> Figure:
    """Monte Carlo against closed forms and linear theory.

    Empirical standard deviation of each parameter of each cell over the expected one: from the
    closed forms where they apply (left), from linear theory elsewhere (right). The empirical ones
    are plain, without a control variate, so that they owe nothing to linear theory. The grey band
    is where 95 % of the points are expected from the number of simulated calibrations alone, and
    the share that lies in it is written below. Points are ordered by approach and by that number.
    """
    from matplotlib.patches import Patch

    table = ratios_to_theory(tables["summary"])
    row, widths = [], []
    for title, exact in (("closed form", True), ("linear theory (other cells)", False)):
        its = table[table["exact"] == exact]
        share = f"within the band: {100 * its['within'].mean():.1f} % of {len(its)} sds"
        ylabel = "plain empirical sd / expected sd" if exact else ""
        row.append(Panel(its, title, share if len(its) else "", ylabel))
        widths.append(max(its["group"].nunique(), 2))
    fig, _ = panels([row], _draw_ratios, 80, sharey=True, width_ratios=widths)
    approaches = [name for name in ("gravity", "robot") if (table["approach"] == name).any()]
    band = Patch(color=BAND, label="where 95 % are expected")
    handles = [*approach_handles(approaches), band, key("equal", color=INK, linewidth=0.6)]
    fig.legend(handles=handles, loc="outside lower center", ncols=4)
    return fig


def ratios_to_theory(summary: pd.DataFrame) -> pd.DataFrame:
    """Parameters with `ratio`, the plain empirical over the expected sd, and `half` of its band."""
    table = summary[summary["sd_plain"].notna() & (summary["n_converged"] > 1)]
    exact = table["sd_closed_form"].notna()
    expected = table["sd_closed_form"].where(exact, table["sd_linear"])
    half = Z95 / np.sqrt(2 * (table["n_converged"].astype(float) - 1))
    table = table.assign(
        group=table["parameter"].map(group_of),
        exact=exact,
        ratio=table["sd_plain"] / expected,
        half=half,
    )[expected.gt(0) & np.isfinite(expected)]
    return table.assign(within=(table["ratio"] - 1).abs() <= table["half"])


def _draw_ratios(ax: Axes, rows: pd.DataFrame) -> None:
    """Points of each group side by side, approach after approach, before their expected band."""
    ax.axhline(1, color=INK, linewidth=0.6)
    ax.grid(False, axis="x")
    labels = {}
    for i, group in enumerate(in_order(rows["group"])):
        members = rows[rows["group"] == group].sort_values(["approach", "half"], kind="stable")
        start, n, half = i * (1 + GAP), len(members), members["half"].to_numpy(float)
        edges = np.linspace(start, start + 1, n + 1)
        ax.stairs(1 + half, edges, baseline=1 - half, fill=True, color=BAND, zorder=0)
        members = members.assign(x=start + (np.arange(n) + 0.5) / n)
        points(ax, members, y="ratio", markersize=1.6, markeredgewidth=0)
        name = group_label(group).replace("non-orthogonality", "non-orthogo-\nnality")
        labels[start + 0.5] = f"{name}\n{100 * members['within'].mean():.0f} %\nof {n}"
    ax.set_xticks(list(labels), list(labels.values()))
    ax.tick_params(axis="x", length=0)


# --- what simulation adds ------------------------------------------------------------------------

MOST_MODELS = 10
"""Most models of one figure; more would make it too tall."""
ROW_MM = 4.2
APART = 0.18
"""Half the height between two approaches; rows are 1 apart."""
LIMIT: Style = {"alpha": 0.3, "markersize": 3.5, "markeredgewidth": 0}


@register(
    "beyond-linear-theory",
    tables=("cells", "summary"),
    when=knows_all,
    angles=False,
)
def draw_beyond_linear_theory(tables: Tables, study: Study) -> Figure:
    """What simulation adds to linear theory.

    How far simulated calibrations are from linear theory, which knows no bias and one variance.
    Left: bias over standard deviation. Middle: excess of the variance over that of linear theory.
    Right: the noise of the sensor from which the excess is 1 %, all other noise growing in
    proportion; the excess grows with the square of the noise. The dotted line is the noise of the
    study. Each mark is a set-up, with the largest number of the parameters of its group. A pale
    triangle is a limit: the number is not distinguished from zero, and lies beyond the triangle
    where it points. Open markers are variances below those of linear theory. All marks and limits
    of a panel are right together with a probability of 95 %.
    """
    from matplotlib.ticker import NullLocator

    table = largest_of_groups(tables)
    approaches = sorted(set(table["approach"]))
    offset = [2 * approaches.index(name) + 1 - len(approaches) for name in table["approach"]]
    table = table.assign(offset=APART * np.array(offset, float))
    models = list(dict.fromkeys(table["model"]))
    left_out, models = len(models[MOST_MODELS:]), models[:MOST_MODELS]
    groups = {model: in_order(table["group"][table["model"] == model]) for model in models}
    unit = unit_label(display_unit(NOISES[0].unit))
    labels = {
        "bias": "|bias| / sd",
        "excess": "|variance / linear theory − 1|",
        "noise": f"{NOISES[0].title} for {100 * OFF:g} % / {unit}",
    }
    grid = []
    for model in models or [""]:
        its = table[table["model"] == model]
        its = its.assign(y=its["offset"] + [groups[model].index(name) for name in its["group"]])
        lowest = not models or model == models[-1]
        grid.append([
            Panel(
                its[its["quantity"] == quantity],
                model_title(model) if quantity == "bias" else "",
                label if lowest else "",
                nothing="no controlled estimate",
            )
            for quantity, label in labels.items()
        ])  # fmt: skip
    sizes = [len(names) + 1.6 for names in groups.values()] or [6]
    shared: Style = {"sharex": "col", "height_ratios": sizes} if models else {"sharex": "col"}
    height = 24 + ROW_MM * sum(sizes)
    fig, axes = panels(grid, _draw_set_ups, height, loc="left", **shared)
    noises = dict.fromkeys(NOISES[0].shown(table["sensor_sigma_mps2"].unique()))
    for model, row in zip(models, axes, strict=True) if models else ():
        for ax in row:
            ax.set_ylim(len(groups[model]) - 0.5, -0.5)
            ax.set_yticks([])
            ax.set_xscale("log")
            ax.xaxis.set_minor_locator(NullLocator())
        row[0].set_yticks(range(len(groups[model])), map(group_label, groups[model]))
        row[1].axvline(OFF, color=INK, linewidth=0.6)
        for level in noises if len(noises) == 1 else ():
            row[2].axvline(level, color=INK, linewidth=0.8, linestyle=":")
    if models:
        log_ticks(axes[-1, 2].xaxis, *axes[-1, 2].get_xlim())
    if left_out:
        fig.text(0, 0, f"{left_out} more models are not drawn; their numbers are in the tables.")
    below = [key("lower variance", **DARK, marker="o", markerfacecolor="white")]
    handles = [
        *approach_handles(approaches),
        *(below if table["below"].any() else []),
        key("at most", **DARK, **LIMIT, marker="<"),
        key("at least", **DARK, **LIMIT, marker=">"),
        key("linear theory off by 1 %", color=INK, linewidth=0.6),
    ]
    fig.legend(handles=handles, loc="outside lower center", ncols=6)
    return fig


def largest_of_groups(tables: Tables) -> pd.DataFrame:
    """The largest numbers of the parameters of each group: a row per cell, group and `quantity`.

    `size` is NaN where none of the group is distinguished from zero; `limit` then holds for all of
    the group, and at 95 % for all groups and cells together. `below` says that the variance is
    below that of linear theory.
    """
    import pandas as pd

    rows = beyond_linear_theory(tables["cells"], tables["summary"])
    rows = rows.assign(group=[group_of(name) for name in rows["parameter"]])
    keys, tables_of = ["cell", "model", "approach", "sensor_sigma_mps2", "group"], {}
    for name in ("bias", "excess"):
        seen = rows[name].where(rows[name].abs() > rows[f"{name}_half"])
        numbers = {"size": seen.abs(), "limit": rows[name].abs() + rows[f"{name}_half"]}
        by_group = rows.assign(**numbers, lowest=-seen).groupby(keys, sort=False)
        found = by_group[["size", "limit", "lowest"]].max().reset_index()
        below = (found["lowest"] == found["size"]) & (name == "excess")
        tables_of[name] = found.assign(quantity=name, below=below)
    excess = tables_of["excess"]
    noise = NOISES[0].shown(excess["sensor_sigma_mps2"])
    off = {name: noise_when_off(noise, excess[name]) for name in ("size", "limit")}
    tables_of["noise"] = excess.assign(quantity="noise", **off)[excess["sensor_sigma_mps2"] > 0]
    return pd.concat(tables_of.values(), ignore_index=True)


def _draw_set_ups(ax: Axes, rows: pd.DataFrame) -> None:
    """Draw the marks and limits of one quantity of one model, group under group."""
    ax.grid(False, axis="y")
    seen, below = rows["size"].notna(), rows["below"].astype(bool)
    pointing = ">" if (rows["quantity"] == "noise").any() else "<"
    points(ax, rows[~seen], "limit", marker=pointing, **LIMIT)
    points(ax, rows[seen & ~below], "size", markersize=2.5)
    points(ax, rows[seen & below], "size", markersize=2.5, markerfacecolor="white")
