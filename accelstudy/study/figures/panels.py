"""The grammar of the figures: small multiples of one tidy table, whose numbers are as shown.

A figure makes a table in the units that people see, says which columns choose the row and the
column of a panel, and gives a function that draws the rows of one panel. What panels have in common
is here: labels, ticks, colour bar and legend, and what stands where there is nothing to draw.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from accelstudy.drawing import style
from accelstudy.study.figures.registry import Axes, DataFrame, Figure, Tables

if TYPE_CHECKING:
    from matplotlib.axis import Axis
    from matplotlib.cm import ScalarMappable
    from matplotlib.lines import Line2D

MAX_PANELS = 12
"""Most rows and most columns of panels; with more none could be read."""
SMALLEST_BIAS = 0.01
"""Smallest bias that is drawn, as a share of the sd. Adjustments have a bias of their own, which is
smaller and yet can be significant."""
ANGLES = ("roll", "pitch")
FAILED: style.Style = {"linestyle": "", "marker": "x", "markersize": 4}
"""Mark of what cannot be estimated, or has not converged."""
BESIDE = {"title": [(-1, 0), (0, -1)], "xlabel": [(1, 0)], "ylabel": [(0, -1)]}
"""Where a panel's neighbours are, down and right, whose label serves for both."""


def panels(
    table: DataFrame,
    draw: Callable[[Axes, DataFrame], ScalarMappable | None],
    height_mm: float,
    *,
    row: str = "",
    column: str = "",
    title: str = "",
    xlabel: str = "",
    ylabel: str = "",
    colours: str = "",
    legend: Sequence[Line2D] = (),
    width: float = style.FULL,
    **shared: Any,
) -> Figure:
    """Draw panels in rows and columns, each with its rows of a tidy table.

    Parameters
    ----------
    table : DataFrame
        Its numbers are in the units shown. A panel without rows is empty, and one whose `value` is
        missing everywhere says so.
    draw : function
        Draws the rows of a panel into its axes. What it returns has the colours of the colour bar.
    height_mm : float, of a row of panels; what stands around them comes on top
    row, column : str, columns of the table whose values choose the place of a panel, in order
    title, xlabel, ylabel : str
        Labels, in which ``{unit}`` is what the column `unit` holds in the panel. A label that the
        panel beside it has, too, stands once. The usual title is the value of the column.
    colours : str, label of the colour bar, if there is one
    legend : handles, below the panels
    width : float, inches
    **shared : as for `Figure.subplots`; usually a row shares its y axis, and a column its x axis
    """
    table = table.reset_index(drop=True)
    rows, columns = (list(table[name].unique()) if name else [""] for name in (row, column))
    left_out = len(rows[MAX_PANELS:]) + len(columns[MAX_PANELS:])
    rows, columns = rows[:MAX_PANELS] or [""], columns[:MAX_PANELS] or [""]
    fig = style.new_figure(width, 20 + len(rows) * height_mm)
    fig.set_layout_engine("constrained", wspace=0, hspace=0)
    shared = {"sharex": "col", "sharey": "row", **shared} if len(table) else {}
    axes = fig.subplots(len(rows), len(columns), squeeze=False, **shared)
    texts = {"title": title or (column and f"{{{column}}}"), "xlabel": xlabel, "ylabel": ylabel}
    labels = {name: np.full(axes.shape, "", object) for name in texts}
    image = None
    for (i, j), ax in np.ndenumerate(axes):
        of_row = table[table[row] == rows[i]] if row else table
        of_column = table[table[column] == columns[j]] if column else table
        part = of_row.loc[of_row.index.intersection(of_column.index)]
        for name, text in texts.items() if len(table) else ():
            alike = part if len(part) else of_row if name == "ylabel" else of_column
            labels[name][i, j] = text.format_map(alike.iloc[0])
        if part.empty:
            style.say_empty(ax, "none" if len(table) else "nothing to show")
            continue
        image = draw(ax, part) or image
        if "value" in part and part["value"].isna().all():
            style.say_empty(ax)
    for name, words in labels.items():
        if name != "title" and not legend and len({*words.flat}) == 1:
            getattr(fig, f"sup{name}")(words[0, 0])
            continue
        for (i, j), ax in np.ndenumerate(axes):
            near = {(i + down, j + right) for down, right in BESIDE[name]}
            if words[i, j] not in {words[at] for at in near.intersection(np.ndindex(axes.shape))}:
                ax.set(**{name: words[i, j]})
    # Each of those aligned asks all others for their extent; panels without a label have none.
    fig.align_ylabels([ax for ax in axes.flat if ax.get_ylabel()])
    if colours and image:
        fig.colorbar(image, ax=axes, label=colours, pad=0.02, aspect=30)
    for ax in fig.axes:
        _set_ticks(ax.xaxis, few=len(columns) > 3)
        _set_ticks(ax.yaxis)
    if legend:
        ncols = style.legend_columns([str(handle.get_label()) for handle in legend], width)
        fig.legend(handles=legend, loc="outside lower center", ncols=ncols)
    if left_out:
        fig.text(0, 0, f"{left_out} more are not drawn; their numbers are in the tables.")
    return fig


def _set_ticks(axis: Axis, few: bool = False) -> None:
    """Make ticks of an axis that is not linear few, and label all of them."""
    low, high = sorted(axis.get_view_interval())
    if axis.get_scale() == "log" and 1e-3 < low < high < 1e5:
        style.log_ticks(axis, low, high, few=few)
    elif axis.get_scale() == "symlog":
        axis.set_major_formatter("{x:g}")
    if axis.get_scale() != "linear":
        axis.set_ticks([], minor=True)


# --- tables --------------------------------------------------------------------------------------


def by_cell(table: DataFrame, column: str) -> dict[str, float]:
    """Numbers of a table that has one row per cell, by the names of the cells."""
    return dict(zip(table["cell"], table[column], strict=True))


def in_shown_units(table: DataFrame, *columns: str) -> DataFrame:
    """Table whose columns, in the recorded unit of the column `unit`, are in the units shown."""
    factors = {unit: float(style.shown(1.0, unit)[0]) for unit in table["unit"].unique()}
    factor = table["unit"].map(factors).astype(float)
    numbers = {name: table[name].astype(float) * factor for name in columns}
    return table.assign(**numbers, unit=[style.shown(1.0, unit)[1] for unit in table["unit"]])


def in_group_order(table: DataFrame) -> DataFrame:
    """Table with the rows of each group of parameters in the order of all figures."""
    order = style.in_order(table["group"])
    return table.sort_values("group", key=lambda names: names.map(order.index), kind="stable")


def accuracies(tables: Tables) -> DataFrame:
    """Accuracy of each cell: a row for each group of parameters, then for roll and for pitch.

    `value` is the mean empirical sd or the rms tilt error in the `unit` shown, NaN if there is
    none; `quantity` says which, and `label` of what. `bias` is the rms bias if it is significant
    for all parameters of the group and above `SMALLEST_BIAS`, and `estimable` says whether all can
    be estimated.
    """
    import pandas as pd

    summary = tables["summary"]
    certain = (summary["bias_ci95_low"] > 0) | (summary["bias_ci95_high"] < 0)
    large = summary["bias"].abs() > SMALLEST_BIAS * summary["sd_empirical"]
    summary = summary.assign(
        group=summary["parameter"].map(style.group_of),
        squared=(summary["bias"] ** 2).where(certain & large, np.inf),
    )
    groups = summary.groupby(["cell", "group", "unit"], sort=False)
    sds = groups.agg(
        value=("sd_empirical", "mean"), squared=("squared", "mean"), estimable=("estimable", "all")
    ).reset_index()
    bias = sds["squared"].where(np.isfinite(sds["squared"])) ** 0.5
    label = sds["group"].map(style.group_label)
    parts = [in_group_order(sds.assign(bias=bias, label=label, quantity="sd"))]
    for angle in ANGLES:
        tilt = pd.DataFrame({"cell": summary["cell"].unique(), "group": angle, "unit": "mgon"})
        rms = tilt["cell"].map(by_cell(tables["leveling"], f"{angle}_rms_mgon"))
        tilt = tilt.assign(value=rms, estimable=rms.notna(), label=f"{angle} error")
        parts.append(tilt.assign(quantity="rms"))
    table = in_shown_units(pd.concat(parts, ignore_index=True), "value", "bias")
    return table.assign(value=table["value"].where(table["value"] > 0))


# --- artists -------------------------------------------------------------------------------------


def points(ax: Axes, rows: DataFrame, x: str = "x", y: str = "y", **look: Any) -> None:
    """Draw a point for each row in the colour and with the marker of its approach."""
    for approach, its in rows.groupby("approach", observed=True):
        colour, marker = style.approach_colour(str(approach)), style.approach_marker(str(approach))
        usual = {"color": colour, "marker": marker, "linestyle": ""}
        ax.plot(its[x].to_numpy(), its[y].to_numpy(), **{**usual, **look})


def key(label: str, **look: Any) -> Line2D:
    """Entry of a legend."""
    from matplotlib.lines import Line2D

    return Line2D([], [], label=label, **{"color": style.INK, **look})


def narrow(label: str) -> str:
    """Label of a group of parameters for the width or the height of a small panel."""
    return label.replace("orthogonality", "orthogo-\nnality")


def surface(
    ax: Axes, x: ArrayLike, y: ArrayLike, values: ArrayLike, **limits: Any
) -> ScalarMappable:
    """Draw values (y, x) as a smooth map."""
    ax.grid(False)
    return ax.pcolormesh(x, y, values, shading="gouraud", rasterized=True, **limits)


def matrix(
    ax: Axes,
    rows: Sequence[str],
    columns: Sequence[str],
    values: NDArray[np.float64],
    texts: NDArray[np.str_],
    **colours: Any,
) -> ScalarMappable:
    """Draw a matrix as fields with texts; its rows and columns have titles.

    Where a value is NaN there is no field.
    """
    ax.grid(False)
    ax.tick_params(length=0)
    ax.set_xticks(range(len(columns)), columns)
    ax.set_yticks(range(len(rows)), rows)
    image = ax.imshow(values, interpolation="none", **colours)
    font: style.Style = {"ha": "center", "va": "center", "fontsize": 6.5, "in_layout": False}
    for (i, j), ink in np.ndenumerate(style.inks_on(image, values)):
        ax.text(j, i, str(texts[i, j]), color=ink, **font)
    return image
