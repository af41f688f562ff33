"""The figures of a score: in each panel curves of what was measured over the size, say."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from accelstudy.drawing import style
from studies.hidden.scoring.tables import SCORES, chosen, measure

Frames = Mapping[str, pd.DataFrame]
LINE: Mapping[str, Any] = {"color": style.INK, "linewidth": 0.8, "linestyle": "--"}
APART = 0.2  # least distance of two ticks, in the logarithm of the size per panel and inch


def figures(score: str, frames: Frames) -> dict[str, Callable[[], Figure]]:
    """Figures of a score by name, each as a function that draws it."""
    return {name: partial(draw, one, frames) for name, one in SCORES[score]["figures"].items()}


def draw(figure: Mapping[str, Any], frames: Frames) -> Figure:
    """Draw a figure as `score.yaml` says it, with one legend below all panels."""
    panels = figure["panels"]
    fig = style.new_figure(style.FULL if len(panels) > 1 else style.COLUMN, figure["height"])
    alike = not any("axes" in panel for panel in panels[1:])
    entries: dict[str, Any] = {}
    axes = fig.subplots(1, len(panels), sharey=alike, squeeze=False)[0]
    for ax, panel in zip(axes, panels, strict=True):
        rows = chosen(frames[panel.get("frame", "campaigns")], panel)
        for name, where in panel.get("guides", {}).items():
            getattr(ax, name)(**LINE, **where)
        drawn = [_curve(ax, rows, curve, panel.get("bins")) for curve in panel["curves"]]
        ax.set(title=panel.get("title", ""), **panel.get("axes", {}))
        if "bins" not in panel:
            sizes = np.unique(np.concatenate(drawn))
            ax.set(xscale="log", xlabel="noncentrality $\\lambda$")
            # A tick at each size that has room for it.
            ax.set_xticks(sizes[_spread(np.log(sizes), APART * len(panels) / 2)])
            ax.xaxis.set_major_formatter("{x:g}")
            ax.minorticks_off()
        for handle, label in zip(*ax.get_legend_handles_labels(), strict=True):
            entries.setdefault(label, handle)
        if not any(map(len, drawn)):
            style.say_empty(ax, "no such campaigns")
    columns = style.legend_columns(entries) if entries else 1
    fig.legend([*entries.values()], [*entries], loc="outside lower center", ncols=columns)
    return fig


def _spread(places: Any, apart: float) -> list[int]:
    """Indices of places, from the first on, each at least `apart` from the one chosen before."""
    chosen: list[int] = []
    for i, place in enumerate(places):
        if not chosen or place - places[chosen[-1]] >= apart:
            chosen.append(i)
    return chosen


def _curve(ax: Axes, rows: pd.DataFrame, curve: Mapping[str, Any], bins: list[float] | None) -> Any:
    """Draw answers to a question over the sizes of campaigns, or over classes of another column."""
    x = curve.get("x", "size")
    points = [(at, value, value, value) for at, value in curve.get("points", {}).items()]
    rows = chosen(rows, curve) if "of" in curve else rows[:0]
    for _, part in rows.groupby(np.digitize(rows[x], bins) if bins else x):
        measured = measure(part, curve)
        if measured.n:
            points.append((float(part[x].mean()), *measured[:3]))
    at, value, low, high = np.array(points, dtype=float).reshape(-1, 4).T
    look = SCORES["score"]["looks"][curve["look"]]
    look = look | {key: curve[key] for key in ("label", "linestyle") if key in curve}
    plain = not look["marker"] or "points" in curve  # without intervals
    if len(points):
        error = None if plain else np.nan_to_num(np.abs(np.stack([value - low, high - value])))
        ax.errorbar(at, value, error, elinewidth=0.8, **look)
    return at
