"""The tilt error that each model, scheme and approach leaves."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from accelstudy.basics.units import GON, attitude_unit, display_unit, to_attitude, to_display
from accelstudy.drawing.style import HATCH, MISSING, Style, log_ticks, model_title, say_empty, shown
from accelstudy.schemes import get_scheme
from accelstudy.study.figures.factors import NOISES, varies
from accelstudy.study.figures.panels import Panel, by_cell, key, matrix, panels, write_values
from accelstudy.study.figures.registry import Tables, register

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.colors import Colormap
    from matplotlib.figure import Figure

    from accelstudy.study.config import Study

ANGLES = ("roll", "pitch")
ROW_MM = 6.0
NOT_ESTIMABLE: Style = {
    "facecolor": MISSING,
    "edgecolor": "#999999",
    "hatch": HATCH,
    "linewidth": 0,
}


@register(
    "leveling-overview",
    tables=("cells", "leveling"),
    when=lambda study: not any(varies(study, noise) for noise in NOISES),
)
def tilt_errors(tables: Tables, study: Study) -> Figure:
    """Tilt error that each calibration leaves.

    The tilt error of roll (upper) and pitch (lower half) that a calibration leaves, over all
    attitudes up to the study's largest tilt, for each scheme (rows), model (columns) and approach
    (left and right). The upper number is the rms over attitudes and calibrations, which also gives
    the colour; the lower one, the same for roll and pitch, is what both angles stay below in
    95 % of the calibrations: decide by it where one calibration must do. The noise of the leveled
    reading itself comes on top. Hatched cells cannot be estimated; fields left white are not part
    of the study. Unless the study says otherwise the simulated sensor has just the effects of the
    model, so that a larger model faces a more difficult sensor: compare schemes and approaches
    within a column.
    """
    from matplotlib.colors import LogNorm
    from matplotlib.patches import Patch, Rectangle

    table = with_tilt(tables["cells"], tables["leveling"])
    schemes = sorted(set(table["scheme"]), key=lambda name: (get_scheme(name).n_positions, name))
    models = list(dict.fromkeys(table["model"]))
    approaches = list(dict.fromkeys(table["approach"]))
    errors = table[[f"{angle}_rms" for angle in ANGLES]].to_numpy(float)
    errors = errors[np.isfinite(errors)]
    norm = LogNorm(*np.quantile(errors, (0, 0.97))) if len(errors) else LogNorm(1, 10)

    def draw(ax: Axes, cells: pd.DataFrame) -> None:
        def square(column: str) -> np.ndarray:
            numbers = cells.pivot_table(column, "scheme", "model", dropna=False)
            return numbers.reindex(index=schemes, columns=models).to_numpy(float)

        rms, q95 = square("rms"), square("both_q95")
        image = matrix(ax, rms, norm=norm, cmap=_light(), aspect="auto")
        ax.spines[:].set_visible(False)
        write_values(ax, image, rms, _short, -0.2)
        write_values(ax, image, np.where(np.isfinite(rms), q95, np.nan), _short, 0.24, 5.8)
        for scheme, model in cells.loc[cells["rms"].isna(), ["scheme", "model"]].to_numpy():
            corner = models.index(model) - 0.5, schemes.index(scheme) - 0.5
            ax.add_patch(Rectangle(corner, 1, 1, **NOT_ESTIMABLE))
        if not np.isfinite(rms).any():
            say_empty(ax)

    grid = [
        [
            Panel(
                table[table["approach"] == approach].assign(rms=table[f"{angle}_rms"]),
                f"{angle}, {approach}",
            )
            for approach in approaches
        ]
        for angle in ANGLES
    ]
    height = 62 + 2 * ROW_MM * max(len(schemes), 4)
    fig, axes = panels(grid, draw, height, sharex=True, sharey=True)
    axes[0, 0].set_yticks(range(len(schemes)), [get_scheme(name).title for name in schemes])
    axes[0, 0].set_xticks(range(len(models)), [model_title(name) for name in models])
    for ax in axes[-1]:
        ax.tick_params(axis="x", rotation=90)
    unit = display_unit("rad")
    if len(errors):
        largest = f"{to_attitude(study.leveling.max_tilt_gon * GON):g} {attitude_unit()}"
        label = f"tilt error (rms) at tilts up to {largest} / {unit}"
        image = axes[0, 0].images[0]
        bar = fig.colorbar(image, ax=axes, label=label, pad=0.02, aspect=50, extend="max")
        log_ticks(bar.ax.yaxis, float(norm.vmin or 1), float(norm.vmax or 10))
    one_reading = float(to_display(study.sigma_force / study.gravity_mps2, "rad"))
    noise = f"{study.sigma_force * 1e3:.3g} mm/s² and level {one_reading:.1f} {unit}"
    text: Style = {"linestyle": "", "marker": ""}
    lines = [
        f"upper number: rms / {unit}; lower: both angles stay below in 95 % of the calibrations",
        f"not in it: the noise of a single reading, at {noise}",
    ]
    hatched = Patch(**NOT_ESTIMABLE, label="not estimable")
    handles = [*(key(line, **text) for line in lines), hatched]
    fig.legend(handles=handles, loc="outside lower center")
    return fig


def with_tilt(cells: pd.DataFrame, leveling: pd.DataFrame) -> pd.DataFrame:
    """Cells with the rms of each angle, and the 95 % quantile of both, as shown; NaN if none."""
    columns = {f"{angle}_rms": f"{angle}_rms_mgon" for angle in ANGLES}
    columns["both_q95"] = "both_rms_q95_mgon"
    values = {
        name: cells["cell"].map(by_cell(leveling, column)).astype(float)
        for name, column in columns.items()
    }
    return cells.assign(**{name: shown(each, "mgon")[0] for name, each in values.items()})


def _light() -> Colormap:
    """Make colours from light to medium, on which dark numbers can be read; dark is beyond."""
    from matplotlib import colormaps
    from matplotlib.colors import LinearSegmentedColormap

    whole = colormaps["YlGnBu"]
    light = LinearSegmentedColormap.from_list("light", whole(np.linspace(0, 0.55, 256)))
    return light.with_extremes(over=whole(0.9))


def _short(value: float) -> str:
    """One decimal below 100."""
    return f"{value:.1f}" if value < 100 else f"{value:.0f}"
