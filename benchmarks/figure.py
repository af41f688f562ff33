"""The figure of the speed of all ways, and of what it depends on."""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.ticker import FuncFormatter, NullLocator

from accelstudy.drawing.style import FULL, STYLE, approach_colour, approach_marker
from problem import APPROACHES, BLOCK
from timing import short
from ways import WAYS

DPI = 200


def draw(path, speeds, growth, cores):
    """Draw what `speeds.run`, `growth.run` and `cores.run` found."""
    with plt.rc_context(STYLE):
        figure = plt.figure(figsize=(FULL, 1.05 * FULL), layout="constrained")
        above, middle, below = figure.subfigures(3, 1, height_ratios=[1.25, 1, 1])
        _ways(above.subplots(), speeds)
        positions, parameters = middle.subplots(1, 2)
        _over(positions, growth, "positions")
        _over(parameters, growth, "parameters")
        parameters.set(xscale="linear", yscale="linear", ylim=(0, None))
        parameters.set_xlabel("parameters (48 positions)")
        replicates, processes = below.subplots(1, 2)
        _over(replicates, growth, "replicates")
        _cores(processes, cores)
        figure.savefig(path, dpi=DPI)
        plt.close(figure)


def _ways(axes, speeds):
    middles = {way: np.median(rates) for way, rates in speeds[APPROACHES[0]].items()}
    order = sorted(middles, key=middles.get)
    for name, shift in zip(APPROACHES, (0.15, -0.15), strict=True):
        for row, way in enumerate(order):
            rates, at = speeds[name][way], row + shift
            axes.plot(
                np.median(rates), at, approach_marker(name), color=approach_colour(name),
                label=name if row == 0 else None,
            )  # fmt: skip
            axes.hlines(at, rates.min(), rates.max(), approach_colour(name))
            if way != "compiled":
                ratio = short(np.median(speeds[name]["compiled"] / rates))
                axes.annotate(
                    f"{ratio} ×", (rates.max(), at), (5, 0), textcoords="offset points",
                    va="center", size=7, color=approach_colour(name),
                )  # fmt: skip
    axes.set_yticks(range(len(order)), [WAYS.get(way).title.replace("`", "") for way in order])
    label = "calibrations per second on one core (beside: how many times faster compiled code is)"
    axes.set(xscale="log", xlabel=label)
    axes.grid(axis="y", visible=False)
    axes.legend(loc="lower right")


def _over(axes, growth, panel):
    for name in APPROACHES:
        x, each = growth[panel, name]
        colour, middle = approach_colour(name), np.median(each, axis=1)
        axes.plot(x, middle, approach_marker(name), color=colour, label=name)
        axes.vlines(x, each.min(axis=1), each.max(axis=1), colour)
        if panel != "replicates":
            line = np.polyfit(x, middle, 1, w=1 / middle)
            at = np.linspace(x[0], x[-1], 200)
            axes.plot(at, np.polyval(line, at), color=colour, lw=0.8)
    axes.set(xscale="log", ylabel="µs per calibration", xlabel=panel)
    if panel == "positions":
        axes.set(yscale="log")
        axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: short(value)))
        axes.legend(title="lines: a + b x")
    if panel == "replicates":
        axes.set(ylim=(0, None), xlabel=f"replicates (in blocks of {BLOCK})")
    if panel != "parameters":
        axes.set_xticks(x, [f"{value}" for value in x])
    axes.xaxis.set_minor_locator(NullLocator())


def _cores(axes, cores):
    for name in APPROACHES:
        counts, _, each = cores[name]
        middle, colour = np.median(each, axis=1), approach_colour(name)
        axes.plot(counts, middle, approach_marker(name), color=colour)
        axes.vlines(counts, each.min(axis=1), each.max(axis=1), colour)
        axes.axhline(middle[0], color=colour, lw=0.8)
    axes.set(xlabel="processes side by side (lines: as one alone)", xticks=counts)
    axes.set(ylabel="µs of a core per calibration", xlim=(0.5, counts[-1] + 0.5), ylim=(0, None))
