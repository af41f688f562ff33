"""The charts of an explorer, as Vega-Lite; the page gives them their data and their width.

Rows of a chart are categories, so that names can be read on a narrow screen, too.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import altair as alt

from accelstudy.drawing.style import INK, approach_colour

Layers = alt.LayerChart | alt.FacetChart
PALE_OPACITY = 0.2
"""Opacity of set-ups that are not compared with the chosen one."""


def all_charts(approaches: Sequence[str], fields: Sequence[str]) -> dict[str, Any]:
    """All charts by their kinds; the page has several of a kind, and their titles.

    Parameters
    ----------
    approaches : those of the study
    fields : columns of set-ups that may differ, without the approach
    """
    charts = {
        "roll": tilt_chart("roll", approaches, fields),
        "pitch": tilt_chart("pitch", approaches, fields),
        "sds": sds_chart(approaches),
    }
    look = alt.Config(
        font="system-ui, sans-serif",
        axis=alt.Axis(labelFontSize=12),
        legend=alt.LegendConfig(orient="top", title=None, labelFontSize=12),
    )
    return {
        name: {**chart.to_dict(), "width": "container", "config": look.to_dict()}
        for name, chart in charts.items()
    }


def tilt_chart(angle: str, approaches: Sequence[str], fields: Sequence[str]) -> Layers:
    """Tilt error in one angle, a point and a range for each set-up.

    Its parameters are `by`, the field that the rows show, from the control of this name, and
    `chosen`, the chosen set-up. Pale are set-ups that differ from this also in another field.
    """
    by = alt.param(name="by", bind=alt.BindDirect(element="#by"))
    chosen = alt.param(name="chosen", value={})
    alike = " && ".join(
        f"(by == '{field}' || datum['{field}'] == chosen['{field}'] || "
        f"!isValid(datum['{field}']) || !isValid(chosen['{field}']))"
        for field in fields
        if field not in ("scheme", "n")
    )
    same_scheme = "by == 'scheme' || by == 'n' || datum.scheme == chosen.scheme"
    rows = _rows(approaches, "row", alt.EncodingSortField("order", op="min"))
    rows = rows.transform_calculate(
        row="isValid(datum[by]) ? datum[by] : 'without robot'",
        order="by == 'scheme' ? datum.n : isString(datum[by]) ? datum.i : datum[by] || -1",
        alike=f"{alike} && ({same_scheme})",
    )
    rows = rows.encode(
        opacity=_opacity("datum.alike", 1, PALE_OPACITY),
        tooltip=["model:N", "scheme:N", "approach:N", "state:N"]
        + [f"{angle}_{name}:Q" for name in ("rms", "low", "high", "q95")],
    )
    # Both angles have the same axis; beyond its ends there is room for the crosses.
    x = alt.X(f"{angle}_rms:Q", title=None, axis=alt.Axis(format="~r", tickCount=6))
    x = x.scale(type="log", nice=False, padding=16)
    return alt.layer(
        rows.mark_rule().encode(x="least:Q", x2="most:Q", opacity=alt.value(0)),
        rows.mark_rule(size=2).encode(x=f"{angle}_low:Q", x2=f"{angle}_high:Q"),
        rows.mark_tick(thickness=2, size=10).encode(x=f"{angle}_q95:Q"),
        rows.mark_point(size=230, strokeWidth=2).encode(
            x=x, color=alt.value(INK), opacity=_opacity("datum.i == chosen.i", 1, 0)
        ),
        _points(rows, approaches).encode(x=x),
        rows.mark_text(text="×", fontSize=18).encode(
            x=alt.value(alt.ExprRef("width - 8")),
            opacity=_opacity(
                f"isValid(datum.{angle}_rms)", 0, alt.ExprRef(f"datum.alike ? 1 : {PALE_OPACITY}")
            ),
        ),
    ).add_params(by, chosen)


def sds_chart(approaches: Sequence[str]) -> Layers:
    """Standard deviations of the parameters of one unit: a posteriori, empirical, linear theory."""
    numbers = ("sd_empirical", "sd_posteriori_mean", "sd_ratio", "coverage_95")
    tooltip = ["parameter:N", "approach:N", "unit:N", *(f"{name}:Q" for name in numbers)]
    rows = _rows(approaches, "parameter").encode(tooltip=tooltip)
    x = alt.X("sd_posteriori_mean:Q", title=None, axis=alt.Axis(format="~r", tickCount=5))
    return alt.layer(
        rows.mark_bar(opacity=0.4).encode(x=x),
        rows.mark_rule(size=2).encode(x="sd_posteriori_mean_low:Q", x2="sd_posteriori_mean_high:Q"),
        rows.mark_tick(thickness=2, size=14).encode(x="sd_linear:Q", color=alt.value(INK)),
        _points(rows, approaches).encode(x="sd_empirical:Q"),
    )


def _rows(approaches: Sequence[str], field: str, sort: Any = None) -> alt.Chart:
    """Rows of a chart, in each of which the approaches stand one below the other."""
    axis = alt.Axis(title=None, ticks=False, domain=False, grid=True, labelLimit=170)
    domain = list(approaches)
    colours = [approach_colour(name) for name in domain]
    chart = alt.Chart(alt.NamedData("data"), height=alt.Step(30, **{"for": "position"}))
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
