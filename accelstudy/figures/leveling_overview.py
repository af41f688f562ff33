"""Which model, scheme and approach leaves which tilt error."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.patches import Patch, Rectangle

from accelstudy.figures.factors import NOISES, varies
from accelstudy.figures.registry import Tables, figure
from accelstudy.figures.style import (
    FULL,
    HATCH,
    INK,
    MISSING,
    Style,
    log_ticks,
    model_title,
    new_figure,
    say_empty,
)
from accelstudy.schemes import get_scheme
from accelstudy.study.config import StudyConfig

ANGLES = ("roll", "pitch")
ROW_MM = 4.6
NOT_ESTIMABLE: Style = {
    "facecolor": MISSING,
    "edgecolor": "#999999",
    "hatch": HATCH,
    "linewidth": 0,
}


@figure(
    "leveling-overview",
    title="Tilt error that each calibration leaves",
    category="Study",
    tables=("cells", "leveling"),
    when=lambda study: not any(varies(study, noise) for noise in NOISES),
)
def tilt_errors(tables: Tables, study: StudyConfig) -> Figure:
    """Matrices of scheme × model, one for each angle and approach, with the rms in mgon."""
    table = _with_rms(tables["cells"], tables["leveling"])
    schemes = sorted(set(table["scheme"]), key=lambda name: (get_scheme(name).n_positions, name))
    models = list(dict.fromkeys(table["model"]))
    approaches = list(dict.fromkeys(table["approach"]))
    known = table[list(ANGLES)].to_numpy(float)
    known = known[np.isfinite(known)]
    norm = LogNorm(*np.quantile(known, (0, 0.97))) if len(known) else LogNorm(1, 10)

    fig = new_figure(FULL, 58 + 2 * ROW_MM * max(len(schemes), 4))
    axes = fig.subplots(2, len(approaches), sharex=True, sharey=True, squeeze=False)
    image = None
    for row, angle in zip(axes, ANGLES, strict=True):
        for ax, approach in zip(row, approaches, strict=True):
            its = table[table["approach"] == approach]
            grid = its.pivot_table(angle, "scheme", "model", dropna=False)
            grid = grid.reindex(index=schemes, columns=models)
            image = _draw_matrix(ax, grid, set(zip(its["scheme"], its["model"], strict=True)), norm)
            ax.set_title(f"{angle}, {approach}")
    axes[0, 0].set_yticks(range(len(schemes)), [get_scheme(name).title for name in schemes])
    axes[0, 0].set_xticks(range(len(models)), [model_title(name) for name in models])
    for ax in axes[-1]:
        ax.tick_params(axis="x", rotation=90)
    if image is not None and len(known):
        bar = fig.colorbar(
            image, ax=axes, label="rms tilt error / mgon", pad=0.02, aspect=50, extend="max"
        )
        log_ticks(bar.ax.yaxis, float(norm.vmin or 1), float(norm.vmax or 10))
    fig.legend(handles=[Patch(**NOT_ESTIMABLE, label="not estimable")], loc="outside lower center")
    return fig


def _with_rms(cells: pd.DataFrame, leveling: pd.DataFrame) -> pd.DataFrame:
    """Cells with the rms error of each angle, NaN where there is none."""
    found = leveling.set_index("cell") if len(leveling) else pd.DataFrame()
    rms = {angle: cells["cell"].map(found.get(f"{angle}_rms_mgon", {})) for angle in ANGLES}
    return cells.assign(**rms).astype(dict.fromkeys(ANGLES, float))


def _draw_matrix(
    ax: Axes, grid: pd.DataFrame, in_study: set[tuple[str, str]], norm: LogNorm
) -> AxesImage:
    values = grid.to_numpy(float)
    image = ax.imshow(values, norm=norm, cmap="viridis_r", aspect="auto", interpolation="none")
    ax.grid(False)
    ax.tick_params(length=0)
    ax.spines[:].set_visible(False)
    middle = np.sqrt(float(norm.vmin or 1) * float(norm.vmax or 1))
    for i, scheme in enumerate(grid.index):
        for j, model in enumerate(grid.columns):
            if np.isfinite(values[i, j]):
                ax.text(
                    j,
                    i,
                    _short(values[i, j]),
                    ha="center",
                    va="center",
                    fontsize=7,
                    color="white" if values[i, j] > middle else INK,
                )
            elif (scheme, model) in in_study:
                ax.add_patch(Rectangle((j - 0.5, i - 0.5), 1, 1, **NOT_ESTIMABLE))
    if not np.isfinite(values).any():
        say_empty(ax)
    return image


def _short(value: float) -> str:
    return f"{value:.1f}" if value < 100 else f"{value:.0f}"
