"""Figures 5 and 6: total effects of forces and parameters on roll and pitch."""

from __future__ import annotations

from accelstudy.basics.units import GON, attitude_unit, to_attitude
from accelstudy.drawing import style
from accelstudy.study.figures.panels import handle, in_group_order, line_looks, panels
from accelstudy.study.figures.registry import Axes, DataFrame, Figure, Study, Tables, register

THIN: style.Style = {"linewidth": 0.9, "markersize": 1.8}
MIN_PERCENT = 1.0
"""Percent; inputs that are below everywhere are left out."""


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
    table = in_group_order(
        table.assign(
            group=group,
            roll=to_attitude(table["roll_gon"] * GON),
            head=[rf"$\theta$ = {x:g} {unit}" for x in to_attitude(table["pitch_gon"] * GON)],
            label=group.map(style.group_label).str.replace("orthogonality", "orthogo-\nnality"),
        )
    )
    looks: dict[str, style.Style] = {}
    for name, members in table.groupby("group", sort=False)["input"]:
        looks |= line_looks(members, color=style.group_colour(str(name)), **THIN)

    def draw(ax: Axes, rows: DataFrame) -> None:
        ax.axhline(0, color=style.INK, linewidth=0.6)
        ax.set_xticks([-50, 50])
        ax.set_yscale("symlog", linthresh=MIN_PERCENT, linscale=0.4)
        ax.set_ylim(-0.1, 130)
        for name, line in rows.sort_values("roll").groupby("input"):
            look = looks[str(name)]
            ax.errorbar(line["roll"], line["value"], line["half"], elinewidth=0.5, **look)

    fig = panels(
        table,
        draw,
        22,
        row="label",
        column="head",
        xlabel=rf"roll $\phi$ / {unit}",
        ylabel="{label}",
        legend=[handle(style.symbol(name), **look) for name, look in looks.items()],
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
