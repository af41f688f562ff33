"""The charts of an explorer as one specification of Vega-Lite, with its data.

Rows of a chart are categories, so that names can be read on a narrow screen, too.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

import altair as alt
import pandas as pd

from accelstudy.basics.units import display_unit
from accelstudy.drawing.style import INK, approach_colour
from accelstudy.study.figures.panels import ANGLES

Layers = alt.LayerChart | alt.FacetChart
PALE_OPACITY = 0.2
"""Opacity of set-ups that are not compared with the chosen one."""


def explorer_charts(
    setups: pd.DataFrame, parameters: pd.DataFrame, fields: Mapping[str, str]
) -> dict[str, Any]:
    """Tilt errors of set-ups, and standard deviations of the parameters of the chosen one.

    The parameters of the specification are `by`, the field that the rows of the tilt errors show,
    and `chosen`, the row of the chosen set-up. The page sets the width of the charts, and how many
    stand side by side.

    Parameters
    ----------
    setups, parameters : DataFrame, as of `content`
    fields : column of set-ups that may differ -> its title; without the approach
    """
    approaches, names = [*setups["approach"].unique()], [*fields] or ["model"]
    usual = next((name for name in names if name not in ("model", "scheme", "n")), "scheme")
    usual = usual if usual in names else names[0]
    tilts = [tilt_chart(angle, approaches, names) for angle in ANGLES]
    sds = [sds_chart(unit, approaches, names) for unit in parameters["unit"].unique()]
    control = {
        **{"input": "select", "element": "#by", "name": "Rows of the charts: "},
        **{"options": names, "labels": [fields.get(name, name) for name in names]},
    }
    look = {"font": "system-ui, sans-serif", "axis": {"labelFontSize": 12}}
    # Joined here, as Altair would copy and check all of it, and each row of the data, in seconds.
    return {
        "vconcat": [
            {"concat": [chart.to_dict() for chart in tilts], "resolve": {"scale": {"x": "shared"}}},
            {"concat": [chart.to_dict() for chart in sds]},
        ],
        "params": [
            {"name": "by", "value": usual, "bind": control},
            {"name": "chosen", "value": {}},
        ],
        "config": {**look, "legend": {"orient": "top", "title": None, "labelFontSize": 12}},
        "datasets": {"setups": records(setups), "parameters": records(parameters)},
    }


def records(table: pd.DataFrame) -> list[dict[str, Any]]:
    """Rows of a table, their numbers with four digits."""
    numbers = table.select_dtypes("float").map(lambda value: float(f"{value:.4g}"))
    return list(json.loads(table.assign(**numbers).to_json(orient="records", double_precision=15)))


def _alike(fields: Sequence[str]) -> str:
    """Whether a row is like the chosen set-up in fields, but in the one that the rows show.

    A set-up without a robot has no noise of the robot, and is like those of any.
    """
    tests = (
        f"(by == '{field}' || datum['{field}'] == chosen['{field}'] || "
        f"!isValid(datum['{field}']) || !isValid(chosen['{field}']))"
        for field in fields
    )
    return " && ".join(["true", *tests])


def tilt_chart(angle: str, approaches: Sequence[str], fields: Sequence[str]) -> Layers:
    """Tilt error in one angle, a point and a range for each set-up.

    Pale are set-ups that differ from the chosen one in a field that the rows do not show, too.
    """
    same_scheme = "(by == 'scheme' || by == 'n' || datum.scheme == chosen.scheme)"
    others = [field for field in fields if field not in ("scheme", "n")]
    rows = _rows("setups", approaches, "row", alt.EncodingSortField("order", op="min"))
    rows = rows.transform_calculate(
        row="isValid(datum[by]) ? datum[by] : 'without robot'",
        order="by == 'scheme' ? datum.n : isString(datum[by]) ? datum.i : datum[by] || -1",
        alike=f"{_alike(others)} && {same_scheme}",
    )
    rows = rows.encode(
        opacity=_opacity("datum.alike", 1, PALE_OPACITY),
        tooltip=["model:N", "scheme:N", "approach:N", "state:N"]
        + [f"{angle}_{name}:Q" for name in ("rms", "low", "high", "q95")],
    )
    # Beyond the ends of the axis there is room for the crosses.
    x = alt.X(f"{angle}_rms:Q", title=None, axis=alt.Axis(format="~r", tickCount=6))
    x = x.scale(type="log", nice=False, padding=16)
    return alt.layer(
        rows.mark_rule(size=2).encode(x=f"{angle}_low:Q", x2=f"{angle}_high:Q"),
        rows.mark_tick(thickness=2, size=10).encode(x=f"{angle}_q95:Q"),
        rows.mark_point(size=230, strokeWidth=2).encode(
            x=x, color=alt.value(INK), opacity=_opacity("datum.i == chosen.i", 1, 0)
        ),
        _points(rows, approaches).encode(x=x),
        rows.mark_text(text="×", fontSize=18, dx=-8).encode(
            x=alt.value("width"),
            opacity=_opacity(
                f"isValid(datum.{angle}_rms)", 0, alt.ExprRef(f"datum.alike ? 1 : {PALE_OPACITY}")
            ),
        ),
        title=f"{angle.capitalize()} / {display_unit('rad')}",
    )


def sds_chart(unit: str, approaches: Sequence[str], fields: Sequence[str]) -> Layers:
    """Standard deviations of the parameters of one unit of the chosen set-up, by each approach."""
    numbers = ("truth", "bias", "sd_empirical", "sd_posteriori_mean", "sd_linear")
    tooltip = ["parameter:N", "approach:N", "unit:N"]
    tooltip += [f"{name}:Q" for name in (*numbers, "sd_ratio", "coverage_95")]
    rows = _rows("parameters", approaches, "parameter", None).encode(tooltip=tooltip)
    its = _alike([field for field in fields if field != "n"]).replace("by == ", "'' == ")
    rows = rows.transform_filter(f"datum.unit == '{unit}' && isValid(datum.sd_empirical) && {its}")
    x = alt.X("sd_posteriori_mean:Q", title=None, axis=alt.Axis(format="~r", tickCount=5))
    return alt.layer(
        rows.mark_bar(opacity=0.4).encode(x=x),
        rows.mark_rule(size=2).encode(x="sd_posteriori_mean_low:Q", x2="sd_posteriori_mean_high:Q"),
        rows.mark_tick(thickness=2, size=14).encode(x="sd_linear:Q", color=alt.value(INK)),
        _points(rows, approaches).encode(x="sd_empirical:Q"),
        title=f"Standard deviations / {unit}",
    )


def _rows(data: str, approaches: Sequence[str], field: str, sort: Any) -> alt.Chart:
    """Rows of a chart, in each of which the approaches stand one below the other."""
    axis = alt.Axis(title=None, ticks=False, domain=False, grid=True, labelLimit=170)
    domain = list(approaches)
    colours = [approach_colour(name) for name in domain]
    chart = alt.Chart(alt.NamedData(data), height=alt.Step(30, **{"for": "position"}))
    return chart.encode(
        y=alt.Y(f"{field}:N", sort=sort, axis=axis),
        yOffset=alt.YOffset("approach:N", scale=alt.Scale(domain=domain)),
        color=alt.Color("approach:N", scale=alt.Scale(domain=domain, range=colours)),
    )


def _points(rows: alt.Chart, approaches: Sequence[str]) -> alt.Chart:
    shape = alt.Shape("approach:N", scale=alt.Scale(domain=list(approaches)))
    return rows.mark_point(filled=True, size=55).encode(shape=shape)


def _opacity(test: str, opacity: float, otherwise: Any) -> Any:
    return alt.condition(test, alt.value(opacity), alt.value(otherwise))
