"""Figure 4: total effects of the forces on roll and pitch, by Sobol and by linear theory."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from accelstudy.basics.units import GON, STANDARD_GRAVITY, attitude_unit, to_attitude
from accelstudy.drawing.style import FULL, INK, Style, new_figure, say_empty, symbol
from accelstudy.leveling.angles import jacobian, specific_force
from accelstudy.study.figures.base import Tables, of_the_paper, register
from accelstudy.study.figures.total_effects import NO_DATA, read_shares

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.collections import QuadMesh
    from matplotlib.figure import Figure

    from accelstudy.study.config import StudyConfig

Array = NDArray[np.float64]

GREEK = {"roll": "$\\phi$", "pitch": "$\\theta$"}
UNDEFINED: Style = {"linestyle": "", "marker": "x", "markersize": 3.5, "color": "#999999"}


@register(
    "figure-4",
    "Figure 4: total effects of the forces on roll and pitch",
    """
    Total effects of the three measured forces on roll (upper row) and pitch (lower row) over the
    attitude, without calibration parameters: the share of the angle's variance that would remain
    if the other two forces were known. Circles are Sobol's method on the grid of the study, in the
    colours of the map behind them, which is linear theory; where a circle shows its edge only, the
    two agree. The line is where a force has half of the variance. Effects within their own
    confidence interval count as zero, and crosses stand where there is no variance to share. Roll
    follows from f_y near level and from f_z as the sensor rolls over; pitch follows from f_x and,
    as the sensor pitches, increasingly from the other two.
    """,
    category="Paper",
    tables=("sensitivity",),
    when=of_the_paper,
)
def effects_of_forces(tables: Tables, study: StudyConfig) -> Figure:
    """Maps over roll and pitch, one for each output and force, by linear theory and by Sobol."""
    from matplotlib.lines import Line2D

    from accelstudy.leveling.sensitivity import FORCES, OUTPUTS

    table = read_shares(tables["sensitivity"], "forces")
    fig = new_figure(FULL, 100)
    axes = fig.subplots(len(OUTPUTS), len(FORCES), sharex=True, sharey=True)
    roll, pitch = _fine(table["roll_gon"], 200), _fine(table["pitch_gon"], 99.9)
    theory = linear_shares(roll, pitch)
    image, largest = None, 0.0
    for k, output in enumerate(OUTPUTS):
        for i, force in enumerate(FORCES):
            ax = axes[k, i]
            cells = table[(table["output"] == output) & (table["input"] == force)]
            ax.set_title(f"{symbol(force)} on {output} {GREEK[output]}")
            ax.grid(False)
            if cells.empty:
                say_empty(ax, NO_DATA)
                continue
            image = _draw_map(ax, roll, pitch, theory[..., k, i])
            _draw_circles(ax, cells)
            at = linear_shares(cells["roll_gon"], cells["pitch_gon"], grid=False)[..., k, i]
            off = np.abs(cells["share"].to_numpy(float) - at)
            largest = max(largest, np.nanmax(off, initial=0.0))
    for ax in axes[-1]:
        ax.set_xlabel(f"roll $\\phi$ / {attitude_unit()}")
    for ax in axes[:, 0]:
        ax.set_ylabel(f"pitch $\\theta$ / {attitude_unit()}")
    if image is not None:
        fig.colorbar(image, ax=axes, label="total effect (share of variance)", pad=0.02)
        undefined = [Line2D([], [], **UNDEFINED, label="no variance to share")]
        undefined = [] if table["defined"].all() else undefined
        circle: Style = {"linestyle": "", "marker": "o", "color": INK, "markerfacecolor": "none"}
        fig.legend(
            handles=[
                Line2D([], [], **_half(), label="a share of 0.5, by linear theory"),
                Line2D([], [], **circle, label=f"Sobol, at most {largest:.3f} from linear theory"),
                *undefined,
            ],
            loc="outside lower center",
            ncols=3,
        )
    return fig


def _half() -> Style:
    """Style of the line at a share of a half."""
    from matplotlib.patheffects import Normal, Stroke

    edge = [Stroke(linewidth=1.8, foreground=INK), Normal()]
    return {"color": "white", "linewidth": 1, "path_effects": edge}


def linear_shares(roll_gon: ArrayLike, pitch_gon: ArrayLike, *, grid: bool = True) -> Array:
    """Shares (..., 2, 3) of equally noisy forces in the variance of roll and pitch, linearly.

    Over the grid of the two angles, (pitch, roll, 2, 3), or for pairs of them.
    """
    roll, pitch = np.asarray(roll_gon, float) * GON, np.asarray(pitch_gon, float) * GON
    if grid:
        roll, pitch = np.meshgrid(roll, pitch)
    squares = jacobian(np.stack(specific_force(roll, pitch, STANDARD_GRAVITY), axis=-1)) ** 2
    return squares / squares.sum(axis=-1, keepdims=True)


def _fine(values: pd.Series, limit: float) -> Array:
    """Angles from just below the lowest to just above the highest of a grid, in gon."""
    if values.empty:
        return np.zeros(1)
    return np.linspace(max(values.min() - 5, -limit), min(values.max() + 5, limit), 101)


def _draw_map(ax: Axes, roll: Array, pitch: Array, shares: Array) -> QuadMesh:
    x, y = to_attitude(roll * GON), to_attitude(pitch * GON)
    image = ax.pcolormesh(
        x, y, shares, shading="gouraud", vmin=0, vmax=1, cmap="viridis", rasterized=True
    )
    if shares.min() < 0.5 < shares.max():
        lines = ax.contour(x, y, shares, levels=[0.5], colors="white", linewidths=1)
        lines.set_path_effects(_half()["path_effects"])
    return image


def _draw_circles(ax: Axes, cells: pd.DataFrame) -> None:
    """Sobol's total effects as circles in the colours of the map; a cross where there is none."""
    from accelstudy.leveling.sensitivity import OUTPUTS

    x, y = (to_attitude(cells[f"{name}_gon"].to_numpy(float) * GON) for name in OUTPUTS)
    share = cells["share"].to_numpy(float)
    defined = np.isfinite(share)
    edge: Style = {"edgecolors": "white", "linewidths": 0.4, "s": 12}
    ax.scatter(x[defined], y[defined], c=share[defined], vmin=0, vmax=1, cmap="viridis", **edge)
    ax.plot(x[~defined], y[~defined], **UNDEFINED)
