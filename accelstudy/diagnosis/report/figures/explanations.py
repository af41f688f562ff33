"""The figure of the explanations: how the posterior is shared among them."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from accelstudy.basics.wording import words
from accelstudy.diagnosis.decision.explanations import CREDIBLE, Explanation
from accelstudy.diagnosis.report.words.families import family_of
from accelstudy.drawing.style import COLUMN, INK, MISSING, new_figure

COLOURS = ("#0072B2", "#E69F00", "#009E73", "#CC79A7", "#56B4E9", "#D55E00")
"""Of the families, the most probable first."""
ALONE = "#999999"
"""Of what belongs to no family, and of further families."""
SHOWN = 8
"""Explanations in the figure; weaker ones count as others."""
HEIGHT = 0.64
"""Of a bar, in rows."""


def explanations_figure(explanations: tuple[Explanation, ...]) -> Figure:
    """Posterior of each explanation, each bar from where the one above it ends."""
    shown = explanations[:SHOWN]
    families = [family for one in shown for family in _families(one) if family]
    colours = dict(zip(dict.fromkeys(families), COLOURS, strict=False))
    ends = np.cumsum([one.posterior for one in shown])
    rest = max(0.0, 1 - float(ends[-1]))

    figure = new_figure(COLUMN, 14 + 4 * len(colours) + 7 * (len(shown) + (rest > 0)))
    ax = figure.add_subplot()
    for row, (one, end) in enumerate(zip(shown, ends, strict=True)):
        parts = _families(one)
        height = HEIGHT / len(parts)
        for i, family in enumerate(parts):
            ax.barh(
                row - HEIGHT / 2 + (i + 0.5) * height,
                one.posterior,
                left=end - one.posterior,
                height=height,
                color=colours.get(family, ALONE),
            )
    if rest > 0:
        ax.barh(len(shown), rest, left=1 - rest, height=HEIGHT, color=MISSING)
    ax.axvline(CREDIBLE, color=INK, linewidth=0.8, linestyle="--")
    ax.text(CREDIBLE, 1.0, f"{CREDIBLE:g}", transform=ax.get_xaxis_transform(),
            ha="center", va="bottom", fontsize=7.5)  # fmt: skip
    for row, posterior in enumerate([*(one.posterior for one in shown), *([rest] * (rest > 0))]):
        ax.annotate(f"{posterior:.2f}", (1, row), xytext=(4, 0), textcoords="offset points",
                    va="center", fontsize=7.5, annotation_clip=False)  # fmt: skip
    labels = ["\nwith ".join(map(words, one.names)) for one in shown]
    ax.set_yticks(range(len(shown) + (rest > 0)), labels + ["all others"] * (rest > 0))
    ax.set(xlim=(0, 1), xlabel="posterior probability, summed")
    ax.invert_yaxis()
    ax.grid(axis="y", visible=False)
    if colours:
        handles = [Patch(color=colour, label=family) for family, colour in colours.items()]
        figure.legend(handles=handles, loc="outside upper left", ncols=1)
    return figure


def _families(explanation: Explanation) -> list[str]:
    return [family_of(*members) for members in explanation.classes]
