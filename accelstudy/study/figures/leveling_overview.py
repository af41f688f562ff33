"""The tilt error that each model, scheme and approach leaves."""

from __future__ import annotations

import numpy as np

from accelstudy.basics.units import GON, attitude_unit, shown_unit, to_attitude, to_display
from accelstudy.drawing import style
from accelstudy.schemes import get_scheme
from accelstudy.study.figures.factors import NOISES, varies
from accelstudy.study.figures.panels import FAILED, Image, handle, panels, tilt_errors
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
    cells = tables["cells"][["cell", "scheme", "model", "approach"]]
    table = tilt_errors(cells, tables["leveling"]).rename(columns={"value": "rms"})
    schemes = sorted(set(table["scheme"]), key=lambda name: (get_scheme(name).n_positions, name))
    models = list(table["model"].unique())
    titles = [get_scheme(name).title for name in schemes], [*map(style.model_title, models)]
    low, high = table["rms"].agg(["min", "max"]).fillna(1.0)
    look: style.Style = {"norm": "log", "vmin": low, "vmax": high, "cmap": "YlGnBu"}

    def draw(ax: Axes, rows: DataFrame) -> Image:
        rms, both = (
            rows.pivot_table(name, "scheme", "model", dropna=False)
            .reindex(index=schemes, columns=models)
            .to_numpy(float)
            for name in ("rms", "both")
        )
        failed = rows[rows["rms"].isna()]
        x, y = failed["model"].map(models.index), failed["scheme"].map(schemes.index)
        ax.plot(x, y, color="#999999", **FAILED)
        ax.tick_params(axis="x", rotation=90)
        return style.matrix(
            ax, *titles, rms, np.vectorize(_texts)(rms, both), aspect="auto", **look
        )

    unit, noise = shown_unit("rad"), f"{study.sigma_force * 1e3:.3g} mm/s²"
    largest = f"{to_attitude(study.leveling.max_tilt_gon * GON):g} {attitude_unit()}"
    one_reading = f"{to_display(study.sigma_force / study.gravity_mps2, 'rad'):.1f} {unit}"
    legend = [
        handle(
            "upper number: rms; lower: both stay below in 95 % of the calibrations", linestyle=""
        ),
        handle(f"not in it: a single reading, at {noise} and level {one_reading}", linestyle=""),
        handle("not estimable", **FAILED),
    ]
    return panels(
        table,
        draw,
        20 + ROW_MM * max(len(schemes), 4),
        row="group",
        column="approach",
        title="{group}, {approach}",
        colours=f"tilt error (rms) at tilts up to {largest} / {unit}",
        legend=legend,
    )


def _texts(*values: float) -> str:
    """Numbers below each other, with one decimal below 100."""
    known = [value for value in values if np.isfinite(value)]
    return "\n".join(f"{value:.{1 if value < 100 else 0}f}" for value in known)
