"""What simulation adds to linear theory: bias, variance, and the noise from which it matters."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from accelstudy.basics.units import display_unit, unit_label
from accelstudy.drawing.style import (
    FULL,
    INK,
    Style,
    approach_colour,
    approach_handles,
    approach_marker,
    group_label,
    group_of,
    in_order,
    log_ticks,
    model_title,
    new_figure,
    say_empty,
)
from accelstudy.study.beyond_linear_theory import (
    OFF,
    beyond_linear_theory,
    knows_all,
    noise_when_off,
)
from accelstudy.study.figures.base import Tables, register
from accelstudy.study.figures.factors import NOISES

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from accelstudy.study.config import StudyConfig

MOST_MODELS = 10
"""Most models of one figure; more would make it too tall."""
ROW_MM = 4.2
APART = 0.18
"""Half the height between two approaches; rows are 1 apart."""
LIMIT: Style = {"alpha": 0.3, "markersize": 3.5, "markeredgewidth": 0}


@register(
    "beyond-linear-theory",
    "What simulation adds to linear theory",
    """
    How far simulated calibrations are from linear theory, which knows no bias and one variance.
    Left: bias over standard deviation. Middle: excess of the variance over that of linear theory.
    Right: the noise of the sensor from which the excess is 1 %, all other noise growing in
    proportion; the excess grows with the square of the noise. The dotted line is the noise of the
    study. Each mark is a set-up, with the largest number of the parameters of its group. A pale
    triangle is a limit: the number is not distinguished from zero, and lies beyond the triangle
    where it points. Open markers are variances below those of linear theory. All marks and limits
    of a panel are right together with a probability of 95 %.
    """,
    tables=("cells", "summary"),
    when=knows_all,
    angles=False,
)
def draw_beyond_linear_theory(tables: Tables, study: StudyConfig) -> Figure:
    """A row of three panels for each model, with a line for each group of parameters."""
    from matplotlib.lines import Line2D
    from matplotlib.ticker import NullLocator

    rows = _numbers(tables)
    approaches = sorted(set(rows["approach"]))
    places = {name: APART * (2 * k + 1 - len(approaches)) for k, name in enumerate(approaches)}
    models = list(dict.fromkeys(rows["model"]))
    left_out, models = len(models[MOST_MODELS:]), models[:MOST_MODELS]
    groups = {model: in_order(rows["group"][rows["model"] == model]) for model in models}
    sizes = [len(names) + 1.6 for names in groups.values()] or [6]
    fig = new_figure(FULL, 24 + ROW_MM * sum(sizes))
    panels = fig.subplots(len(sizes), 3, sharex="col", squeeze=False, height_ratios=sizes)
    if not models:
        for ax in panels[0]:
            say_empty(ax, "no controlled estimate")
    for axes, model in zip(panels, models, strict=False):
        members = rows[rows["model"] == model]
        axes[0].set_title(model_title(model), loc="left")
        for ax, quantity in zip(axes, ("bias", "excess", "noise"), strict=True):
            _draw(ax, members, groups[model], quantity, places)
        axes[0].set_yticks(range(len(groups[model])), map(group_label, groups[model]))
    noise, unit = NOISES[0], unit_label(display_unit(NOISES[0].unit))
    at = dict.fromkeys(noise.shown(rows["sensor_sigma_mps2"].unique()))
    for bias, excess, sigma in panels if models else ():
        for ax in (bias, excess, sigma):
            ax.set_xscale("log")
            ax.xaxis.set_minor_locator(NullLocator())
        excess.axvline(OFF, color=INK, linewidth=0.6)
        for level in at if len(at) == 1 else ():
            sigma.axvline(level, color=INK, linewidth=0.8, linestyle=":")
    if models:
        log_ticks(panels[-1, 2].xaxis, *panels[-1, 2].get_xlim())
    panels[-1, 0].set_xlabel("|bias| / sd")
    panels[-1, 1].set_xlabel("|variance / linear theory − 1|")
    panels[-1, 2].set_xlabel(f"{noise.title} for {100 * OFF:g} % / {unit}")
    if left_out:
        fig.text(0, 0, f"{left_out} more models are not drawn; their numbers are in the tables.")
    dark: Style = {"linestyle": "", "color": INK}
    below = Line2D([], [], marker="o", markerfacecolor="white", **dark, label="lower variance")
    fig.legend(
        handles=[
            *approach_handles(approaches),
            *([below] if rows["below"].any() else []),
            Line2D([], [], marker="<", **dark, **LIMIT, label="at most"),
            Line2D([], [], marker=">", **dark, **LIMIT, label="at least"),
            Line2D([], [], color=INK, linewidth=0.6, label="linear theory off by 1 %"),
        ],
        loc="outside lower center",
        ncols=6,
    )
    return fig


def _numbers(tables: Tables) -> pd.DataFrame:
    """One row per cell and group: the numbers largest in the group, each signed, and the limits.

    A number is NaN where none of the group is distinguished from zero; the limit then holds for all
    of the group, and at 95 % for all groups and cells together.
    """
    rows = beyond_linear_theory(tables["cells"], tables["summary"])
    rows = rows.assign(group=[group_of(name) for name in rows["parameter"]])
    for name in ("bias", "excess"):
        size, half = rows[name].abs(), rows[f"{name}_half"]
        seen = rows[name].where(size > half)
        columns = {name: seen, f"{name}_size": seen.abs(), f"{name}_limit": size + half}
        rows = rows.assign(**columns)
    keys = ["cell", "model", "approach", "sensor_sigma_mps2", "group"]
    by_group = rows.groupby(keys, sort=False)
    found = by_group[[f"{n}_{what}" for n in ("bias", "excess") for what in ("size", "limit")]]
    table = found.max().reset_index()
    noise = NOISES[0].shown(table["sensor_sigma_mps2"])
    return table.assign(
        below=-by_group["excess"].min().to_numpy() == table["excess_size"],
        noise_size=noise_when_off(noise, table["excess_size"]),
        noise_limit=noise_when_off(noise, table["excess_limit"]),
    )


def _draw(
    ax: Axes, rows: pd.DataFrame, groups: list[str], quantity: str, places: dict[str, float]
) -> None:
    """Draw the marks and limits of one quantity of one model, group under group."""
    ax.set_ylim(len(groups) - 0.5, -0.5)
    ax.set_yticks([])
    ax.grid(False, axis="y")
    if quantity == "noise":
        rows = rows[rows["sensor_sigma_mps2"] > 0]
    for approach, place in places.items():
        members = rows[rows["approach"] == approach]
        y = np.array([groups.index(name) for name in members["group"]]) + place
        seen = members[f"{quantity}_size"].notna().to_numpy()
        below = seen & members["below"].to_numpy() & (quantity != "bias")
        style: Style = {"linestyle": "", "color": approach_colour(approach)}
        limits = members[f"{quantity}_limit"].to_numpy()
        pointing = ">" if quantity == "noise" else "<"
        ax.plot(limits[~seen], y[~seen], pointing, **style, **LIMIT)
        sizes, marker = members[f"{quantity}_size"].to_numpy(), approach_marker(approach)
        style |= {"marker": marker, "markersize": 2.5}
        ax.plot(sizes[seen & ~below], y[seen & ~below], **style)
        ax.plot(sizes[below], y[below], **style, markerfacecolor="white")
