"""The tilt error that each model, scheme and approach leaves."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.units import GON, attitude_unit, display_unit, to_attitude, to_display
from accelstudy.drawing.style import (
    FULL,
    HATCH,
    MISSING,
    Style,
    ink_on,
    log_ticks,
    model_title,
    new_figure,
    say_empty,
    shown,
)
from accelstudy.schemes import get_scheme
from accelstudy.study.figures.base import Tables, register
from accelstudy.study.figures.factors import NOISES, varies

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.colors import Colormap, LogNorm
    from matplotlib.figure import Figure
    from matplotlib.image import AxesImage

    from accelstudy.study.config import StudyConfig

Array = NDArray[np.float64]

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
    "Tilt error that each calibration leaves",
    """
    The tilt error of roll (upper) and pitch (lower half) that a calibration leaves, over all
    attitudes up to the study's largest tilt, for each scheme (rows), model (columns) and approach
    (left and right). The upper number is the rms over attitudes and calibrations, which also gives
    the colour; the lower one, the same for roll and pitch, is what both angles stay below in
    95 % of the calibrations: decide by it where one calibration must do. The noise of the leveled
    reading itself comes on top. Hatched cells cannot be estimated; fields left white are not part
    of the study. Unless the study says otherwise the simulated sensor has just the effects of the
    model, so that a larger model faces a more difficult sensor: compare schemes and approaches
    within a column.
    """,
    tables=("cells", "leveling"),
    when=lambda study: not any(varies(study, noise) for noise in NOISES),
)
def tilt_errors(tables: Tables, study: StudyConfig) -> Figure:
    """Matrices of scheme × model, one for each angle and approach, with the rms and its q95."""
    from matplotlib.colors import LogNorm
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch, Rectangle

    table = _with_tilt(tables["cells"], tables["leveling"])
    schemes = sorted(set(table["scheme"]), key=lambda name: (get_scheme(name).n_positions, name))
    models = list(dict.fromkeys(table["model"]))
    approaches = list(dict.fromkeys(table["approach"]))
    errors = table[[f"{angle}_rms" for angle in ANGLES]].to_numpy(float)
    errors = errors[np.isfinite(errors)]
    norm = LogNorm(*np.quantile(errors, (0, 0.97))) if len(errors) else LogNorm(1, 10)
    unit = display_unit("rad")
    one_reading = float(to_display(study.sigma_force / study.gravity_mps2, "rad"))

    fig = new_figure(FULL, 62 + 2 * ROW_MM * max(len(schemes), 4))
    axes = fig.subplots(2, len(approaches), sharex=True, sharey=True, squeeze=False)
    image = None
    for row, angle in zip(axes, ANGLES, strict=True):
        for ax, approach in zip(row, approaches, strict=True):
            its = table[table["approach"] == approach]
            rms, q95 = (
                its.pivot_table(f"{angle}_{what}", "scheme", "model", dropna=False)
                .reindex(index=schemes, columns=models)
                .to_numpy(float)
                for what in ("rms", "q95")
            )
            image = _draw_matrix(ax, rms, q95, norm)
            for scheme, model in zip(its["scheme"], its["model"], strict=True):
                i, j = schemes.index(scheme), models.index(model)
                if not np.isfinite(rms[i, j]):
                    ax.add_patch(Rectangle((j - 0.5, i - 0.5), 1, 1, **NOT_ESTIMABLE))
            ax.set_title(f"{angle}, {approach}")
    axes[0, 0].set_yticks(range(len(schemes)), [get_scheme(name).title for name in schemes])
    axes[0, 0].set_xticks(range(len(models)), [model_title(name) for name in models])
    for ax in axes[-1]:
        ax.tick_params(axis="x", rotation=90)
    if image is not None and len(errors):
        largest = to_attitude(study.leveling.max_tilt_gon * GON)
        label = f"tilt error (rms) at tilts up to {largest:g} {attitude_unit()} / {unit}"
        bar = fig.colorbar(image, ax=axes, label=label, pad=0.02, aspect=50, extend="max")
        log_ticks(bar.ax.yaxis, float(norm.vmin or 1), float(norm.vmax or 10))
    text: Style = {"linestyle": "", "marker": ""}
    noise = f"{study.sigma_force * 1e3:.3g} mm/s²"
    labels = [
        f"upper number: rms / {unit}; lower: both angles stay below in 95 % of the calibrations",
        f"not in it: the noise of a single reading, at {noise} and level {one_reading:.1f} {unit}",
    ]
    fig.legend(
        handles=[
            *[Line2D([], [], **text, label=label) for label in labels],
            Patch(**NOT_ESTIMABLE, label="not estimable"),
        ],
        loc="outside lower center",
    )
    return fig


def _with_tilt(cells: pd.DataFrame, leveling: pd.DataFrame) -> pd.DataFrame:
    """Cells with the rms of each angle, and the 95 % quantile of both, as shown; NaN if none."""
    import pandas as pd

    by_cell = leveling.set_index("cell") if len(leveling) else pd.DataFrame()
    columns = {}
    for angle in ANGLES:
        for what, name in (("rms", f"{angle}_rms_mgon"), ("q95", "both_rms_q95_mgon")):
            values = cells["cell"].map(by_cell.get(name, {})).astype(float)
            columns[f"{angle}_{what}"] = shown(values, "mgon")[0]
    return cells.assign(**columns)


def _draw_matrix(ax: Axes, rms: Array, q95: Array, norm: LogNorm) -> AxesImage:
    image = ax.imshow(rms, norm=norm, cmap=_light(), aspect="auto", interpolation="none")
    ax.grid(False)
    ax.tick_params(length=0)
    ax.spines[:].set_visible(False)
    for i, j in np.argwhere(np.isfinite(rms)):
        colour = ink_on(image, rms[i, j])
        for value, offset, size in ((rms[i, j], -0.2, 7), (q95[i, j], 0.24, 5.8)):
            ax.text(
                j,
                i + offset,
                _short(value),
                ha="center",
                va="center",
                fontsize=size,
                color=colour,
                in_layout=False,
            )
    if not np.isfinite(rms).any():
        say_empty(ax)
    return image


def _light() -> Colormap:
    """Make colours from light to medium, on which dark numbers can be read; dark is beyond."""
    from matplotlib import colormaps
    from matplotlib.colors import LinearSegmentedColormap

    whole = colormaps["YlGnBu"]
    return LinearSegmentedColormap.from_list(
        "light", whole(np.linspace(0, 0.55, 256))
    ).with_extremes(over=whole(0.9))


def _short(value: float) -> str:
    """One decimal below 100."""
    return f"{value:.1f}" if value < 100 else f"{value:.0f}"
