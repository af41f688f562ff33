"""The effect of a noise setting or of the number of positions on a calibration."""

from __future__ import annotations

from functools import partial
from itertools import groupby
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

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
from accelstudy.study.figures.base import Tables, register
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

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

    from accelstudy.study.config import StudyConfig

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


def over_factor(tables: Tables, study: StudyConfig, factor: Factor) -> Figure:
    """Panels for each group of parameters and for the tilt error, over one factor."""
    return _draw(tables, factor, blocks(study, factor))


for _factor in FACTORS:
    register(
        f"sweep-{_factor.name}",
        f"Standard deviations and tilt error over the {_factor.title}",
        CAPTION,
        tables=("cells", "summary", "leveling"),
        when=partial(varies, factor=_factor),
        note=partial(factor_note, factor=_factor),
    )(partial(over_factor, factor=_factor))


def _draw(tables: Tables, factor: Factor, swept: list[Block]) -> Figure:
    parts = [part for block in swept for part in _parts(block)]
    left_out, parts = len(parts[MOST_BLOCKS:]), parts[:MOST_BLOCKS]
    drawn = [_values(block, tables) for block in parts]
    names = [[*in_order(set(rows["group"]) - set(TILTS)), *TILTS] for rows in drawn]
    heights = [16 + ROW_MM * -(-len(groups) // _columns(groups)) for groups in names]
    fig = new_figure(FULL, sum(heights) + (5 if left_out else 0))
    subfigures = fig.subfigures(len(parts), 1, height_ratios=heights, squeeze=False)[:, 0]
    unit = "" if factor is POSITIONS else f"/ {unit_label(display_unit(factor.unit))}"
    label = " ".join(filter(None, [factor.title, factor.symbol, unit]))
    panels: dict[tuple[str, str], list[Axes]] = {}
    for part, block, rows, groups in zip(subfigures, parts, drawn, names, strict=True):
        columns = _columns(groups)
        axes = part.subplots(-(-len(groups) // columns), columns, squeeze=False).ravel()
        for ax in axes[len(groups) :]:
            ax.set_axis_off()
        lowest = axes[max(0, len(groups) - columns) : len(groups)]
        for ax, group in zip(axes, groups, strict=False):
            _draw_panel(ax, rows[rows["group"] == group], factor, block.series)
            ax.set_title(f"tilt error, {group}" if group in TILTS else group_label(group))
            ax.set_xlabel(label if ax in lowest else "")
            panels.setdefault((block.series[0][0], group), []).append(ax)
        part.suptitle(_title(block, factor), fontsize=8)
        _add_legend(part, rows, block.series, factor)
    failed = any(marks.any() for rows in drawn for marks in _failures(rows).values())
    for drawn_alike in panels.values():
        _same_y(drawn_alike, failed)
    if left_out:
        fig.text(0, 0, f"{left_out} more blocks are not drawn; their numbers are in the tables.")
    return fig


def _columns(groups: list[str]) -> int:
    return 4 if len(groups) == 4 else 3


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


def _values(block: Block, tables: Tables) -> pd.DataFrame:
    """One row per cell and group: mean sd or rms tilt error, rms bias, and what failed."""
    import pandas as pd

    summary, leveling = tables["summary"], tables["leveling"]
    counts = tables["cells"][["cell", "estimable", "n_converged", "n_replicates"]]
    cells = block.cells[["cell", "model", "subject", "approach", "x"]].merge(counts, on="cell")
    certain = (summary["bias_ci95_low"] > 0) | (summary["bias_ci95_high"] < 0)
    parameters = summary.assign(
        group=[group_of(name) for name in summary["parameter"]],
        significant=certain & (summary["bias"].abs() > SMALLEST_BIAS * summary["sd_empirical"]),
        squared=summary["bias"] ** 2,
    )
    groups = parameters.groupby(["cell", "group", "unit"], sort=False, as_index=False).agg(
        value=("sd_empirical", "mean"),
        squared=("squared", "mean"),
        significant=("significant", "all"),
    )
    biases = [groups.assign(bias=groups.pop("squared") ** 0.5)]
    for angle in TILTS:
        rms = leveling.set_index("cell")[f"{angle}_rms_mgon"] if len(leveling) else pd.Series()
        tilt = pd.DataFrame({"cell": cells["cell"], "value": cells["cell"].map(rms).astype(float)})
        biases.append(tilt.assign(group=angle, unit="mgon", significant=False))
    return cells.merge(pd.concat(biases, ignore_index=True), on="cell")


def _title(block: Block, factor: Factor) -> str:
    """Title of a block: what its series have in common, and the levels of the other factors."""
    models, schemes = (list(dict.fromkeys(names)) for names in zip(*block.series, strict=True))
    common = [_scheme_title(schemes[0], factor)] if len(schemes) == 1 else []
    common = [model_title(models[0]), *common] if len(models) == 1 else common
    return "\n".join(filter(None, [", ".join(common), levels_text(block.levels)]))


def _scheme_title(scheme: str, factor: Factor) -> str:
    return scheme if factor is POSITIONS else get_scheme(scheme).title


def _series_names(series: list[tuple[str, str]], factor: Factor) -> list[str]:
    """Names of the series of a block, without the part in its title."""
    models, schemes = (set(names) for names in zip(*series, strict=True))
    return [
        ", ".join(
            ([model_title(model)] if len(models) > 1 else [])
            + ([_scheme_title(scheme, factor)] if len(schemes) > 1 else [])
        )
        for model, scheme in series
    ]


def _draw_panel(
    ax: Axes, rows: pd.DataFrame, factor: Factor, series: list[tuple[str, str]]
) -> None:
    group, unit = rows["group"].iloc[0], rows["unit"].iloc[0]
    for (*name, approach), members in rows.groupby(["model", "subject", "approach"], sort=False):
        i = series.index((str(name[0]), str(name[1])))
        style = {**_series_style(i), "color": approach_colour(str(approach))}
        _draw_series(ax, members.sort_values("x"), factor, style, height=TOP - 0.07 * i)
    if rows["value"].gt(0).any():
        ax.set_yscale("log")
    else:
        say_empty(ax, "no standard deviation" if rows["estimable"].any() else "no estimable cell")
        ax.set_yticks([])
    what = "rms" if group in TILTS else "sd, |bias|" if factor.column == SYSTEMATIC else "sd"
    ax.set_ylabel(f"{what} / {shown([], unit)[1]}")
    _scale_x(ax, np.unique(factor.shown(rows["x"].dropna())))


def _draw_series(ax: Axes, rows: pd.DataFrame, factor: Factor, style: Style, height: float) -> None:
    """Line of one series and approach; crosses at `height`, a share of the panel, where it fails.

    Series without a robot are drawn as a line across, as they do not depend on its noise.
    """
    unit = rows["unit"].iloc[0]
    x, (y, _) = factor.shown(rows["x"]), shown(rows["value"], unit)
    failures = _failures(rows)
    if np.isnan(x).all():
        if (y > 0).all():
            ax.axhline(y[0], **{**style, "marker": ""}, linewidth=0.8)
        x, across = np.array([0.98]), ax.transAxes
    else:
        across = ax.get_xaxis_transform()
        ax.plot(x, np.where(y > 0, y, np.nan), **style)
        some = rows["n_converged"].between(1, rows["n_replicates"] - 1).to_numpy() & (y > 0)
        ax.plot(x[some], y[some], **{**style, "linestyle": ""}, markerfacecolor="white")
        seen = rows["significant"].to_numpy(bool)
        if factor.column == SYSTEMATIC and seen.any():
            bias, _ = shown(rows["bias"], unit)
            ax.plot(x[seen], bias[seen], color=style["color"], **BIAS_STYLE)
    for label, failed in failures.items():
        if failed.any():
            heights = np.full(failed.sum(), height)
            mark = {**style, "linestyle": "", "transform": across, "clip_on": False}
            ax.plot(x[failed], heights, **{**mark, "alpha": 0.35})
            ax.plot(x[failed], heights, **{**mark, **FAILED_STYLES[label]})


def _failures(rows: pd.DataFrame) -> dict[str, NDArray[np.bool_]]:
    """Which cells of a series cannot be estimated, and in which no calibration converged."""
    estimable = rows["estimable"].to_numpy(bool)
    none = estimable & (rows["n_converged"] == 0).to_numpy()
    return dict(zip(FAILED_STYLES, (~estimable, none), strict=True))


def _series_style(i: int) -> Style:
    return {"linestyle": LINES[i], "marker": MARKERS[i], "markersize": 3}


def _scale_x(ax: Axes, x: NDArray[np.float64]) -> None:
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


def _add_legend(
    part: SubFigure, rows: pd.DataFrame, series: list[tuple[str, str]], factor: Factor
) -> None:
    from matplotlib.lines import Line2D

    handles = approach_handles(dict.fromkeys(rows["approach"]), marker="", linestyle="-")
    if len(series) > 1:
        handles += [
            Line2D([], [], color=INK, label=name, **_series_style(i))
            for i, name in enumerate(_series_names(series, factor))
        ]
    if factor.column == SYSTEMATIC:
        handles.append(Line2D([], [], color=INK, label="|bias|, if significant", **BIAS_STYLE))
    for label, failed in _failures(rows).items():
        if failed.any():
            handles.append(Line2D([], [], color=INK, label=label, **FAILED_STYLES[label]))
    if rows["n_converged"].between(1, rows["n_replicates"] - 1).any():
        some: Style = {"linestyle": "", "marker": "o", "markerfacecolor": "white", "color": INK}
        handles.append(Line2D([], [], **some, label="some did not converge"))
    columns = legend_columns([str(handle.get_label()) for handle in handles])
    part.legend(handles=handles, loc="outside lower center", ncols=columns, handlelength=3)
