"""Figures 5 and 6, total effects of forces and parameters, and Shapley effects beside them."""

from __future__ import annotations

from accelstudy.basics.units import GON, attitude_unit, to_attitude
from accelstudy.drawing import style
from accelstudy.study.figures.panels import in_group_order, narrow, panels
from accelstudy.study.figures.registry import Axes, DataFrame, Figure, Study, Tables, register

LINE_STYLES = ("-", "--", ":")
MARKERS = ("o", "^", "s")
"""Styles of the first, second and third member of a group."""
MIN_PERCENT = 1.0
"""Percent; inputs that are below everywhere are left out."""
MIN_CHANGE = 0.5
"""Percentage points; groups of inputs that change by less are left out."""
SYMBOL_DISTANCE = 0.17
"""Height of a symbol, as a share of its panel."""
RING: style.Style = {
    **{"linestyle": "", "marker": "o", "markersize": 6},
    **{"markerfacecolor": "none", "markeredgecolor": style.INK, "markeredgewidth": 0.7},
}
PLACE = ["output", "roll_gon", "pitch_gon", "input"]


def effects_over_roll(tables: Tables, study: Study, number: int, output: str) -> Figure:
    """Figure {number}: total effects on {output}, gravity-based calibration.

    Total effects of the measured forces and of the calibration parameters on {output}, with the
    standard deviations of the calibration by gravity alone; one column for each pitch that is not
    negative. The scale is logarithmic above 1 % and linear below. Bars are 95 % confidence
    intervals, an effect within its own counts as zero, and inputs below 1 % everywhere are left
    out. The parameters are sampled independently, although those of a calibration are correlated.
    """
    table = read_shares(tables["sensitivity"], "gravity")
    table = table[(table["output"] == output) & (table["pitch_gon"] >= 0)]
    table = table.assign(value=100 * table["share"], half=100 * table["ci95"], overtakes=False)
    drawn = table.groupby("input")["value"].transform("max") >= MIN_PERCENT
    scale = {"value": "symlog", "linthresh": MIN_PERCENT, "linscale": 0.4}
    table = table[drawn].assign(low=-0.1, high=500, on="")
    return over_roll(table, scale, MIN_PERCENT, f"total effect on {output} / %")


for _number, _output in ((5, "roll"), (6, "pitch")):
    _chosen: style.Style = {"number": _number, "output": _output}
    register(f"figure-{_number}", "sensitivity", category="Paper", **_chosen)(effects_over_roll)


@register("shapley", "shapley", category="Paper")
def shapley(tables: Tables, study: Study) -> Figure:
    """Shapley effects on roll and pitch, gravity-based calibration.

    What the correlations of the calibration's parameters change: Shapley effects, with the
    covariance matrix of the gravity-based calibration, less the total effects of figures 5 and 6,
    which take the parameters as independent. In percentage points of the variance of roll (upper
    rows) and pitch (lower rows), one column for each pitch that is not negative; groups of inputs
    that change by less than half a point are left out. A ring says that the input overtakes
    another one there: it has the larger Shapley effect and the smaller total effect, by more than
    2 %.
    """
    table = changes(tables["shapley"])
    of_group = table.groupby(["output", "group"])
    low, high = of_group["value"].transform("min"), of_group["value"].transform("max")
    drawn = (low <= -MIN_CHANGE) | (high >= MIN_CHANGE) | of_group["overtakes"].transform("any")
    low, high = 1.7 * low.clip(upper=0) - 0.1, 1.7 * high.clip(lower=0) + 0.1
    title = "Shapley effect less total effect / percentage points\n"
    title += f"all others: less than {MIN_CHANGE:g}; ○ overtakes another input"
    table = table.assign(low=low, high=high, on="\non " + table["output"])[drawn]
    return over_roll(table, {"value": "linear"}, 0.2 * MIN_CHANGE, title)


# --- tables --------------------------------------------------------------------------------------


def read_shares(table: DataFrame, analysis: str) -> DataFrame:
    """Rows of an analysis with `share`: NaN if undefined, 0 if within its confidence interval."""
    rows = table[table["analysis"] == analysis]
    share = rows["total_effect"].where(rows["total_effect"].abs() > rows["ci95"], 0.0)
    return rows.assign(share=share.where(rows["defined"].astype(bool)))


def changes(table: DataFrame) -> DataFrame:
    """Rows with `value`, Shapley less total effect in percentage points, and `overtakes`."""
    import pandas as pd

    from accelstudy.leveling.shares import order_changes

    table = table[(table["analysis"] == "gravity") & (table["pitch_gon"] >= 0)]
    value = 100 * (table["shapley_effect"] - table["total_effect"])
    winners = pd.MultiIndex.from_frame(order_changes(table)[PLACE])
    return table.assign(
        value=value.where(table["defined"].astype(bool)),
        half=0.0,
        overtakes=pd.MultiIndex.from_frame(table[PLACE]).isin(winners),
        group=table["input"].map(style.group_of),
    )


# --- panels --------------------------------------------------------------------------------------


def over_roll(table: DataFrame, scale: style.Style, least: float, title: str) -> Figure:
    """Draw a row of panels for each output and group of inputs, and a column for each pitch.

    So each panel has few lines, and the width of a journal's column is enough for up to four. Its
    vertical axis has a `scale` and goes from `low` to `high`. Lines get their symbol if they reach
    `least`.
    """
    unit, group = attitude_unit(), table["input"].map(style.group_of)
    table = table.assign(
        group=group,
        member=table.groupby(group)["input"].transform(lambda names: names.factorize()[0]),
        roll=to_attitude(table["roll_gon"] * GON),
        head=[rf"$\theta$ = {x:g} {unit}" for x in to_attitude(table["pitch_gon"] * GON)],
        label=group.map(style.group_label).map(narrow) + table["on"],
    )
    table = in_group_order(table).sort_values("output", kind="stable", ascending=False)

    def draw(ax: Axes, rows: DataFrame) -> None:
        ax.axhline(0, color=style.INK, linewidth=0.6)
        ax.set_xticks([-50, 50])
        ax.set_yscale(**scale)
        ax.set_ylim(rows["low"].iloc[0], rows["high"].iloc[0])
        colour = style.group_colour(rows["group"].iloc[0])
        for member, line in rows.sort_values("roll").groupby("member"):
            i = int(str(member))
            look: style.Style = {
                "color": colour,
                "linestyle": LINE_STYLES[i % 3],
                "marker": MARKERS[(i + i // 3) % 3],
            }
            look |= {"linewidth": 0.9, "markersize": 1.8, "elinewidth": 0.5}
            ax.errorbar(line["roll"], line["value"], line["half"], **look)
        ringed = rows[rows["overtakes"]]
        ax.plot(ringed["roll"], ringed["value"], **RING)
        write_symbols(ax, rows, least)

    fig = panels(
        table,
        draw,
        22,
        row="label",
        column="head",
        xlabel=rf"roll $\phi$ / {unit}",
        ylabel="{label}",
        width=style.COLUMN if len(set(table["head"])) <= 4 else style.FULL,
    )
    fig.suptitle(title, fontsize=8)
    return fig


def write_symbols(ax: Axes, rows: DataFrame, least: float) -> None:
    """Write the symbol of each input above the right end of its line or, if it falls, its peak.

    Symbols of negative values stand below, none stands over another one, and an input that does not
    reach `least` has none. The limits of the vertical axis must be set.
    """
    ends = []
    for name, line in rows[rows["roll"] >= 0].dropna(subset="value").groupby("input"):
        line = line.sort_values("roll")
        peak, end = line.iloc[line["value"].abs().to_numpy().argmax()], line.iloc[-1]
        if abs(peak["value"]) >= least:
            at = end if abs(end["value"]) >= 0.5 * abs(peak["value"]) else peak
            place = ax.transData.transform((at["roll"], at["value"]))
            side = -1 if at["value"] < 0 else 1
            height = side * ax.transAxes.inverted().transform(place)[1] + 0.6 * SYMBOL_DISTANCE
            ends.append((side, height, float(at["roll"]), str(name)))
    taken: list[tuple[int, float, float]] = []
    near = 0.5 * rows["roll"].max()
    for side, height, roll, name in sorted(ends):
        below = [h for s, x, h in taken if s == side and abs(x - roll) < near]
        height = max([height, *(other + SYMBOL_DISTANCE for other in below)])
        taken.append((side, roll, height))
        font: style.Style = {"ha": "center", "va": "center", "fontsize": 7.5}
        font |= {"color": style.group_colour(style.group_of(name))}
        across = ax.get_xaxis_transform()
        ax.text(roll, side * height, style.symbol(name), transform=across, **font)
