"""The effect of a noise setting or of the number of positions on a calibration."""

from __future__ import annotations

from functools import partial

import numpy as np

from accelstudy.drawing import style
from accelstudy.schemes import get_scheme
from accelstudy.study.figures.factors import FACTORS, POSITIONS, Factor, swept, varies
from accelstudy.study.figures.panels import FAILED, accuracies, handle, line_looks, panels
from accelstudy.study.figures.registry import Axes, DataFrame, Figure, Study, Tables, register

SYSTEMATIC = "gravity-error"
"""The factor whose effect is a bias, which is drawn beside the sd."""
TOP = 0.95
"""Height of the crosses of the first scheme in a panel, as a share."""
NONE, SOME, BIAS = "not estimable, or none converged", "some did not converge", "significant |bias|"
MARKS: dict[str, style.Style] = {
    BIAS: {"linestyle": ":", "linewidth": 0.8, "marker": "x", "markersize": 4},
    SOME: {"linestyle": "", "marker": "o", "markerfacecolor": "white"},
    NONE: FAILED,
}


def over_factor(tables: Tables, study: Study, factor: Factor) -> Figure:
    """Standard deviations and tilt error over the {factor.title}.

    Mean empirical standard deviation of each group of parameters, and the rms error of roll and of
    pitch that the calibration leaves, over one quantity that the study varies. Colours are
    approaches, lines and markers are schemes; an approach that does not use what varies has markers
    at the ends only. The head of each column says of which model it is, and at which values all
    else is held: where this quantity takes the most values and, of several such values, at the one
    nearest to the study's default. Crosses at the top stand where a cell cannot be estimated or
    none of its calibrations converged; open markers, where some did not converge. For an error of
    gravity the bias (rms over the group) is drawn too where it is significant for all parameters of
    the group and above 1 % of their sds.
    """
    table = sweep_table(tables, study, factor)
    looks = line_looks(table["subject"], markersize=3)

    def draw(ax: Axes, rows: DataFrame) -> None:
        for (subject, approach), line in rows.sort_values("x").groupby(["subject", "approach"]):
            look = {**looks[str(subject)], "color": style.approach_colour(str(approach))}
            x, failed = line["x"], line["state"] == NONE
            height = TOP - 0.07 * list(looks).index(str(subject))
            some = {**MARKS[SOME], "marker": look["marker"]}
            across = {**FAILED, "transform": ax.get_xaxis_transform()}
            ax.plot(x, line["value"], **look)
            ax.plot(x, line["bias"], **{**look, **MARKS[BIAS]})
            ax.plot(x, line["value"].where(line["state"] == SOME), **{**look, **some})
            ax.plot(x, np.where(failed, height, np.nan), **{**look, **across})
        smallest = rows["x"].abs()[rows["x"] != 0].min()
        linear = {"linthresh": 10 ** np.floor(np.log10(smallest)), "linscale": 0.5}
        ax.set_xscale("log") if (rows["x"] > 0).all() else ax.set_xscale("symlog", **linear)
        ax.set_yscale("log")

    seen = {*table["state"], *([BIAS] if table["bias"].any() else [])}
    legend = [
        *style.approach_handles(table["approach"].unique(), marker="", linestyle="-"),
        *(handle(name, **look) for name, look in looks.items() if len(looks) > 1),
        *(handle(name, **look) for name, look in MARKS.items() if name in seen),
    ]
    return panels(
        table,
        draw,
        26,
        row="group",
        column="column",
        xlabel=factor.label,
        ylabel="{label}\n{quantity} / {unit}",
        legend=legend,
        width=style.FULL if len(set(table["column"])) > 1 else style.COLUMN,
        subplot_kw={"ymargin": 0.25},  # for the crosses
    )


for _factor in FACTORS:
    _name, _when = f"sweep-{_factor.name}", partial(varies, factor=_factor)
    register(_name, "cells", "summary", "leveling", when=_when, factor=_factor)(over_factor)


def sweep_table(tables: Tables, study: Study, factor: Factor) -> DataFrame:
    """Accuracy of each cell over a factor, as shown: a row for each group of parameters and angle.

    A cell of an approach that does not use what varies has a row for the lowest and for the highest
    of its values.
    """
    import pandas as pd

    counts = tables["cells"][["cell", "estimable", "n_converged", "n_replicates"]]
    cells = swept(study, factor).merge(counts, on="cell")
    used, columns = cells["x"].notna(), ["model", "held"]
    ends = cells.groupby(columns, sort=False)["x"].agg(["min", "max"]).reset_index()
    ends = ends.melt(columns, value_name="x").drop(columns="variable")
    cells = pd.concat([cells[used], cells[~used].drop(columns="x").merge(ends, on=columns)])
    failed = ~cells["estimable"] | (cells["n_converged"] == 0)
    some = cells["n_converged"] < cells["n_replicates"]
    cells = cells.assign(
        x=factor.shown(cells["x"]),
        state=np.select([failed, some], [NONE, SOME], ""),
        column=cells["model"].map(style.model_title) + "\n" + cells["held"],
    )
    if factor is not POSITIONS:
        cells["subject"] = [get_scheme(name).title for name in cells["subject"]]
    table = accuracies(tables).merge(cells, on="cell")
    return table if factor.name == SYSTEMATIC else table.assign(bias=np.nan)
