"""Figures 5 and 6: total effects of forces and parameters on roll and pitch."""

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
LOW, HIGH = -0.1, 500
"""Ends of the vertical axes, percent: symbols stand above the largest share."""
SYMBOL_DISTANCE = 0.17
"""Height of a symbol, as a share of its panel."""


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
    table = table.assign(value=100 * table["share"], half=100 * table["ci95"])
    table = table[table.groupby("input")["value"].transform("max") >= MIN_PERCENT]
    unit, group = attitude_unit(), table["input"].map(style.group_of)
    table = table.assign(
        group=group,
        member=table.groupby(group)["input"].transform(lambda names: names.factorize()[0]),
        roll=to_attitude(table["roll_gon"] * GON),
        head=[rf"$\theta$ = {x:g} {unit}" for x in to_attitude(table["pitch_gon"] * GON)],
        label=group.map(style.group_label).map(narrow),
    )

    def draw(ax: Axes, rows: DataFrame) -> None:
        ax.axhline(0, color=style.INK, linewidth=0.6)
        ax.set_xticks([-50, 50])
        ax.set_yscale("symlog", linthresh=MIN_PERCENT, linscale=0.4)
        ax.set_ylim(LOW, HIGH)
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
        write_symbols(ax, rows)

    fig = panels(
        in_group_order(table),
        draw,
        22,
        row="label",
        column="head",
        xlabel=rf"roll $\phi$ / {unit}",
        ylabel="{label}",
        # Panels have few lines each, so the width of a column is enough for up to four.
        width=style.COLUMN if len(set(table["head"])) <= 4 else style.FULL,
    )
    fig.suptitle(f"total effect on {output} / %", fontsize=8)
    return fig


for _number, _output in ((5, "roll"), (6, "pitch")):
    _chosen: style.Style = {"number": _number, "output": _output}
    register(f"figure-{_number}", "sensitivity", category="Paper", **_chosen)(effects_over_roll)


def read_shares(table: DataFrame, analysis: str) -> DataFrame:
    """Rows of an analysis with `share`: NaN if undefined, 0 if within its confidence interval."""
    rows = table[table["analysis"] == analysis]
    share = rows["total_effect"].where(rows["total_effect"].abs() > rows["ci95"], 0.0)
    return rows.assign(share=share.where(rows["defined"].astype(bool)))


def write_symbols(ax: Axes, rows: DataFrame) -> None:
    """Write the symbol of each input above the right end of its line or, if it falls, its peak.

    None stands over another one, and an input that does not reach `MIN_PERCENT` has none. The
    limits of the vertical axis must be set.
    """
    ends = []
    for name, line in rows[rows["roll"] >= 0].dropna(subset="value").groupby("input"):
        line = line.sort_values("roll")
        peak, end = line.iloc[line["value"].to_numpy().argmax()], line.iloc[-1]
        if peak["value"] >= MIN_PERCENT:
            at = end if end["value"] >= 0.5 * peak["value"] else peak
            place = ax.transData.transform((at["roll"], at["value"]))
            height = ax.transAxes.inverted().transform(place)[1] + 0.6 * SYMBOL_DISTANCE
            ends.append((height, float(at["roll"]), str(name)))
    taken: list[tuple[float, float]] = []
    near = 0.5 * rows["roll"].max()
    for height, roll, name in sorted(ends):
        below = [h for x, h in taken if abs(x - roll) < near]
        height = max([height, *(other + SYMBOL_DISTANCE for other in below)])
        taken.append((roll, height))
        font: style.Style = {"ha": "center", "va": "center", "fontsize": 7.5}
        font |= {"color": style.group_colour(style.group_of(name))}
        ax.text(roll, height, style.symbol(name), transform=ax.get_xaxis_transform(), **font)
