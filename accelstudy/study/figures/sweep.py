"""The effect of a noise setting or of the number of positions on a calibration."""

from __future__ import annotations

from functools import partial
from itertools import groupby
from typing import TYPE_CHECKING

import numpy as np

from accelstudy.basics.units import display_unit, unit_label
from accelstudy.drawing.style import (
    FULL,
    INK,
    Style,
    approach_colour,
    approach_handles,
    group_label,
    group_of,
    in_order,
    legend_columns,
    log_ticks,
    model_title,
    new_figure,
    say_empty,
    shown,
    spread,
)
from accelstudy.schemes import get_scheme
from accelstudy.study.figures.factors import (
    FACTORS,
    POSITIONS,
    Block,
    Factor,
    blocks,
    factor_note,
    levels_text,
    varies,
)
from accelstudy.study.figures.panels import Array, Panel, by_cell, key, panels
from accelstudy.study.figures.registry import Tables, register

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

    from accelstudy.study.config import Study

CAPTION = """
Mean empirical standard deviation of each group of parameters, and the rms error of roll and of
pitch that the calibration leaves, over one quantity that the study varies. Colours are approaches,
lines and markers are models and schemes. The title of each part says at which values everything
else is held: at the study's default where it was run, otherwise at the middle of the values that
were run (the lower of two). A line without markers is an approach that does not use what varies.
Crosses at the top stand where a cell cannot be estimated or none of its calibrations converged;
open markers, where some did not converge. For an error of gravity the bias (rms over the group) is
drawn too where it is significant for all parameters of the group and above 1 % of their sds.
"""

SYSTEMATIC = "gravity_error_mps2"
"""The quantity whose effect is a bias, which is drawn beside the sd."""
SMALLEST_BIAS = 0.01
"""Smallest bias that is drawn, as a share of the sd. Adjustments have a bias of their own, which is
smaller and yet can be significant."""
TILTS = ("roll", "pitch")
MARKERS = ("o", "^", "s", "D")
LINES = ("-", "--", ":", "-.")
IN_A_BLOCK = len(MARKERS)
"""Number of series that can be told apart in a small panel."""
MOST_BLOCKS = 24
"""Most blocks of one figure; more would make it too tall."""
TOP = 0.97
"""Height of the crosses of failures in a panel, as a share; values stay below."""
ROW_MM = 45
BIAS_STYLE: Style = {"linestyle": ":", "linewidth": 0.8, "marker": "x", "markersize": 4}
FAILED_STYLES: dict[str, Style] = {
    "not estimable": {"linestyle": "", "marker": "x", "markersize": 4},
    "none converged": {"linestyle": "", "marker": "+", "markersize": 6},
}
SOME = "some did not converge"


def over_factor(tables: Tables, study: Study, factor: Factor) -> Figure:
    """Panels for each group of parameters and for the tilt error, over one factor."""
    parts = [part for block in blocks(study, factor) for part in _parts(block)]
    left_out, parts = len(parts[MOST_BLOCKS:]), parts[:MOST_BLOCKS]
    drawn = [block_table(block, tables, factor) for block in parts]
    names = [[*in_order(set(rows["group"]) - set(TILTS)), *TILTS] for rows in drawn]
    columns = [4 if len(groups) == 4 else 3 for groups in names]
    heights = [16 + ROW_MM * -(-len(g) // n) for g, n in zip(names, columns, strict=True)]
    fig = new_figure(FULL, sum(heights) + (5 if left_out else 0))
    subfigures = fig.subfigures(len(parts), 1, height_ratios=heights, squeeze=False)[:, 0]
    unit = "" if factor is POSITIONS else f"/ {unit_label(display_unit(factor.unit))}"
    xlabel = " ".join(filter(None, [factor.title, factor.symbol, unit]))
    sd = "sd, |bias|" if factor.column == SYSTEMATIC else "sd"
    alike: dict[tuple[str, str], list[Axes]] = {}
    for part, block, rows, groups, n in zip(subfigures, parts, drawn, names, columns, strict=True):
        row = []
        for k, group in enumerate(groups):
            its = rows[rows["group"] == group]
            what = "rms" if group in TILTS else sd
            title = f"tilt error, {group}" if group in TILTS else group_label(group)
            lowest = k >= len(groups) - n
            labels = xlabel if lowest else "", f"{what} / {its['unit'].iloc[0]}"
            row.append(Panel(its, title, *labels))
        grid = [row[i : i + n] for i in range(0, len(row), n)]
        axes = panels(grid, _draw_panel, figure=part)[1]
        for group, ax in zip(groups, axes.flat, strict=False):
            alike.setdefault((block.series[0][0], group), []).append(ax)
        part.suptitle(_title(block, factor), fontsize=8)
        handles = _handles(rows, block, factor)
        ncols = legend_columns([str(handle.get_label()) for handle in handles])
        part.legend(handles=handles, loc="outside lower center", ncols=ncols, handlelength=3)
    failed = any(rows["state"].isin(FAILED_STYLES).any() for rows in drawn)
    for each in alike.values():
        _same_y(each, failed)
    if left_out:
        fig.text(0, 0, f"{left_out} more blocks are not drawn; their numbers are in the tables.")
    return fig


for _factor in FACTORS:
    register(
        f"sweep-{_factor.name}",
        title=f"Standard deviations and tilt error over the {_factor.title}",
        caption=CAPTION,
        tables=("cells", "summary", "leveling"),
        when=partial(varies, factor=_factor),
        note=partial(factor_note, factor=_factor),
    )(partial(over_factor, factor=_factor))


def _parts(block: Block) -> list[Block]:
    """Divide a block that has too many series: by model, then a few schemes at a time."""
    series = block.series
    if len(series) <= IN_A_BLOCK:
        return [block]
    return [
        Block(block.levels, block.cells[[item in chosen for item in block.series_of_cells]])
        for _, group in groupby(series, key=lambda item: item[0])
        for its in [list(group)]
        for i in range(0, len(its), IN_A_BLOCK)
        for chosen in [its[i : i + IN_A_BLOCK]]
    ]


def block_table(block: Block, tables: Tables, factor: Factor) -> pd.DataFrame:
    """One row per cell and group: mean sd or rms tilt error as shown, bias, and what failed.

    `x` is the factor as shown (NaN of an approach that does not use it), `series` the number of the
    line, and `bias` NaN where it is not drawn.
    """
    import pandas as pd

    summary, leveling = tables["summary"], tables["leveling"]
    counts = tables["cells"][["cell", "estimable", "n_converged", "n_replicates"]]
    cells = block.cells[["cell", "approach", "x"]].merge(counts, on="cell")
    converged, estimable = cells["n_converged"], cells["estimable"].to_numpy(bool)
    some = converged < cells["n_replicates"]
    state = np.where(~estimable, "not estimable", np.where(some, SOME, ""))
    cells = cells.assign(
        x=factor.shown(cells["x"]),
        series=[block.series.index(item) for item in block.series_of_cells],
        state=np.where(estimable & (converged == 0), "none converged", state),
    )
    certain = (summary["bias_ci95_low"] > 0) | (summary["bias_ci95_high"] < 0)
    parameters = summary.assign(
        group=[group_of(name) for name in summary["parameter"]],
        significant=certain & (summary["bias"].abs() > SMALLEST_BIAS * summary["sd_empirical"]),
        squared=summary["bias"] ** 2,
    )
    mean = {"sd_empirical": "mean", "squared": "mean", "significant": "all"}
    groups = parameters.groupby(["cell", "group", "unit"], sort=False).agg(mean).reset_index()
    drawn = groups["significant"].astype(bool) & (factor.column == SYSTEMATIC)
    bias = np.sqrt(groups["squared"]).where(drawn)
    groups = groups.assign(value=groups["sd_empirical"], bias=bias)
    parts = [groups[["cell", "group", "unit", "value", "bias"]]]
    for angle in TILTS:
        value = cells["cell"].map(by_cell(leveling, f"{angle}_rms_mgon")).astype(float)
        tilt = cells[["cell"]].assign(group=angle, unit="mgon", value=value, bias=np.nan)
        parts.append(tilt)
    table = cells.merge(pd.concat(parts, ignore_index=True), on="cell")
    for unit in table["unit"].unique():
        rows, label = table["unit"] == unit, shown([], unit)[1]
        for column in ("value", "bias"):
            table.loc[rows, column] = shown(table.loc[rows, column], unit)[0]
        table.loc[rows, "unit"] = label
    return table.assign(value=table["value"].where(table["value"] > 0))


def _title(block: Block, factor: Factor) -> str:
    """Title of a block: what its series have in common, and the levels of the other factors."""
    models, schemes = (list(dict.fromkeys(names)) for names in zip(*block.series, strict=True))
    common = [_scheme_title(schemes[0], factor)] if len(schemes) == 1 else []
    common = [model_title(models[0]), *common] if len(models) == 1 else common
    return "\n".join(filter(None, [", ".join(common), levels_text(block.levels)]))


def _scheme_title(scheme: str, factor: Factor) -> str:
    return scheme if factor is POSITIONS else get_scheme(scheme).title


def _draw_panel(ax: Axes, rows: pd.DataFrame) -> None:
    """Draw a line for each series and approach."""
    for (series, approach), members in rows.groupby(["series", "approach"], sort=False):
        i = int(str(series))
        style = {**_series_style(i), "color": approach_colour(str(approach))}
        _draw_series(ax, members.sort_values("x"), style, height=TOP - 0.07 * i)
    if rows["value"].notna().any():
        ax.set_yscale("log")
    else:
        none = (rows["state"] == "not estimable").all()
        say_empty(ax, "no estimable cell" if none else "no standard deviation")
        ax.set_yticks([])
    _scale_x(ax, np.unique(rows["x"].dropna()))


def _draw_series(ax: Axes, rows: pd.DataFrame, style: Style, height: float) -> None:
    """Line of one series and approach; crosses at `height`, a share of the panel, where it fails.

    Series without a robot are drawn as a line across, as they do not depend on its noise.
    """
    x, y = rows["x"].to_numpy(float), rows["value"].to_numpy(float)
    across = ax.get_xaxis_transform()
    if np.isnan(x).all():
        if np.isfinite(y).all():
            ax.axhline(y[0], **{**style, "marker": ""}, linewidth=0.8)
        x, across = np.full(len(x), 0.98), ax.transAxes
    else:
        ax.plot(x, y, **style)
        some = rows["state"] == SOME
        ax.plot(x[some], y[some], **{**style, "linestyle": ""}, markerfacecolor="white")
        seen = rows["bias"].notna()
        if seen.any():
            ax.plot(x[seen], rows["bias"][seen], color=style["color"], **BIAS_STYLE)
    for state, cross in FAILED_STYLES.items():
        failed = x[rows["state"] == state]
        mark = {**style, "linestyle": "", "transform": across, "clip_on": False}
        for one in ({**mark, "alpha": 0.35}, {**mark, **cross}) if len(failed) else ():
            ax.plot(failed, np.full(len(failed), height), **one)


def _series_style(i: int) -> Style:
    return {"linestyle": LINES[i], "marker": MARKERS[i], "markersize": 3}


def _scale_x(ax: Axes, x: Array) -> None:
    """Logarithmic axis, linear about zero if zero is among the values, with ticks at the values."""
    from matplotlib.ticker import NullLocator

    if len(x) < 2:
        ax.set_xticks(x)
        return
    sizes = np.abs(x[x != 0])
    if (x > 0).all():
        ax.set_xscale("log")
    else:
        ax.set_xscale("symlog", linthresh=sizes.min(), linscale=0.5)
    places = ax.transScale.transform(np.column_stack([x, np.ones_like(x)]))[:, 0]
    labelled = spread(places, 0.15 * np.ptp(places))
    ax.set_xticks(x, [f"{value:.4g}" if i in labelled else "" for i, value in enumerate(x)])
    pad = 0.05 * np.ptp(places)
    ends = np.array([[places[0] - pad, 0], [places[-1] + pad, 0]])
    ax.set_xlim(*ax.transScale.inverted().transform(ends)[:, 0])
    ax.xaxis.set_minor_locator(NullLocator())


def _same_y(axes: list[Axes], failed: bool) -> None:
    """Give panels the same axis, so that they can be compared."""
    drawn = [ax for ax in axes if ax.get_yscale() == "log"]
    if not drawn:
        return
    low = min(ax.get_ylim()[0] for ax in drawn)
    high = max(ax.get_ylim()[1] for ax in drawn)
    top = high * (high / low) ** (0.4 if failed else 0)
    for ax in drawn:
        ax.set_ylim(low, top)
        log_ticks(ax.yaxis, low, high)


def _handles(rows: pd.DataFrame, block: Block, factor: Factor) -> list[Line2D]:
    """Entries of the legend of a block."""
    handles = approach_handles(dict.fromkeys(rows["approach"]), marker="", linestyle="-")
    models, schemes = (set(names) for names in zip(*block.series, strict=True))
    for i, (model, scheme) in enumerate(block.series if len(block.series) > 1 else ()):
        name = [model_title(model)] if len(models) > 1 else []
        name += [_scheme_title(scheme, factor)] if len(schemes) > 1 else []
        handles.append(key(", ".join(name), color=INK, **_series_style(i)))
    if factor.column == SYSTEMATIC:
        handles.append(key("|bias|, if significant", color=INK, **BIAS_STYLE))
    some: Style = {"linestyle": "", "marker": "o", "markerfacecolor": "white"}
    for state, style in {**FAILED_STYLES, SOME: some}.items():
        if (rows["state"] == state).any():
            handles.append(key(state, color=INK, **style))
    return handles
