"""Figures 2 to 4: how accurately roll and pitch follow from a noisy specific force, and why."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from accelstudy.basics.units import (
    GON,
    STANDARD_GRAVITY,
    attitude_unit,
    display_unit,
    to_attitude,
    to_display,
)
from accelstudy.drawing.style import ANGLE_COLOURS, COLUMN, INK, Style, symbol
from accelstudy.leveling.angles import jacobian, sigma_roll_pitch, specific_force
from accelstudy.study.figures.panels import Array, Panel, key, panels, surface
from accelstudy.study.figures.registry import Tables, of_the_paper, register
from accelstudy.study.figures.total_effects import NO_DATA, read_shares

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from accelstudy.study.config import Study

GREEK = {"roll": r"\phi", "pitch": r"\theta"}
ROLL, PITCH = np.linspace(-100.0, 100.0, 81), np.linspace(-80.0, 80.0, 65)
"""gon"""
TILTED = (0.0, 50.0)
"""Roll and pitch of figure 3, gon."""
UNDEFINED: Style = {"linestyle": "", "marker": "x", "markersize": 3.5, "color": "#999999"}


def axis_label(angle: str) -> str:
    """Label of an axis of roll or pitch."""
    return f"{angle} ${GREEK[angle]}$ / {attitude_unit()}"


def shown_sigma(
    roll_gon: ArrayLike, pitch_gon: ArrayLike, sigma_force: ArrayLike, g: float
) -> Array:
    """Standard deviations (..., 2) of roll and pitch as shown, for equal noise on all axes."""
    roll, pitch, sigma = np.broadcast_arrays(roll_gon, pitch_gon, sigma_force)
    force = np.stack(specific_force(roll * GON, pitch * GON, g), axis=-1)
    return to_display(sigma_roll_pitch(force, sigma[..., None, None] ** 2 * np.eye(3)), "rad")


@register(
    "figure-2",
    category="Paper",
    when=of_the_paper,
)
def accuracy_over_attitude(tables: Tables, study: Study) -> Figure:
    """Figure 2: accuracy of roll and pitch over the attitude.

    Standard deviation of roll (left) and pitch (right) computed from one measured specific force,
    over the attitude, for equal noise on all three axes. Both maps share one colour scale. Roll
    loses accuracy with the cosine of pitch and does not depend on roll itself; pitch is equally
    accurate everywhere.
    """
    from matplotlib.ticker import MultipleLocator

    sigma = shown_sigma(*np.meshgrid(ROLL, PITCH), study.sigma_force, study.gravity_mps2)
    limits = {"vmin": np.floor(sigma.min()), "vmax": np.ceil(sigma.max())}

    def draw(ax: Axes, values: Array) -> None:
        surface(ax, ROLL, PITCH, values, **limits)
        if np.ptp(values) > 1e-6 * values.max():
            _contours(ax, values)
        else:
            same = f"{values.mean():.2f} {display_unit('rad')}\nat every attitude"
            ax.text(0, 0, same, ha="center", va="center", color="white")

    row = [
        Panel(
            sigma[..., k],
            rf"$\sigma_{GREEK[angle]}$ of {angle}",
            axis_label("roll"),
            axis_label("pitch") if k == 0 else "",
        )
        for k, angle in enumerate(GREEK)
    ]
    fig, axes = panels([row], draw, 66, sharex=True, sharey=True)
    axes[0, 0].yaxis.set_major_locator(MultipleLocator(25))
    label = f"standard deviation / {display_unit('rad')}"
    fig.colorbar(axes[0, 0].collections[0], ax=axes, label=label, pad=0.02)
    return fig


def _contours(ax: Axes, values: Array) -> None:
    """Labelled lines at round values, away from the edges."""
    from matplotlib.ticker import LogLocator

    roll, pitch = to_attitude(ROLL * GON), to_attitude(PITCH * GON)
    highest = values[np.abs(pitch) <= 0.94 * pitch.max()].max()
    round_values = LogLocator(subs=(1, 1.5, 2, 3, 5, 7)).tick_values(values.min(), highest)
    levels = [x for x in round_values if values.min() < x < highest]
    lines = ax.contour(roll, pitch, values, levels=levels, colors="white", linewidths=0.7)
    places = [
        (0.0, sign * np.abs(pitch[np.abs(values - level).argmin() // values.shape[1]]))
        for level in lines.levels
        for sign in (-1, 1)
    ]
    ax.clabel(lines, fmt="%g", fontsize=7, manual=places)


@register(
    "figure-3",
    category="Paper",
    when=of_the_paper,
)
def accuracy_over_noise(tables: Tables, study: Study) -> Figure:
    """Figure 3: accuracy of roll and pitch over the sensor noise.

    Standard deviation of roll and pitch over the noise of the accelerometer, in a tilted attitude.
    Both grow linearly; the dots mark the noise of this study. Roll is the less accurate of the two
    because the sensor is pitched.
    """
    noise = np.linspace(0.0, 5.0, 51) * study.sigma_force
    sigma = shown_sigma(*TILTED, noise, study.gravity_mps2)
    at_study = shown_sigma(*TILTED, study.sigma_force, study.gravity_mps2)
    x, unit = study.sigma_force * 1e3, display_unit("rad")

    def draw(ax: Axes, sigma: Array) -> None:
        ax.vlines(x, 0, at_study.max(), color="#777777", linewidth=0.8, linestyle=":")
        for i, (angle, greek) in enumerate(GREEK.items()):
            label = rf"{angle} $\sigma_{greek}$: {at_study[i]:.2f} {unit} at {x:g} mm/s²"
            colour: Style = {"color": ANGLE_COLOURS[angle]}
            ax.plot(noise * 1e3, sigma[:, i], linestyle=("-", "--")[i], label=label, **colour)
            ax.plot(x, at_study[i], "o", **colour)
        ax.set_xlim(0, noise[-1] * 1e3)
        ax.set_ylim(bottom=0)
        ax.legend(loc="upper left", frameon=True, framealpha=1, edgecolor="white")

    angles = [f"{to_attitude(angle * GON):g} {attitude_unit()}" for angle in TILTED]
    labels = "accelerometer noise $\\sigma_f$ / mm/s²", f"standard deviation / {unit}"
    panel = Panel(sigma, "roll {}, pitch {}".format(*angles), *labels)
    return panels([[panel]], draw, 62, width=COLUMN)[0]


@register(
    "figure-4",
    category="Paper",
    tables=("sensitivity",),
    when=of_the_paper,
)
def effects_of_forces(tables: Tables, study: Study) -> Figure:
    """Figure 4: total effects of the forces on roll and pitch.

    Total effects of the three measured forces on roll (upper row) and pitch (lower row) over the
    attitude, without calibration parameters: the share of the angle's variance that would remain
    if the other two forces were known. Circles are Sobol's method on the grid of the study, in the
    colours of the map behind them, which is linear theory; where a circle shows its edge only, the
    two agree. The line is where a force has half of the variance. Effects within their own
    confidence interval count as zero, and crosses stand where there is no variance to share. Roll
    follows from f_y near level and from f_z as the sensor rolls over; pitch follows from f_x and,
    as the sensor pitches, increasingly from the other two.
    """
    from accelstudy.leveling.sensitivity import FORCES, OUTPUTS

    table = read_shares(tables["sensitivity"], "forces")
    at = linear_shares(table["roll_gon"], table["pitch_gon"])
    place = table["output"].map(OUTPUTS.index), table["input"].map(FORCES.index)
    table = table.assign(linear=at[np.arange(len(table)), *(p.to_numpy(int) for p in place)])
    roll, pitch = _fine(table["roll_gon"], 200), _fine(table["pitch_gon"], 99.9)
    theory = linear_shares(*np.meshgrid(roll, pitch))

    def draw(ax: Axes, cells: pd.DataFrame) -> None:
        k, i = OUTPUTS.index(cells["output"].iloc[0]), FORCES.index(cells["input"].iloc[0])
        surface(ax, roll, pitch, theory[..., k, i], vmin=0, vmax=1)
        if theory[..., k, i].min() < 0.5 < theory[..., k, i].max():
            x, y = to_attitude(roll * GON), to_attitude(pitch * GON)
            line: Style = {"levels": [0.5], "colors": "white", "linewidths": 1}
            ax.contour(x, y, theory[..., k, i], **line).set_path_effects(_half()["path_effects"])
        x, y = (to_attitude(cells[f"{name}_gon"].to_numpy(float) * GON) for name in OUTPUTS)
        share = cells["share"].to_numpy(float)
        there = np.isfinite(share)
        edge: Style = {"vmin": 0, "vmax": 1, "edgecolors": "white", "linewidths": 0.4, "s": 12}
        ax.scatter(x[there], y[there], c=share[there], cmap="viridis", **edge)
        ax.plot(x[~there], y[~there], **UNDEFINED)

    grid = [
        [
            Panel(
                table[(table["output"] == output) & (table["input"] == force)],
                f"{symbol(force)} on {output} ${GREEK[output]}$",
                axis_label("roll") if output == OUTPUTS[-1] else "",
                axis_label("pitch") if force == FORCES[0] else "",
                NO_DATA,
            )
            for force in FORCES
        ]
        for output in OUTPUTS
    ]
    fig, axes = panels(grid, draw, 100, sharex=True, sharey=True)
    if len(table):
        label = "total effect (share of variance)"
        fig.colorbar(axes[0, 0].collections[0], ax=axes, label=label, pad=0.02)
        largest = (table["share"] - table["linear"]).abs().max()
        circle: Style = {"marker": "o", "markerfacecolor": "none", "color": INK, "linestyle": ""}
        handles = [
            key("a share of 0.5, by linear theory", **_half()),
            key(f"Sobol, at most {largest:.3f} from linear theory", **circle),
            key("no variance to share", **UNDEFINED),
        ]
        handles = handles[:2] if table["defined"].all() else handles
        fig.legend(handles=handles, loc="outside lower center", ncols=3)
    return fig


def _half() -> Style:
    """Style of the line at a share of a half."""
    from matplotlib.patheffects import Normal, Stroke

    edge = [Stroke(linewidth=1.8, foreground=INK), Normal()]
    return {"color": "white", "linewidth": 1, "path_effects": edge}


def linear_shares(roll_gon: ArrayLike, pitch_gon: ArrayLike) -> Array:
    """Shares (..., 2, 3) of equally noisy forces in the variance of roll and pitch, linearly."""
    roll, pitch = np.asarray(roll_gon, float) * GON, np.asarray(pitch_gon, float) * GON
    squares = jacobian(np.stack(specific_force(roll, pitch, STANDARD_GRAVITY), axis=-1)) ** 2
    return squares / squares.sum(axis=-1, keepdims=True)


def _fine(values: pd.Series, limit: float) -> Array:
    """Angles from just below the lowest to just above the highest of a grid, in gon."""
    if values.empty:
        return np.zeros(1)
    return np.linspace(max(values.min() - 5, -limit), min(values.max() + 5, limit), 101)
