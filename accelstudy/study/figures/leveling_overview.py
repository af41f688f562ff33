"""The tilt error that each model, scheme and approach leaves."""

from __future__ import annotations

import numpy as np

from accelstudy.basics.units import GON, attitude_unit, shown_unit, to_attitude, to_display
from accelstudy.drawing import style
from accelstudy.schemes import get_scheme
from accelstudy.study.figures.factors import NOISES, varies
from accelstudy.study.figures.panels import FAILED, Image, fields, handle, panels, tilt_errors
from accelstudy.study.figures.registry import Axes, DataFrame, Figure, Study, Tables, register

ROW_MM = 6.0


@register(
    *("leveling-overview", "cells", "leveling"),
    when=lambda study: not any(varies(study, noise) for noise in NOISES),
)
def leveling_overview(tables: Tables, study: Study) -> Figure:
    """Tilt error that each calibration leaves.

    The tilt error of roll (upper) and pitch (lower half) that a calibration leaves, over all
    attitudes up to the study's largest tilt, for each scheme (rows), model (columns) and approach
    (left and right). The upper number is the rms over attitudes and calibrations, which also gives
    the colour; the lower one, the same for roll and pitch, is what both angles stay below in
    95 % of the calibrations: decide by it where one calibration must do. The noise of the leveled
    reading itself comes on top. Crosses are cells that cannot be estimated; empty fields are not
    part of the study. Unless the study says otherwise the simulated sensor has just the effects of
    the model, so that a larger model faces a more difficult sensor: compare schemes and approaches
    within a column.
    """
    cells = tables["cells"].sort_values(["n_positions", "scheme"])
    table = tilt_errors(cells, tables["leveling"]).rename(columns={"value": "number"})
    table["text"] = [_text(*pair) for pair in zip(table["number"], table["both"], strict=True)]
    schemes = {name: get_scheme(name).title for name in table["scheme"].unique()}
    models = {name: style.model_title(name) for name in tables["cells"]["model"].unique()}
    low, high = table["number"].agg(["min", "max"]).fillna(1.0)
    look: style.Style = {"norm": "log", "vmin": low, "vmax": high, "cmap": "YlGnBu"}

    def draw(ax: Axes, rows: DataFrame) -> Image:
        failed = rows[rows["number"].isna()]
        x, y = failed["model"].map([*models].index), failed["scheme"].map([*schemes].index)
        ax.plot(x, y, color="#999999", **FAILED)
        ax.tick_params(axis="x", rotation=90)
        return fields(ax, rows, ("scheme", schemes), ("model", models), aspect="auto", **look)

    unit, noise = shown_unit("rad"), study.noise.sensor.sigma_mps2
    largest = f"{to_attitude(study.leveling.max_tilt_gon * GON):g} {attitude_unit()}"
    reading = f"{to_display(noise / study.gravity_mps2, 'rad'):.1f} {unit}"
    words = (
        "upper number: rms; lower: both stay below in 95 % of the calibrations",
        f"not in it: a single reading, at {noise * 1e3:.3g} mm/s² and level {reading}",
    )
    return panels(
        table,
        draw,
        20 + ROW_MM * max(len(schemes), 4),
        row="group",
        column="approach",
        title="{group}, {approach}",
        colours=f"tilt error (rms) at tilts up to {largest} / {unit}",
        legend=[*(handle(each, linestyle="") for each in words), handle("not estimable", **FAILED)],
    )


def _text(*values: float) -> str:
    """Numbers below each other, with one decimal below 100."""
    return "\n".join(f"{x:.{1 if x < 100 else 0}f}" for x in values if np.isfinite(x))
