"""The Monte Carlo compared with closed forms and linear theory."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from accelstudy.drawing.style import (
    FULL,
    INK,
    approach_colour,
    approach_handles,
    approach_marker,
    group_label,
    group_of,
    in_order,
    new_figure,
    say_empty,
)
from accelstudy.study.figures.base import Tables, register

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from accelstudy.study.config import StudyConfig

BAND = "#DDDDDD"
GAP = 0.25
"""Space between two groups of parameters, whose width is 1."""


@register(
    "closed-forms",
    "Monte Carlo against closed forms and linear theory",
    """
    Empirical standard deviation of each parameter of each cell over the expected one: from the
    closed forms where they apply (left), from linear theory elsewhere (right). The empirical ones
    are plain, without a control variate, so that they owe nothing to linear theory. The grey band
    is where 95 % of the points are expected from the number of simulated calibrations alone, and
    the share that lies in it is written below. Points are ordered by approach and by that number.
    """,
    tables=("summary",),
    angles=False,
)
def monte_carlo_against_theory(tables: Tables, study: StudyConfig) -> Figure:
    """Ratios of the empirical to the expected sd: where a closed form exists, and all others."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    from accelstudy.basics.shares import Z95

    rows = tables["summary"]
    rows = rows[rows["sd_plain"].notna() & (rows["n_converged"] > 1)]
    rows = rows.assign(
        group=[group_of(name) for name in rows["parameter"]],
        half=Z95 / np.sqrt(2 * (rows["n_converged"] - 1)),
    )
    exact = rows["sd_closed_form"].notna()
    panels = {
        "closed form": (rows[exact], "sd_closed_form"),
        "linear theory (other cells)": (rows[~exact], "sd_linear"),
    }
    groups = [max(len(set(members["group"])), 1) for members, _ in panels.values()]
    fig = new_figure(FULL, 80)
    axes = fig.subplots(1, 2, sharey=True, width_ratios=[max(n, 2) for n in groups])
    for ax, (title, (members, reference)) in zip(axes, panels.items(), strict=True):
        members = members[members[reference].gt(0) & np.isfinite(members[reference])]
        ratio = members["sd_plain"] / members[reference]
        _draw_ratios(ax, members.assign(ratio=ratio))
        ax.set_title(title)
    axes[0].set_ylabel("plain empirical sd / expected sd")
    approaches = [name for name in ("gravity", "robot") if (rows["approach"] == name).any()]
    fig.legend(
        handles=[
            *approach_handles(approaches),
            Patch(color=BAND, label="where 95 % are expected"),
            Line2D([], [], color=INK, linewidth=0.6, label="equal"),
        ],
        loc="outside lower center",
        ncols=4,
    )
    return fig


def _draw_ratios(ax: Axes, rows: pd.DataFrame) -> None:
    """Points of each group side by side, approach after approach, before their expected band."""
    ax.axhline(1, color=INK, linewidth=0.6)
    ax.grid(False, axis="x")
    groups = in_order(rows["group"])
    if not groups:
        ax.set_xticks([])
        say_empty(ax)
        return
    labels = []
    for i, group in enumerate(groups):
        members = rows[rows["group"] == group].sort_values(["approach", "half"], kind="stable")
        x = i * (1 + GAP) + (np.arange(len(members)) + 0.5) / len(members)
        ends = np.linspace(i * (1 + GAP), i * (1 + GAP) + 1, len(members) + 1)
        ax.stairs(
            1 + members["half"], ends, baseline=1 - members["half"], fill=True, color=BAND, zorder=0
        )
        for approach in members["approach"].unique():
            chosen = (members["approach"] == approach).to_numpy()
            ax.plot(
                x[chosen],
                members["ratio"][chosen],
                linestyle="",
                markersize=1.6,
                markeredgewidth=0,
                marker=approach_marker(approach),
                color=approach_colour(approach),
            )
        within = (members["ratio"] - 1).abs() <= members["half"]
        name = group_label(group).replace("non-orthogonality", "non-orthogo-\nnality")
        labels.append(f"{name}\n{100 * within.mean():.0f} %\nof {len(members)}")
    ax.set_xticks([i * (1 + GAP) + 0.5 for i in range(len(groups))], labels)
    ax.tick_params(axis="x", length=0)
    within = (rows["ratio"] - 1).abs() <= rows["half"]
    ax.set_xlabel(f"within the band: {100 * within.mean():.1f} % of {len(rows)} sds")
