"""The grammar of the figures: small multiples of one tidy table, whose numbers are as shown.

A figure makes a table in the units that people see, says which columns choose the row and the
column of a panel, and gives a function that draws the rows of one panel. What panels have in common
is here: labels, ticks, colour bar and legend, and what stands where there is nothing to draw.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from accelstudy.drawing import style
from accelstudy.study.figures.registry import Axes, DataFrame, Figure, Tables

if TYPE_CHECKING:
    import matplotlib.cm
    import matplotlib.lines
    from matplotlib.axis import Axis

Image: TypeAlias = "matplotlib.cm.ScalarMappable"
Line: TypeAlias = "matplotlib.lines.Line2D"
Titles: TypeAlias = Mapping[str, str]

MAX_PANELS = 12
"""Most rows and most columns of panels; with more none could be read."""
SMALLEST_BIAS = 0.01
"""Smallest bias that is drawn, as a share of the sd. Adjustments have a bias of their own, which is
smaller and yet can be significant."""
ANGLES = ("roll", "pitch")
FAILED: style.Style = {"linestyle": "", "marker": "x", "markersize": 4}
"""Mark of what cannot be estimated, or has not converged."""
LINES, MARKERS = ("-", "--", ":", "-."), ("o", "^", "s", "D", "v", "P", "X", "*")
BESIDE = {"title": [(-1, 0), (0, -1)], "xlabel": [(1, 0)], "ylabel": [(0, -1)]}
"""Where a panel's neighbours are, down and right, whose label serves for both."""


def panels(
    table: DataFrame,
    draw: Callable[[Axes, DataFrame], Image | None],
    height_mm: float,
    *,
    row: str = "",
    column: str = "",
    title: str = "",
    xlabel: str = "",
    ylabel: str = "",
    colours: str = "",
    legend: Sequence[Line] = (),
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
    image, everywhere = None, np.ones(len(table), bool)
    for (i, j), ax in np.ndenumerate(axes):
        in_row = table[row].to_numpy() == rows[i] if row else everywhere
        in_column = table[column].to_numpy() == columns[j] if column else everywhere
        part = table[in_row & in_column]
        for name, text in texts.items() if len(table) else ():
            alike = part if len(part) else table[in_row if name == "ylabel" else in_column]
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
    shown = {unit: style.in_shown_unit(1.0, unit) for unit in table["unit"].unique()}
    factors = {unit: float(factor) for unit, (factor, _) in shown.items()}
    factor = table["unit"].map(factors).astype(float)
    numbers = {name: table[name].astype(float) * factor for name in columns}
    return table.assign(**numbers, unit=[shown[unit][1] for unit in table["unit"]])


def in_group_order(table: DataFrame) -> DataFrame:
    """Table with the rows of each group of parameters in the order of all figures."""
    order = style.sort_groups(table["group"])
    return table.sort_values("group", key=lambda names: names.map(order.index), kind="stable")


def group_sds(summary: DataFrame) -> DataFrame:
    """Mean empirical sd of each group of parameters of each cell.

    `value` is in the `unit` shown, NaN if there is none. `bias` is the rms bias if it is
    significant for all parameters of the group and above `SMALLEST_BIAS`.
    """
    certain = (summary["bias_ci95_low"] > 0) | (summary["bias_ci95_high"] < 0)
    large = summary["bias"].abs() > SMALLEST_BIAS * summary["sd_empirical"]
    summary = summary.assign(
        group=summary["parameter"].map(style.group_of),
        squared=(summary["bias"] ** 2).where(certain & large, np.inf),
    )
    groups = summary.groupby(["cell", "group", "unit"], sort=False)
    sds = groups.agg(value=("sd_empirical", "mean"), squared=("squared", "mean")).reset_index()
    bias = sds["squared"].where(np.isfinite(sds["squared"])) ** 0.5
    sds = sds.assign(bias=bias, label=sds["group"].map(style.group_label), quantity="sd")
    return in_shown_units(in_group_order(sds), "value", "bias")


def tilt_errors(cells: DataFrame, leveling: DataFrame) -> DataFrame:
    """Rows of cells with the tilt error that each leaves: for roll, then for pitch, as `group`.

    `value` is the rms in the `unit` shown, and `both` what both angles stay below in 95 % of the
    calibrations; NaN if there is none.
    """
    import pandas as pd

    both = cells["cell"].map(by_cell(leveling, "both_rms_q95_mgon"))
    rms = {angle: by_cell(leveling, f"{angle}_rms_mgon") for angle in ANGLES}
    table = pd.concat(
        [cells.assign(group=angle, both=both, value=cells["cell"].map(rms[angle])) for angle in rms]
    )
    return in_shown_units(table.assign(unit="mgon", quantity="rms"), "value", "both")


def accuracies(tables: Tables) -> DataFrame:
    """Accuracy of each cell: a row for each group of parameters, then for roll and for pitch.

    `value` is that of `group_sds` or of `tilt_errors`; `quantity` says which, and `label` of what.
    """
    import pandas as pd

    tilt = tilt_errors(tables["cells"][["cell"]], tables["leveling"])
    tilt = tilt.assign(label=tilt["group"] + " error")
    table = pd.concat([group_sds(tables["summary"]), tilt], ignore_index=True)
    return table.assign(value=table["value"].where(table["value"] > 0))


# --- artists -------------------------------------------------------------------------------------


def points(ax: Axes, rows: DataFrame, x: str = "x", y: str = "y", **look: Any) -> None:
    """Draw a point for each row in the colour and with the marker of its approach."""
    for approach, its in rows.groupby("approach", observed=True):
        colour, marker = style.approach_colour(str(approach)), style.approach_marker(str(approach))
        usual = {"color": colour, "marker": marker, "linestyle": ""}
        ax.plot(its[x].to_numpy(), its[y].to_numpy(), **{**usual, **look})


def fields(
    ax: Axes, rows: DataFrame, down: tuple[str, Titles], right: tuple[str, Titles], **look: Any
) -> Image:
    """Draw a field for each row, with its `text`, in the colour of its `number`; none for NaN.

    `down` and `right` are the columns that choose the place, with titles of their values in order.
    """
    import pandas as pd

    places = pd.MultiIndex.from_product([down[1], right[1]])
    table = rows.groupby([down[0], right[0]])[["number", "text"]].first().reindex(places)
    shape = len(down[1]), len(right[1])
    numbers, texts = table["number"].to_numpy(float), table["text"].fillna("").to_numpy(str)
    titles = [*down[1].values()], [*right[1].values()]
    return style.matrix(ax, *titles, numbers.reshape(shape), texts.reshape(shape), **look)


def line_looks(names: Iterable[str], **look: Any) -> dict[str, style.Style]:
    """Lines and markers by which names are told apart, whatever their colour."""
    return {
        name: {"linestyle": LINES[(i + i // 8) % 4], "marker": MARKERS[i % 8], **look}
        for i, name in enumerate(dict.fromkeys(names))
    }


def handle(label: str, **look: Any) -> Line:
    """Entry of a legend."""
    from matplotlib.lines import Line2D

    return Line2D([], [], label=label, **{"color": style.INK, **look})


def surface(ax: Axes, x: ArrayLike, y: ArrayLike, values: ArrayLike, **limits: Any) -> Image:
    """Draw values (y, x) as a smooth map."""
    ax.grid(False)
    return ax.pcolormesh(x, y, values, shading="gouraud", rasterized=True, **limits)
