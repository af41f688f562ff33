"""Figures of the gap: on held-out positions, and between simulation and measurement."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from accelstudy.basics.units import display_unit, to_display
from accelstudy.basics.wording import number
from accelstudy.diagnosis.loop import CASES, Loop
from accelstudy.diagnosis.report.document.positions import condition_sigma
from accelstudy.diagnosis.report.figures.colours import AFTER, BEFORE, NOISE, OTHER
from accelstudy.diagnosis.result import Diagnosis
from accelstudy.drawing.style import FULL, INK, log_ticks, new_figure

SIMULATION_COLOURS = {"old": "#999999", "new": "#56B4E9"}
DIFFERENT = 5
"""Ratio of variances or tilt errors from which on an axis is logarithmic."""
DIGITS = 48
"""Most digits of position numbers along the axis."""
LARGE = 20
"""Ratio of mean squares from which on bars are drawn on a logarithmic scale."""


def gap_figure(diagnosis: Diagnosis, positions: pd.DataFrame) -> Figure:
    """Residuals of the held-out positions before and after, and their mean squares."""
    gap = diagnosis.gap.held_out
    assert gap is not None
    figure = new_figure(FULL, 62)
    ax, bars = figure.subplots(1, 2, width_ratios=[2.6, 1])
    held = positions[positions["split"] == "held-out"]
    before, after = (1e3 * held[f"predicted_{when}_mps2"] for when in ("before", "after"))
    sigma = 1e3 * condition_sigma(diagnosis.final.frame.solution, diagnosis.unit_variance)
    place = np.arange(len(held))
    ax.axhspan(0, sigma, color=NOISE, label="noise alone (1 σ)")
    ax.vlines(place, after, before, color=OTHER, linewidth=0.8)
    ax.plot(place, before, "s", color=BEFORE, label="without the effect")
    ax.plot(place, after, "o", color=AFTER, label="with the effect")
    # Labels of long numbers must not meet.
    every = -(-len(held) * len(str(held["position"].max())) // DIGITS)
    ax.set_xticks(place[::every], held["position"][::every])
    ax.set(xlabel="held-out position", ylabel="residual, rms / (mm/s²)")
    ax.set_ylim(0, 1.05 * max(before.max(), after.max(), sigma))
    ax.grid(axis="x", visible=False)
    figure.legend(loc="outside upper left", ncols=3)

    heights = {"without": gap.before, "with": gap.after, "right\nmodel": gap.floor}
    drawn = bars.bar(list(heights), list(heights.values()), color=[BEFORE, AFTER, OTHER])
    bars.bar_label(drawn, [number(value) for value in heights.values()], padding=1, fontsize=7.5)
    bars.axhline(1, color=INK, linewidth=0.8, linestyle=":")
    bars.set_ylabel("mean square / noise variance")
    if max(heights.values()) > LARGE * min(heights.values()):
        bars.set_yscale("log")
    bars.margins(y=0.12)
    bars.grid(axis="x", visible=False)
    return figure


def loop_figure(loop: Loop) -> Figure:
    """Measured variances of unit weight among the simulated ones, and what the tilt error is."""
    figure = new_figure(FULL, 62)
    base, extended, tilt = figure.subplots(1, 3, width_ratios=[1.5, 1, 1.3])
    _draw_variances(base, loop, "base", ("old", "new"))
    _draw_variances(extended, loop, "extended", ("new",))
    base.set_ylabel("simulated sessions")
    handles = [
        Patch(color=SIMULATION_COLOURS["old"], label="old simulation"),
        Patch(color=SIMULATION_COLOURS["new"], label="new simulation"),
        Line2D([], [], color=INK, linestyle="--", label="measurement"),
    ]
    figure.legend(handles=handles, loc="outside upper left", ncols=3)

    titles = (
        "base calibration,\nold simulation",
        "base calibration,\nnew simulation",
        "extended calibration,\nnew simulation",
    )
    colours = (SIMULATION_COLOURS["old"], BEFORE, AFTER)
    place = np.arange(len(CASES))[::-1]
    ends = []
    for case, y, colour in zip(CASES, place, colours, strict=True):
        values = to_display(loop.case(*case)["tilt_error_rad"], "rad")
        rms = to_display(loop.tilt(*case), "rad").item()
        low, high = np.quantile(values, [0.025, 0.975])
        ends += [float(low), float(high)]
        tilt.hlines(y, low, high, color=colour, linewidth=5, alpha=0.4)
        tilt.plot(rms, y, "o", color=colour, markersize=6)
        tilt.annotate(number(rms), (rms, y), xytext=(0, 7), textcoords="offset points",
                      ha="center", fontsize=7.5)  # fmt: skip
    tilt.set_yticks(place, titles)
    tilt.set_ylim(-0.5, len(CASES) - 0.3)
    tilt.set_xlabel(f"tilt error / {display_unit('rad')}")
    tilt.grid(axis="y", visible=False)
    _scale(tilt, min(ends), max(ends))
    return figure


def _draw_variances(ax: Axes, loop: Loop, calibration: str, simulations: tuple[str, ...]) -> None:
    measured = loop.measured[calibration]
    values = {s: loop.case(s, calibration)["sigma0_squared"].to_numpy() for s in simulations}
    everything = np.concatenate([[measured], *values.values()])
    low, high = float(everything.min()), float(everything.max())
    bins = np.geomspace(low, high, 50) if high > DIFFERENT * low else np.linspace(low, high, 30)
    for simulation, drawn in values.items():
        counts, _ = np.histogram(drawn, bins)
        # Scaled to the same height, or a narrow distribution would hide a wide one.
        ax.stairs(counts / counts.max(), bins, fill=True, color=SIMULATION_COLOURS[simulation])
    ax.axvline(measured, color=INK, linewidth=1.2, linestyle="--")
    _scale(ax, low, high)
    ax.set_yticks([])
    ax.set_xlabel("variance of unit weight")
    ax.set_title(f"{calibration} calibration")
    ax.grid(axis="x", visible=False)


def _scale(ax: Axes, low: float, high: float) -> None:
    """Make the abscissa logarithmic where the values differ much."""
    if high > DIFFERENT * low:
        ax.set_xscale("log")
        ax.set_xlim(0.7 * low, 1.4 * high)
        log_ticks(ax.xaxis, low, high)
