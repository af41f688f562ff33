"""The charts of an explorer, as Vega-Lite; the page gives them their data and their width.

Rows of a chart are categories, so that names can be read on a narrow screen, too. Nothing is
filtered within a chart, or its rows would lose their order: what is missing is null in the data.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import altair as alt

from accelstudy.drawing.style import INK, STYLE, approach_colour, approach_marker

DATA = "data"
"""Name of the data of each chart."""
SHAPES = {"o": "circle", "s": "square", "D": "diamond"}
"""Markers of the figures, as Vega has them."""
FAILED = {"not estimable": "M-1,-1L1,1M-1,1L1,-1", "none converged": "M-1,0L1,0M0,-1L0,1"}
"""What can fail, and how it is marked: × and +, as in the figures."""
DASHES = [4, 3]
BAR = 0.4
"""Opacity of a bar, as in the figures."""
STEPS = {"step": 30, "for": "position"}
"""Height of the rows, pixels."""
SHOWN = {"rms": "rms", "low": "2.5 %", "q95": "95 %", "high": "97.5 %"}
"""What is shown of the tilt error in an angle, and its title."""
PALE = 0.2
"""Opacity of set-ups that are not compared with the chosen one."""
BLUES = ("#F7FBFF", "#6BAED6", "#08306B")
"""Of correlations from none to 1, as in the figures."""


def look() -> dict[str, Any]:
    """Return what all charts have in common, as Vega-Lite's `config`: the look of the figures."""
    return alt.Config(
        font="system-ui, sans-serif",
        background="white",
        view=alt.ViewConfig(stroke=None),
        axis=alt.Axis(
            labelColor=INK,
            titleColor=INK,
            labelFontSize=12,
            gridColor=STYLE["grid.color"],
            domainColor=INK,
        ),
    ).to_dict()


def all_charts(approaches: Sequence[str]) -> dict[str, Any]:
    """All charts by their kinds; the page has several of a kind, and their titles."""
    return {
        "roll": tilt_chart("roll", approaches),
        "pitch": tilt_chart("pitch", approaches),
        "sds": sds_chart(approaches),
        "ratio": interval_chart("ratio", 1, approaches),
        "coverage": interval_chart("coverage", 95, approaches),
        "correlations": correlation_chart(),
    }


def tilt_chart(angle: str, approaches: Sequence[str]) -> dict[str, Any]:
    """Tilt error in one angle, a point and a range for each set-up.

    Its data are set-ups, each with `row`, the row that it stands in, `alike`, whether it differs
    from the chosen one only in what the rows show, and `chosen`. The error that is allowed comes
    from the input `need` of the page.
    """
    rows = alt.Chart(alt.NamedData(DATA)).encode(
        y=_rows("row"),
        yOffset=_offset(approaches),
        color=_colour(approaches),
        opacity=_given("datum.alike", 1, PALE),
        tooltip=[
            *_words("model", "scheme", "approach", "state"),
            *_numbers({f"{angle}_{name}": title for name, title in SHOWN.items()}),
        ],
    )
    # Both angles have the same axis; beyond its ends there is room for the crosses.
    x = alt.X(f"{angle}_rms:Q", title=None, axis=alt.Axis(format="~r", tickCount=6))
    x = x.scale(type="log", nice=False, padding=16)
    ends = rows.mark_rule().encode(x="least:Q", x2="most:Q", opacity=alt.value(0))
    ranges = rows.mark_rule(size=2).encode(x=f"{angle}_low:Q", x2=f"{angle}_high:Q")
    ticks = rows.mark_tick(thickness=2, size=10).encode(x=f"{angle}_q95:Q")
    points = rows.mark_point(filled=True, size=55).encode(x=x, shape=_shape(approaches))
    chosen = rows.mark_point(size=230, strokeWidth=2).encode(
        x=x, color=alt.value(INK), opacity=_given("datum.chosen", 1, 0)
    )
    marks = alt.Scale(domain=list(FAILED), range=list(FAILED.values()))
    failed = rows.mark_point(size=45, strokeWidth=2).encode(
        x=alt.value(alt.ExprRef("width - 8")),
        shape=alt.Shape("failed:N", scale=marks, legend=None),
        opacity=_given("!datum.failed", 0, alt.ExprRef(f"datum.alike ? 1 : {PALE}")),
    )
    need = alt.param(name="need", bind=alt.BindDirect(element="#need"))
    wanted = alt.Chart(alt.InlineData([{}])).transform_calculate(wanted="+need")
    wanted = wanted.transform_filter("datum.wanted > 0").mark_rule(color=INK, strokeDash=DASHES)
    layers = alt.layer(wanted.encode(x="wanted:Q"), ends, ranges, ticks, chosen, points, failed)
    layers = layers.resolve_scale(shape="independent").add_params(need)
    return _finished(layers, "Tilt error of the set-ups that are shown")


def sds_chart(approaches: Sequence[str]) -> dict[str, Any]:
    """Standard deviations of the parameters of one unit: a posteriori, empirical, linear theory."""
    rows = _parameters(approaches)
    x = alt.X("posteriori:Q", title=None, axis=alt.Axis(format="~r", tickCount=5))
    bars = rows.mark_bar(opacity=BAR).encode(x=x)
    ranges = rows.mark_rule(size=2).encode(x="posteriori_low:Q", x2="posteriori_high:Q")
    theory = rows.mark_tick(thickness=2, size=14).encode(x="linear:Q", color=alt.value(INK))
    points = rows.mark_point(filled=True, size=60).encode(x="empirical:Q", shape=_shape(approaches))
    layers = alt.layer(bars, ranges, theory, points)
    return _finished(layers, "Standard deviations of the parameters")


def interval_chart(quantity: str, right: float, approaches: Sequence[str]) -> dict[str, Any]:
    """A quantity of each parameter with its 95 % interval, beside the value that is right."""
    rows = _parameters(approaches)
    axis = alt.Axis(format="~r", tickCount=5)
    x = alt.X(f"{quantity}:Q", title=None, scale=alt.Scale(zero=False), axis=axis)
    line = (
        alt.Chart(alt.InlineData([{"value": right}]))
        .mark_rule(color=INK, strokeDash=DASHES)
        .encode(x="value:Q")
    )
    ranges = rows.mark_rule(size=2).encode(x=f"{quantity}_low:Q", x2=f"{quantity}_high:Q")
    points = rows.mark_point(filled=True, size=60).encode(x=x, shape=_shape(approaches))
    return _finished(alt.layer(line, ranges, points), f"The {quantity} of each parameter")


def correlation_chart() -> dict[str, Any]:
    """Matrix of correlations; its data: `first`, `second` and `value`, in thousandths."""
    size = alt.ExprRef("min(12, width / 2.7 / domain('x').length)")
    axis = alt.Axis(
        title=None,
        labelAngle=0,
        labelFontSize=size,
        labelOverlap=False,
        ticks=False,
        domain=False,
        grid=False,
    )
    fields = alt.Chart(alt.NamedData(DATA)).transform_calculate(
        correlation="datum.value === null ? null : datum.value / 1000",
        size="abs(datum.value) / 1000",
        label="datum.size < 0.005 ? '' : replace(format(datum.correlation, '.2f'), '0.', '.')",
    )
    fields = fields.encode(
        x=alt.X("second:N", sort=None, axis=axis, scale=alt.Scale(paddingInner=0.04)),
        y=alt.Y("first:N", sort=None, axis=axis, scale=alt.Scale(paddingInner=0.04)),
        tooltip=[*_words("first", "second"), *_numbers({"correlation": "correlation"})],
    )
    scale = alt.Scale(domain=[0, 1], range=list(BLUES), type="pow", exponent=0.6)
    colour = alt.Color("size:Q", scale=scale, legend=None)
    white = alt.condition("datum.size > 0.45", alt.value("white"), alt.value(INK))
    layers = alt.layer(
        fields.mark_rect().encode(color=colour),
        fields.mark_text(fontSize=size).encode(text="label:N", color=white),
    )
    return _finished(layers, "Correlations of the parameters", "container")


def _parameters(approaches: Sequence[str]) -> alt.Chart:
    return alt.Chart(alt.NamedData(DATA)).encode(
        y=_rows("parameter"),
        yOffset=_offset(approaches),
        color=_colour(approaches),
        tooltip=[
            *_words("parameter", "approach"),
            *_numbers({"empirical": "empirical sd", "posteriori": "sd a posteriori"}),
            *_words("unit"),
            *_numbers({"ratio": "ratio", "coverage": "coverage / %"}),
        ],
    )


def _rows(field: str) -> alt.Y:
    axis = alt.Axis(title=None, ticks=False, domain=False, grid=True, labelLimit=170)
    return alt.Y(f"{field}:N", sort=None, axis=axis)


def _words(*fields: str) -> list[alt.Tooltip]:
    return [alt.Tooltip(f"{field}:N") for field in fields]


def _numbers(titles: Mapping[str, str]) -> list[alt.Tooltip]:
    """Numbers of a tooltip, with three digits, by their fields."""
    return [
        alt.Tooltip(f"{field}:Q", title=title, format=".3~r") for field, title in titles.items()
    ]


def _given(test: str, opacity: float, otherwise: Any) -> Any:
    """Opacity that depends on the data."""
    return alt.condition(test, alt.value(opacity), alt.value(otherwise))


def _offset(approaches: Sequence[str]) -> alt.YOffset:
    return alt.YOffset("approach:N", scale=alt.Scale(domain=list(approaches)))


def _colour(approaches: Sequence[str]) -> alt.Color:
    colours = [approach_colour(name) for name in approaches]
    return alt.Color(
        "approach:N", scale=alt.Scale(domain=list(approaches), range=colours), legend=None
    )


def _shape(approaches: Sequence[str]) -> alt.Shape:
    shapes = [SHAPES[approach_marker(name)] for name in approaches]
    return alt.Shape(
        "approach:N", scale=alt.Scale(domain=list(approaches), range=shapes), legend=None
    )


def _finished(
    chart: alt.LayerChart | alt.FacetChart, description: str, height: Any = STEPS
) -> dict[str, Any]:
    """Give a chart the size of its place on the page; as plain data, since Altair copies a lot."""
    size = {"width": "container", "height": height}
    return {**chart.to_dict(), **size, "description": description}
