"""Figures of the evidence: which candidates it is for, and where in the data it lies."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator

from accelstudy.basics.wording import words
from accelstudy.diagnosis.evidence.field import UNKNOWN
from accelstudy.diagnosis.report.figures.colours import AFTER, BEFORE, OTHER
from accelstudy.diagnosis.report.words.summary import GROUPS
from accelstudy.diagnosis.result import Diagnosis
from accelstudy.drawing.style import FULL, INK, new_figure

SHOWN = 12
"""Candidates in the figure of the evidence; weaker ones would only make it long."""
SMALLEST_P = 1e-12


def evidence_figure(diagnosis: Diagnosis) -> Figure:
    """Family-wise p-value and posterior probability of each candidate."""
    p_values = diagnosis.screening.p_family
    # A class of equal effects has its probability under one name, the rest has none.
    probabilities = diagnosis.probabilities

    def rank(name: str) -> tuple[float, float, str]:
        return max(p_values.get(name, 1.0), SMALLEST_P), -probabilities.get(name, 0.0), name

    names = sorted({*p_values, *probabilities}, key=rank)
    shown = [name for name in names if name != UNKNOWN][:SHOWN]
    shown += [
        n for n in names if n not in shown and (probabilities.get(n, 0) > 0.05 or n == UNKNOWN)
    ]
    found = {name for f in diagnosis.found for name in (f.name, *f.equivalence_class)}
    colours = [AFTER if name in found else OTHER for name in shown]
    place = np.arange(len(shown))[::-1]

    figure = new_figure(FULL, 22 + 4.4 * len(shown))
    left, right = figure.subplots(1, 2, sharey=True)
    tested = [max(p_values.get(name, np.nan), SMALLEST_P) for name in shown]
    smallest = float(np.nanmin([*tested, 1.0]))
    left.hlines(place, tested, 1, color=colours, linewidth=1.2)
    left.scatter(tested, place, color=colours, s=18, zorder=3)
    level = diagnosis.level
    left.axvline(level, color=BEFORE, linewidth=1, linestyle="--")
    left.text(level, 1.0, f"level {level:g}", transform=left.get_xaxis_transform(),
              color=BEFORE, ha="center", va="bottom", fontsize=7.5)  # fmt: skip
    left.set_xscale("log")
    left.set_xlim(2, min(0.3 * smallest, 1e-3))
    left.xaxis.set_minor_locator(NullLocator())
    left.set_xlabel("p-value, all candidates counted")
    left.set_yticks(place, [words(name) for name in shown])
    left.grid(axis="y", visible=False)
    percent = [100 * probabilities.get(name, 0.0) for name in shown]
    drawn = right.barh(place, percent, color=colours, height=0.6)
    right.bar_label(drawn, [_percent(probabilities.get(n)) for n in shown], padding=2, fontsize=7.5)
    right.set(xlim=(0, 115), xlabel="posterior probability, alone or with another / %")
    right.set_xticks([0, 25, 50, 75, 100])
    right.grid(axis="y", visible=False)
    return figure


def _percent(probability: float | None) -> str:
    if probability is None:
        return "shared"
    if probability < 0.01:
        return "< 1 %"
    return "> 99 %" if probability > 0.99 else f"{100 * probability:.0f} %"


def location_figure(diagnosis: Diagnosis) -> Figure:
    """Share of the excess χ² that each group of regressors takes up, of those that can be told."""
    shares = sorted(diagnosis.location.items(), key=lambda item: item[1])
    figure = new_figure(FULL * 0.62, 14 + 5.5 * len(shares))
    ax = figure.add_subplot()
    titles = [GROUPS.get(name, words(name)) for name, _ in shares]
    percent = [100 * share for _, share in shares]
    usual = [100 * diagnosis.beside.location.by_chance[name] for name, _ in shares]
    place = np.arange(len(shares))
    ax.barh(titles, percent, color=AFTER, height=0.6)
    ax.vlines(usual, place - 0.42, place + 0.42, color=INK)
    for row, ends in enumerate(zip(percent, usual, strict=True)):
        ax.text(max(ends) + 1.5, row, f"{ends[0]:.0f} %", va="center", fontsize=7.5)
    ax.set(xlim=(0, 112), xlabel="share of the excess χ² / %")
    ax.grid(axis="y", visible=False)
    return figure
