"""The figures of the study."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from accelstudy.basics.wording import words
from accelstudy.diagnosis.decision.posterior import CREDIBLE
from accelstudy.drawing import style
from accelstudy.drawing.style import INK, Style
from studies.hidden.physics.generate import place_of
from studies.hidden.scoring.judging import LARGE
from studies.hidden.scoring.tables import EDGES, NAMELESS, SCORE, Tables, power_over, shares

LOOKS: Mapping[str, Style] = SCORE["looks"]
OURS, ORACLE, ORANGE, RED, GREEN = (
    LOOKS[name] for name in ("ours", "oracle", "orange", "red", "green")
)
OTHERS: Mapping[str, Style] = {
    "F test": ORANGE, "BIC forward": RED, "lasso": LOOKS["pink"], "known sigma": GREEN,
}  # fmt: skip
"""Methods that name something, and their looks."""


def figures(tables: Tables) -> dict[str, Callable[[], Figure]]:
    """Figures by name, each as a function that draws it from the tables of a score."""
    drawn = (alarms, naming, methods, sets, calibration, confusion, outside, places, limits)
    return {draw.__name__: partial(draw, tables) for draw in drawn}


def alarms(tables: Tables) -> Figure:
    """False alarms where nothing is missing, and effects named where only the noise is wrong."""
    fig = _figure(88, wide=True)
    null, noise = (_of_set(tables, name) for name in ("null", "noise"))
    null = null.assign(label=null["design"] + ", " + null["approach"])
    given = {sigma: null[null["sigma"] == sigma] for sigma in ("given", "not given")}
    left, right = fig.subplots(1, 2)
    for ax, title, names, dots in (
        (left, "nothing missing: false alarms", null["label"], [
            (shares(part, "alarm", "label"), f"sigma {sigma}", look)
            for (sigma, part), look in zip(given.items(), (OURS, ORANGE), strict=True)
        ]),
        (right, "only the noise is wrong", noise["what"], [
            (shares(noise, "noise_model", "what"), "noise found", GREEN),
            (shares(noise, "answered", "what"), "effects named or narrowed", RED),
        ]),
    ):  # fmt: skip
        for (table, label, look), offset in zip(dots, (-0.15, 0.15), strict=True):
            x, error = _intervals(table)
            rows = np.arange(len(table)) + offset
            ax.errorbar(x, rows, xerr=error, elinewidth=0.8, linestyle="", label=label, **look)
        _rows(ax, sorted(names.unique()))
        ax.set_title(title)
        ax.set_xlabel("share of campaigns")
        ax.set_xlim(left=0)
    left.axvline(0.05, color=INK, linewidth=0.8, linestyle="--")
    return _with_legend(fig, 4)


def naming(tables: Tables) -> Figure:
    """Found and named rightly over λ, beside the oracle; one effect, and two."""
    return _over_size(tables, "naming", 72, 3)


def outside(tables: Tables) -> Figure:
    """What becomes of physics that the catalogue does not have."""
    fig = _over_size(tables, "outside", 66, 4, 0.45)
    for ax in fig.axes:
        ax.axvline(LARGE, color=INK, linewidth=0.6, linestyle=":")
    return fig


def methods(tables: Tables) -> Figure:
    """Simpler methods on the same campaigns: all names right, and any name wrong."""
    titles = ("one effect: the first name is right", "one effect: some name is wrong")
    fig, axes = _panels(70, titles)
    table = tables["baselines"]
    one = table[(table["set"] == "one") & table["size"].notna()].sort_values("size")
    for ax, quantity in zip(axes, ("first right", "wrong"), strict=True):
        for method, look in {"diagnosis": OURS, "oracle": ORACLE, **OTHERS}.items():
            part = one[(one["method"] == method) & (one["quantity"] == quantity)]
            _bars(ax, "size", part, label=method, **look)
        _sizes(ax)
    return _with_legend(fig, 6)


def sets(tables: Tables) -> Figure:
    """How often a credible set holds the truth, and how many names it has."""
    fig = _figure(66)
    left, right = fig.subplots(1, 2)
    for name, label, look in (("one", "one effect", OURS), ("two", "two effects", RED)):
        part = _of_set(tables, name)
        groups = part[part["set_given"]].groupby("size")
        _bars(left, "size", shares(part, "set_holds", "size"), label=label, **look)
        mean = groups["set_names"].agg(["mean", "sem"]).reset_index()
        if len(mean):
            error = 1.96 * mean["sem"].fillna(0)
            right.errorbar(mean["size"], mean["mean"], error, elinewidth=0.8, **look)
        if name == "one":
            ideal = groups["oracle_alternatives"].mean().astype(float)
    left.axhline(CREDIBLE, color=INK, linewidth=0.8, linestyle="--", label="stated")
    left.set_ylim(0, 1.02)
    left.set_ylabel("sets that hold the truth")
    right.plot(ideal.index, ideal, label="oracle, one effect", **ORACLE)
    most = next(line["most"] for line in SCORE["targets"] if line.get("of") == "set_names")
    right.plot([*most], [*most.values()], "_", color=INK, markersize=12,
               label="wanted at most of one effect")  # fmt: skip
    right.set_ylim(bottom=0)
    right.set_ylabel("names in a set, mean")
    for ax in (left, right):
        _sizes(ax)
    return _with_legend(fig, 4)


def calibration(tables: Tables) -> Figure:
    """Stated probabilities beside what they achieve."""
    fig = style.new_figure(style.COLUMN, 80)
    ax = fig.subplots()
    ax.plot([0, 1], [0, 1], color=INK, linewidth=0.8, linestyle="--")
    table = tables["calibration"]
    names = {"explanation": "most probable explanation", "set": "credible set"}
    for (kind, label), look in zip(names.items(), (OURS, RED), strict=True):
        _bars(ax, "stated", table[table["of"] == kind], label=label, linestyle="", **look)
    ax.set(xlabel="stated probability", ylabel="share that is true", xlim=(0, 1.02),
           ylim=(0, 1.02), aspect="equal")  # fmt: skip
    return _with_legend(fig, 2)


def confusion(tables: Tables) -> Figure:
    """What effects of each family are taken for."""
    table = tables["confusion"]
    fig = _figure(105, wide=True)
    ax = fig.subplots()
    if table.empty:
        style.say_empty(ax, "no such campaigns")
        return fig
    wide = table.pivot_table(index="truth", columns="answer", values="share", fill_value=0.0)
    families = [*wide.index]
    others = [name for name in wide.columns if name not in families]
    answers = [*families, *sorted(others, key=lambda name: name in NAMELESS.values())]
    values = wide.reindex(columns=answers, fill_value=0.0).to_numpy()
    image = ax.imshow(values, cmap="cividis", vmin=0, vmax=1, aspect="auto")
    for (i, j), value in np.ndenumerate(values):
        if value >= 0.005:
            ax.text(j, i, f"{value:.2f}", ha="center", va="center", fontsize=6.5,
                    color=style.ink_on(image, value))  # fmt: skip
    ax.set_xticks(range(len(answers)), answers, rotation=35, ha="right")
    ax.set_yticks(range(len(families)), families)
    ax.set_xlabel("answer: family of the first effect, or the verdict")
    ax.set_ylabel("truth")
    ax.grid(False)
    fig.colorbar(image, ax=ax, label="share of campaigns", pad=0.02)
    return fig


FATES: Mapping[str, tuple[str | None, str]] = {
    "place right": ("place_right", "#009E73"),
    "learned, no or another place": ("learned", "#8CD3BD"),
    "unknown": ("unknown", "#E69F00"),
    "noise, gross error or nothing": (None, "#BBBBBB"),
    "wrong name": ("wrong", "#D55E00"),
}
"""What becomes of a campaign, by which question (None: by no other), and its colour."""


def places(tables: Tables) -> Figure:
    """What becomes of each kind of physics that the catalogue does not have."""
    fig = _figure(150, wide=True)
    titles = {"outside": "never in the catalogue", "unforeseen": "unforeseen"}
    asked = {fate: question for fate, (question, _) in FATES.items() if question}
    for ax, (name, title) in zip(fig.subplots(1, 2), titles.items(), strict=True):
        part = _of_set(tables, name)
        part = part[part["large"]]
        if part.empty:
            continue
        answers = [part[question].fillna(value=False).to_numpy(bool) for question in asked.values()]
        fates = np.select(answers, [*asked], next(fate for fate in FATES if fate not in asked))
        share = pd.crosstab(part["what"], fates, normalize="index").reindex(columns=[*FATES])
        # Those with a place first.
        share = share.fillna(0).loc[
            sorted(share.index, key=lambda kind: (not place_of(kind), kind))
        ]
        start = np.zeros(len(share))
        for fate, (_, color) in FATES.items():
            ax.barh(range(len(share)), share[fate], left=start, color=color, label=fate)
            start += share[fate].to_numpy()
        names = [f"{words(k)} ({', '.join(place_of(k) or ('–',))})" for k in share.index]
        _rows(ax, names, 0.6, fontsize=6)
        ax.set_xlim(0, 1)
        ax.grid(False)
        ax.set_title(title)
        ax.set_xlabel("share of campaigns")
    return _with_legend(fig, 3)


def limits(tables: Tables) -> Figure:
    """Power over the size beside the minimal detectable and identifiable sizes."""
    fig, axes = _panels(66, ("something found", "name right"))
    campaigns = tables["campaigns"]
    for ax, limit, answer in zip(axes, ("MDB", "MIB"), ("alarm", "right"), strict=True):
        for sigma, look in (("given", OURS), ("not given", RED)):
            part = campaigns[campaigns["sigma"] == sigma]
            power = power_over(part, f"by_{limit.lower()}", answer)
            _bars(ax, "beside", power, label=f"sigma {sigma}", **look)
        ax.axvline(1, color=INK, linewidth=0.6, linestyle=":")
        ax.axhline(0.8, color=INK, linewidth=0.6, linestyle=":")
        ax.set_xscale("log")
        style.log_ticks(ax.xaxis, EDGES[0], EDGES[-1])
        ax.set_xlabel(f"size / {limit}")
    return _with_legend(fig, 2)


# --- parts of figures -----------------------------------------------------------------------------


def _of_set(tables: Tables, name: str) -> pd.DataFrame:
    """Campaigns of a set."""
    return tables["campaigns"][tables["campaigns"]["set"] == name]


def _figure(height_mm: float, wide: bool = False) -> Figure:
    """A figure of full width; `wide` labels of words differ between the formats, and get room."""
    fig = style.new_figure(style.FULL, height_mm)
    if wide:
        fig.set_layout_engine("constrained", w_pad=0.08)
    return fig


def _panels(height_mm: float, titles: Sequence[str]) -> tuple[Figure, list[Axes]]:
    """Return a figure of panels over which shares of campaigns are drawn."""
    fig = _figure(height_mm)
    axes = [*fig.subplots(1, len(titles), sharey=True)]
    for ax, title in zip(axes, titles, strict=True):
        ax.set_title(title)
    axes[0].set_ylabel("share of campaigns")
    axes[0].set_ylim(0, 1.02)
    return fig, axes


def _over_size(
    tables: Tables, name: str, height_mm: float, columns: int, apart: float = 0.2
) -> Figure:
    """Draw a figure of `score.yaml`: in each panel some shares over the size."""
    panels = SCORE["figures"][name]
    fig, axes = _panels(height_mm, [panel["title"] for panel in panels])
    for ax, panel in zip(axes, panels, strict=True):
        for question, label, look in panel["curves"]:
            table = shares(_of_set(tables, panel["set"]), question, "size")
            _bars(ax, "size", table, label=label, **LOOKS[look])
        _sizes(ax, apart)
    return _with_legend(fig, columns)


def _bars(ax: Axes, x: str, table: pd.DataFrame, **look: Any) -> None:
    """Draw shares, with their intervals unless it is a plain line; nothing of no campaigns."""
    if len(table):
        y, error = _intervals(table)
        ax.errorbar(
            table[x], y, None if look.get("marker") == "" else error, elinewidth=0.8, **look
        )


def _intervals(table: pd.DataFrame) -> tuple[np.ndarray, np.ndarray]:
    """Shares, and how far their intervals reach on either side."""
    share, low, high = (table[name].to_numpy(float) for name in ("share", "ci95_low", "ci95_high"))
    return share, np.abs(np.stack([share - low, high - share]))


def _rows(ax: Axes, labels: Sequence[str], beside: float = 0.5, **look: Any) -> None:
    """Label the rows of a plot, the first one on top."""
    ax.set_yticks(range(len(labels)), labels, **look)
    ax.set_ylim(max(len(labels), 1) - 1 + beside, -beside)


def _with_legend(fig: Figure, columns: int) -> Figure:
    """Add one legend below all axes, and say in empty axes that there is nothing to show."""
    entries: dict[str, Artist] = {}
    for ax in fig.axes:
        handles, labels = ax.get_legend_handles_labels()
        for label, handle in zip(labels, handles, strict=True):
            entries.setdefault(label, handle)
        if not labels and not ax.images:
            style.say_empty(ax, "no such campaigns")
    if entries:
        fig.legend([*entries.values()], [*entries], loc="outside lower center", ncols=columns)
    return fig


def _sizes(ax: Axes, apart: float = 0.2) -> None:
    """Make the abscissa one of sizes, with a tick at each simulated size that has room for it."""
    drawn = [np.asarray(curve[0].get_xdata(), dtype=float) for curve in ax.containers]
    sizes = np.unique(np.concatenate(drawn)) if drawn else np.array([25.0])
    ax.set_xscale("log")
    ax.set_xticks(sizes[style.spread(np.log(sizes), apart)])
    ax.xaxis.set_major_formatter("{x:g}")
    ax.minorticks_off()
    ax.set_xlabel("noncentrality $\\lambda$")
