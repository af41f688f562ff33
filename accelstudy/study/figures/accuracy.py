"""Figures 2 and 3: how accurately roll and pitch follow from a noisy specific force."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from accelstudy.basics.units import GON, attitude_unit, display_unit, to_attitude, to_display
from accelstudy.drawing.style import ANGLE_COLOURS, COLUMN, FULL, new_figure
from accelstudy.leveling.angles import sigma_roll_pitch, specific_force
from accelstudy.study.figures.base import Tables, of_the_paper, register

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from accelstudy.study.config import StudyConfig

Array = NDArray[np.float64]

ROLL = np.linspace(-100.0, 100.0, 81)
"""gon"""
PITCH = np.linspace(-80.0, 80.0, 65)
"""gon"""
TILTED = (0.0, 50.0)
"""Roll and pitch of figure 3, gon."""


def shown_sigma(
    roll_gon: ArrayLike, pitch_gon: ArrayLike, sigma_force: ArrayLike, g: float
) -> Array:
    """Standard deviations (..., 2) of roll and pitch as shown, for equal noise on all axes."""
    roll, pitch, sigma = np.broadcast_arrays(roll_gon, pitch_gon, sigma_force)
    force = np.stack(specific_force(roll * GON, pitch * GON, g), axis=-1)
    return to_display(sigma_roll_pitch(force, sigma[..., None, None] ** 2 * np.eye(3)), "rad")


@register(
    "figure-2",
    "Figure 2: accuracy of roll and pitch over the attitude",
    """
    Standard deviation of roll (left) and pitch (right) computed from one measured specific force,
    over the attitude, for equal noise on all three axes. Both maps share one colour scale. Roll
    loses accuracy with the cosine of pitch and does not depend on roll itself; pitch is equally
    accurate everywhere.
    """,
    category="Paper",
    when=of_the_paper,
)
def accuracy_over_attitude(tables: Tables, study: StudyConfig) -> Figure:
    """Two maps of the standard deviation over roll and pitch."""
    from matplotlib.ticker import MultipleLocator

    roll, pitch = np.meshgrid(ROLL, PITCH)
    sigma = shown_sigma(roll, pitch, study.sigma_force, study.gravity_mps2)
    roll, pitch = to_attitude(roll * GON), to_attitude(pitch * GON)
    unit = display_unit("rad")
    fig = new_figure(FULL, 66)
    axes = fig.subplots(1, 2, sharex=True, sharey=True)
    for ax, title, values in zip(axes, ("roll", "pitch"), np.moveaxis(sigma, -1, 0), strict=True):
        image = ax.pcolormesh(
            roll,
            pitch,
            values,
            shading="gouraud",
            cmap="viridis",
            rasterized=True,
            vmin=np.floor(sigma.min()),
            vmax=np.ceil(sigma.max()),
        )
        ax.set_title(f"$\\sigma_\\{'phi' if title == 'roll' else 'theta'}$ of {title}")
        ax.set_xlabel(f"roll $\\phi$ / {attitude_unit()}")
        ax.grid(False)
        if np.ptp(values) > 1e-6 * values.max():
            _contours(ax, roll, pitch, values)
        else:
            ax.text(
                0,
                0,
                f"{values.mean():.2f} {unit}\nat every attitude",
                ha="center",
                va="center",
                color="white",
            )
    axes[0].yaxis.set_major_locator(MultipleLocator(25))
    axes[0].set_ylabel(f"pitch $\\theta$ / {attitude_unit()}")
    fig.colorbar(image, ax=axes, label=f"standard deviation / {unit}", pad=0.02)
    return fig


def _contours(ax: Axes, roll: Array, pitch: Array, values: Array) -> None:
    """Labelled lines at round values, away from the edges."""
    from matplotlib.ticker import LogLocator

    highest = values[np.abs(pitch) <= 0.94 * pitch.max()].max()
    round_values = LogLocator(subs=(1, 1.5, 2, 3, 5, 7)).tick_values(values.min(), highest)
    levels = [x for x in round_values if values.min() < x < highest]
    lines = ax.contour(roll, pitch, values, levels=levels, colors="white", linewidths=0.7)
    places = [
        (0.0, sign * np.abs(pitch[np.abs(values - level).argmin() // values.shape[1], 0]))
        for level in lines.levels
        for sign in (-1, 1)
    ]
    ax.clabel(lines, fmt="%g", fontsize=7, manual=places)


@register(
    "figure-3",
    "Figure 3: accuracy of roll and pitch over the sensor noise",
    """
    Standard deviation of roll and pitch over the noise of the accelerometer, in a tilted attitude.
    Both grow linearly; the dots mark the noise of this study. Roll is the less accurate of the two
    because the sensor is pitched.
    """,
    category="Paper",
    when=of_the_paper,
)
def accuracy_over_noise(tables: Tables, study: StudyConfig) -> Figure:
    """Standard deviations in a tilted attitude, with those at the study's noise marked."""
    fig = new_figure(COLUMN, 62)
    ax = fig.subplots()
    noise = np.linspace(0.0, 5.0, 51) * study.sigma_force
    over_noise = shown_sigma(*TILTED, noise, study.gravity_mps2)
    at_study = shown_sigma(*TILTED, study.sigma_force, study.gravity_mps2)
    x, unit = study.sigma_force * 1e3, display_unit("rad")
    ax.vlines(x, 0, at_study.max(), color="#777777", linewidth=0.8, linestyle=":")
    for i, (name, greek) in enumerate((("roll", "phi"), ("pitch", "theta"))):
        ax.plot(
            noise * 1e3,
            over_noise[:, i],
            color=ANGLE_COLOURS[name],
            linestyle=("-", "--")[i],
            label=f"{name} $\\sigma_\\{greek}$: {at_study[i]:.2f} {unit} at {x:g} mm/s²",
        )
        ax.plot(x, at_study[i], "o", color=ANGLE_COLOURS[name])
    ax.set_xlim(0, noise[-1] * 1e3)
    ax.set_ylim(bottom=0)
    ax.set_xlabel("accelerometer noise $\\sigma_f$ / mm/s²")
    ax.set_ylabel(f"standard deviation / {unit}")
    angles = [f"{to_attitude(angle * GON):g} {attitude_unit()}" for angle in TILTED]
    ax.set_title("roll {}, pitch {}".format(*angles))
    ax.legend(loc="upper left", frameon=True, framealpha=1, edgecolor="white")
    return fig
