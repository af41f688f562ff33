"""Figures 2 to 4: how accurately roll and pitch follow from a noisy specific force, and why."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from accelstudy.basics.arrays import Array
from accelstudy.basics.units import GON, attitude_unit, shown_unit, to_attitude, to_display
from accelstudy.drawing import style
from accelstudy.leveling.angles import jacobian, sigma_roll_pitch, specific_force
from accelstudy.study.figures.panels import ANGLES, Image, handle, panels, surface
from accelstudy.study.figures.registry import Axes, DataFrame, Figure, Study, Tables, register
from accelstudy.study.figures.total_effects import read_shares

ROLL, PITCH = np.linspace(-100.0, 100.0, 81), np.linspace(-80.0, 80.0, 65)
"""Attitudes of figure 2, gon."""
TILTED = (0.0, 50.0)
"""Roll and pitch of figure 3, gon."""
OVER_ATTITUDES: style.Style = {
    "xlabel": r"roll $\phi$ / {unit}",
    "ylabel": r"pitch $\theta$ / {unit}",
}


@register("figure-2", category="Paper")
def accuracy_over_attitude(tables: Tables, study: Study) -> Figure:
    """Figure 2: accuracy of roll and pitch over the attitude.

    Standard deviation of roll (left) and pitch (right) computed from one measured specific force,
    over the attitude, for equal noise on all three axes. Both maps share one colour scale. Roll
    loses accuracy with the cosine of pitch and does not depend on roll itself; pitch is equally
    accurate everywhere.
    """
    from matplotlib.ticker import LogLocator

    roll, pitch = np.meshgrid(ROLL, PITCH)
    noise = study.noise.sensor.sigma_mps2
    table = sigma_table(roll.ravel(), pitch.ravel(), noise, study.gravity_mps2)
    limits = {"vmin": table["sigma"].min(), "vmax": table["sigma"].max()}

    def draw(ax: Axes, rows: DataFrame) -> Image:
        square = rows.pivot_table("sigma", "pitch", "roll")
        x, y, values = square.columns.to_numpy(), square.index.to_numpy(), square.to_numpy()
        image = surface(ax, x, y, values, **limits)
        if rows["angle"].iloc[0] == "roll":
            levels = LogLocator(subs=(1, 1.5, 2, 3, 5, 7))
            ax.clabel(ax.contour(x, y, values, locator=levels, colors="white", linewidths=0.7))
        else:
            same = f"{values.mean():.2f} {shown_unit('rad')}\nat every attitude"
            ax.text(0, 0, same, ha="center", va="center", color="white")
        return image

    return panels(
        table,
        draw,
        50,
        column="angle",
        title="standard deviation of {angle}",
        colours=f"standard deviation / {shown_unit('rad')}",
        **OVER_ATTITUDES,
    )


@register("figure-3", category="Paper")
def accuracy_over_noise(tables: Tables, study: Study) -> Figure:
    """Figure 3: accuracy of roll and pitch over the sensor noise.

    Standard deviation of roll and pitch over the noise of the accelerometer, in a tilted attitude.
    Both grow linearly; the dots mark the noise of this study. Roll is the less accurate of the two
    because the sensor is pitched.
    """
    noise, unit = np.linspace(0.0, 5.0, 51) * study.noise.sensor.sigma_mps2, shown_unit("rad")

    def draw(ax: Axes, rows: DataFrame) -> None:
        for (angle, its), line in zip(rows.groupby("angle", sort=False), ("-", "--"), strict=True):
            at, colour = its.iloc[10], style.ANGLE_COLOURS[str(angle)]
            label = f"{angle}: {at['sigma']:.2f} {unit} at {at['noise']:g} mm/s²"
            ax.plot(its["noise"], its["sigma"], line, color=colour, label=label)
            ax.plot(at["noise"], at["sigma"], "o", color=colour)
        ax.margins(0)
        ax.legend(loc="upper left")

    return panels(
        sigma_table(*TILTED, noise, study.gravity_mps2),
        draw,
        42,
        title="roll {roll:g} {unit}, pitch {pitch:g} {unit}",
        xlabel=r"accelerometer noise $\sigma_f$ / mm/s²",
        ylabel=f"standard deviation / {unit}",
        width=style.COLUMN,
    )


def sigma_table(roll: ArrayLike, pitch: ArrayLike, noise: ArrayLike, g: float) -> DataFrame:
    """Sds of roll and pitch, as shown, at attitudes in gon with equal noise on all axes, m/s²."""
    import pandas as pd

    roll, pitch, noise = np.broadcast_arrays(roll, pitch, noise)
    force = np.stack(specific_force(roll * GON, pitch * GON, g), axis=-1)
    sigma = to_display(sigma_roll_pitch(force, noise[..., None, None] ** 2 * np.eye(3)), "rad")
    angles = {"roll": to_attitude(roll * GON), "pitch": to_attitude(pitch * GON)}
    table = pd.DataFrame({**angles, "unit": attitude_unit(), "noise": noise * 1e3})
    return pd.concat(
        [table.assign(angle=name, sigma=s) for name, s in zip(ANGLES, sigma.T, strict=True)]
    )


@register("figure-4", "sensitivity", category="Paper")
def effects_of_forces(tables: Tables, study: Study) -> Figure:
    """Figure 4: total effects of the forces on roll and pitch.

    Total effects of the three measured forces on roll (upper row) and pitch (lower row) over the
    attitude, without calibration parameters: the share of the angle's variance that would remain
    if the other two forces were known. Circles are Sobol's method on the grid of the study, in the
    colours of the map behind them, which is linear theory; where a circle shows its edge only, the
    two agree. There is no circle where there is no variance to share. The line is where a force has
    half of the variance. Effects within their own confidence interval count as zero. Roll follows
    from f_y near level and from f_z as the sensor rolls over; pitch follows from f_x and, as the
    sensor pitches, increasingly from the other two.
    """
    from accelstudy.leveling.sensitivity import FORCES

    table = read_shares(tables["sensitivity"], "forces")
    table = table.assign(symbol=table["input"].map(style.symbol), unit=attitude_unit())
    look: style.Style = {"vmin": 0, "vmax": 1, "cmap": "viridis"}

    def draw(ax: Axes, rows: DataFrame) -> Image:
        first = rows.iloc[0]
        place = ..., ANGLES.index(first["output"]), FORCES.index(first["input"])
        at = [
            np.linspace(max(rows[name].min() - 5, -most), min(rows[name].max() + 5, most))
            for name, most in (("roll_gon", 200), ("pitch_gon", 99.9))
        ]
        x, y = (to_attitude(angles * GON) for angles in at)
        values = linear_shares(*np.meshgrid(*at))[place]
        image = surface(ax, x, y, values, **look)
        if values.min() < 0.5 < values.max():
            ax.contour(x, y, values, [0.5], colors=style.INK, linewidths=1)
        x, y = (to_attitude(rows[name] * GON) for name in ("roll_gon", "pitch_gon"))
        ax.scatter(x, y, 12, rows["share"], edgecolors="white", linewidths=0.4, **look)
        return image

    circle: style.Style = {"marker": "o", "markerfacecolor": "none", "linestyle": ""}
    return panels(
        table,
        draw,
        40,
        row="output",
        column="input",
        title="{symbol} on {output}",
        colours="total effect (share of variance)",
        legend=[handle("a share of 0.5, by linear theory"), handle("Sobol's method", **circle)],
        **OVER_ATTITUDES,
    )


def linear_shares(roll_gon: Array, pitch_gon: Array) -> Array:
    """Shares (..., 2, 3) of equally noisy forces in the variance of roll and pitch, linearly."""
    force = np.stack(specific_force(roll_gon * GON, pitch_gon * GON, 1.0), axis=-1)
    squares = jacobian(force) ** 2
    return squares / squares.sum(axis=-1, keepdims=True)
