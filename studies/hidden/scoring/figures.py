"""The figures of the study."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial

import numpy as np
import pandas as pd
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from accelstudy.basics.wording import words
from accelstudy.diagnosis.decision.posterior import CREDIBLE
from accelstudy.drawing.style import (
    COLUMN,
    FULL,
    INK,
    Style,
    ink_on,
    log_ticks,
    new_figure,
    say_empty,
    spread,
)
from studies.hidden.physics.generate import place_of
from studies.hidden.scoring.judging import LARGE
from studies.hidden.scoring.limits import EDGES, power_over
from studies.hidden.scoring.tables import NAMELESS, TARGETS, shares

Tables = Mapping[str, pd.DataFrame]

# Okabe & Ito's colours, which stay apart for colour-blind eyes; each line has a marker of its own.
OURS: Style = {"color": "#0072B2", "marker": "o"}
ORACLE: Style = {"color": INK, "marker": "", "linestyle": "--"}
TOLD: Style = {"color": "#777777", "marker": "", "linestyle": ":"}
OTHERS: Mapping[str, Style] = {
    "F test": {"color": "#E69F00", "marker": "^"},
    "BIC forward": {"color": "#D55E00", "marker": "v"},
    "lasso": {"color": "#CC79A7", "marker": "x"},
    "known sigma": {"color": "#009E73", "marker": "D"},
    "chi2 omnibus": {"color": "#8A8A2B", "marker": "s"},
}
ORANGE, RED, GREEN = OTHERS["F test"], OTHERS["BIC forward"], OTHERS["known sigma"]


def figures(tables: Tables) -> dict[str, Callable[[], Figure]]:
    """Figures by name, each as a function that draws it from the tables of a score."""
    drawn = (alarms, naming, methods, sets, calibration, confusion, outside, places, limits)
    return {draw.__name__: partial(draw, tables) for draw in drawn}


def alarms(tables: Tables) -> Figure:
    """False alarms where nothing is missing, and effects named where only the noise is wrong."""
    fig = _wide_labels(new_figure(FULL, 88))
    left, right = fig.subplots(1, 2)
    null, noise = (_of_set(tables, name) for name in ("null", "noise"))
    null = null.assign(label=null["design"] + ", " + null["approach"])
    for sigma, offset, style in (("given", -0.15, OURS), ("not given", 0.15, ORANGE)):
        part = shares(null[null["sigma"] == sigma], "alarm", "label")
        _dots(left, part, offset, label=f"sigma {sigma}", **style)
    _rows(left, null["label"])
    left.axvline(0.05, color=INK, linewidth=0.8, linestyle="--")
    left.set_title("nothing missing: false alarms")
    _dots(right, shares(noise, "noise_model", "what"), -0.15, label="noise found", **GREEN)
    _dots(right, shares(noise, "answered", "what"), 0.15, label="effects named or narrowed", **RED)
    _rows(right, noise["what"])
    right.set_title("only the noise is wrong")
    for ax in (left, right):
        ax.set_xlabel("share of campaigns")
        ax.set_xlim(left=0)
    return _with_legend(fig, 4)


def naming(tables: Tables) -> Figure:
    """Found and named rightly over λ, beside the oracle; one effect, and two."""
    titles = ("one effect: something found", "one effect: name right", "two effects: both right")
    fig, (detected, first, both) = _panels(72, titles)
    one, two = (_of_set(tables, name) for name in ("one", "two"))
    _curve(detected, one, "alarm", label="found, or right", **OURS)
    _curve(detected, one, "oracle_found", label="oracle", **ORACLE)
    _curve(first, one, "right", **OURS)
    _curve(first, one, "named", label="named, right or wrong", **GREEN)
    _curve(first, one, "wrong", label="wrong", **RED)
    _curve(first, one, "oracle_right", **ORACLE)
    _curve(first, one, "told_right", label="oracle, told that there is one", **TOLD)
    _curve(both, two, "right", **OURS)
    _curve(both, two, "one_of_two", label="one of two right, none wrong", **ORANGE)
    _curve(both, two, "wrong", **RED)
    _curve(both, two, "oracle_right", **ORACLE)
    for ax in (detected, first, both):
        _over_size(ax)
    return _with_legend(fig, 3)


def methods(tables: Tables) -> Figure:
    """Simpler methods on the same campaigns: all names right, and any name wrong."""
    titles = ("one effect: the first name is right", "one effect: some name is wrong")
    fig, axes = _panels(70, titles)
    table = tables["baselines"]
    one = table[(table["set"] == "one") & table["size"].notna()]
    for ax, quantity in zip(axes, ("first right", "wrong"), strict=True):
        for method, style in {"diagnosis": OURS, "oracle": ORACLE, **OTHERS}.items():
            part = one[(one["method"] == method) & (one["quantity"] == quantity)]
            if len(part) and method != "chi2 omnibus":  # which names nothing
                _bars(ax, "size", part.sort_values("size"), label=method, **style)
        _over_size(ax)
    return _with_legend(fig, 6)


def sets(tables: Tables) -> Figure:
    """How often a credible set holds the truth, and how many names it has."""
    fig = new_figure(FULL, 66)
    left, right = fig.subplots(1, 2)
    for name, label, style in (("one", "one effect", OURS), ("two", "two effects", RED)):
        part = _of_set(tables, name)
        given = part[part["set_given"].eq(True)]
        _curve(left, part, "set_holds", label=label, **style)
        mean = given.groupby("size")["set_names"].agg(["mean", "sem"]).reset_index()
        if len(mean):
            error = 1.96 * mean["sem"].fillna(0)
            right.errorbar(mean["size"], mean["mean"], error, elinewidth=0.8, **style)
        if name == "one":
            ideal = given.groupby("size")["oracle_alternatives"].mean()
    left.axhline(CREDIBLE, color=INK, linewidth=0.8, linestyle="--", label="stated")
    left.set_ylim(0, 1.02)
    left.set_ylabel("sets that hold the truth")
    right.plot(ideal.index, ideal.astype(float), label="oracle, one effect", **ORACLE)
    most = next(line["most"] for line in TARGETS if line.get("of") == "set_names")
    right.plot([*most], [*most.values()], "_", color=INK, markersize=12,
               label="wanted at most of one effect")  # fmt: skip
    right.set_ylim(bottom=0)
    right.set_ylabel("names in a set, mean")
    for ax in (left, right):
        _over_size(ax)
    return _with_legend(fig, 4)


def calibration(tables: Tables) -> Figure:
    """Stated probabilities beside what they achieve."""
    fig = new_figure(COLUMN, 80)
    ax = fig.subplots()
    ax.plot([0, 1], [0, 1], color=INK, linewidth=0.8, linestyle="--")
    table = tables["calibration"]
    names = {"explanation": "most probable explanation", "set": "credible set"}
    for (kind, label), style in zip(names.items(), (OURS, RED), strict=True):
        part = table[table["of"] == kind]
        if len(part):
            _bars(ax, "stated", part, label=label, linestyle="", **style)
    ax.set(xlabel="stated probability", ylabel="share that is true", xlim=(0, 1.02),
           ylim=(0, 1.02), aspect="equal")  # fmt: skip
    return _with_legend(fig, 2)


def confusion(tables: Tables) -> Figure:
    """What effects of each family are taken for."""
    table = tables["confusion"]
    fig = _wide_labels(new_figure(FULL, 105))
    ax = fig.subplots()
    if table.empty:
        say_empty(ax, "no such campaigns")
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
                    color=ink_on(image, value))  # fmt: skip
    ax.set_xticks(range(len(answers)), answers, rotation=35, ha="right")
    ax.set_yticks(range(len(families)), families)
    ax.set_xlabel("answer: family of the first effect, or the verdict")
    ax.set_ylabel("truth")
    ax.grid(False)
    fig.colorbar(image, ax=ax, label="share of campaigns", pad=0.02)
    return fig


def outside(tables: Tables) -> Figure:
    """What becomes of physics that the catalogue does not have."""
    titles = ("never in the catalogue", "unforeseen", "its family is taken out")
    fig, axes = _panels(66, titles)
    for ax, name in zip(axes, ("outside", "unforeseen", "removed"), strict=True):
        part = _of_set(tables, name)
        _curve(ax, part, "alarm", label="something found", **OURS)
        _curve(ax, part, "unknown", label="unknown", **ORANGE)
        _curve(ax, part, "learned", label="learned", **GREEN)
        _curve(ax, part, "wrong", label="wrong name", **RED)
        _over_size(ax, 0.45)
        ax.axvline(LARGE, color=INK, linewidth=0.6, linestyle=":")
    return _with_legend(fig, 4)


FATES: Mapping[str, str] = {
    "place right": "#009E73",
    "learned, no or another place": "#8CD3BD",
    "unknown": "#E69F00",
    "noise, gross error or nothing": "#BBBBBB",
    "wrong name": "#D55E00",
}
"""What becomes of a campaign, and its colour."""


def places(tables: Tables) -> Figure:
    """What becomes of each kind of physics that the catalogue does not have."""
    fig = _wide_labels(new_figure(FULL, 150))
    titles = {"outside": "never in the catalogue", "unforeseen": "unforeseen"}
    for ax, (name, title) in zip(fig.subplots(1, 2), titles.items(), strict=True):
        part = _of_set(tables, name)
        part = part[part["large"].eq(True)]
        if len(part):
            _fates(ax, part)
            ax.set_title(title)
            ax.set_xlabel("share of campaigns")
    return _with_legend(fig, 3)


def _fates(ax: Axes, part: pd.DataFrame) -> None:
    """Draw a bar of each kind, those with a place first."""
    right, learned, unknown, _, wrong = FATES
    asked = {right: "place_right", learned: "learned", unknown: "unknown", wrong: "wrong"}
    fates = np.select([part[name].eq(True) for name in asked.values()], [*asked], [*FATES][3])
    counted = pd.crosstab(part["what"], fates, normalize="index").reindex(columns=[*FATES])
    order = sorted(counted.index, key=lambda kind: (not place_of(kind), kind))
    share = counted.fillna(0).loc[order]
    start = np.zeros(len(order))
    for fate, color in FATES.items():
        ax.barh(range(len(order)), share[fate], left=start, color=color, label=fate)
        start += share[fate].to_numpy()
    names = [f"{words(kind)} ({', '.join(place_of(kind) or ('–',))})" for kind in order]
    ax.set_yticks(range(len(order)), names, fontsize=6)
    ax.set_ylim(len(order) - 0.4, -0.6)
    ax.set_xlim(0, 1)
    ax.grid(False)


def limits(tables: Tables) -> Figure:
    """Power over the size beside the minimal detectable and identifiable sizes."""
    fig, axes = _panels(66, ("something found", "name right"))
    campaigns = tables["campaigns"]
    for ax, limit, answer in zip(axes, ("MDB", "MIB"), ("alarm", "right"), strict=True):
        for sigma, style in (("given", OURS), ("not given", RED)):
            part = campaigns[campaigns["sigma"] == sigma]
            power = power_over(part, tables["limits"], f"by_{limit.lower()}", answer)
            _bars(ax, "beside", power, label=f"sigma {sigma}", **style)
        ax.axvline(1, color=INK, linewidth=0.6, linestyle=":")
        ax.axhline(0.8, color=INK, linewidth=0.6, linestyle=":")
        ax.set_xscale("log")
        log_ticks(ax.xaxis, EDGES[0], EDGES[-1])
        ax.set_xlabel(f"size / {limit}")
    return _with_legend(fig, 2)


def _of_set(tables: Tables, name: str) -> pd.DataFrame:
    """Campaigns of a set."""
    return tables["campaigns"][tables["campaigns"]["set"] == name]


def _panels(height_mm: float, titles: tuple[str, ...]) -> tuple[Figure, list[Axes]]:
    """Return a figure of panels over which shares of campaigns are drawn."""
    fig = new_figure(FULL, height_mm)
    axes = [*fig.subplots(1, len(titles), sharey=True)]
    for ax, title in zip(axes, titles, strict=True):
        ax.set_title(title)
    axes[0].set_ylabel("share of campaigns")
    axes[0].set_ylim(0, 1.02)
    return fig, axes


def _wide_labels(fig: Figure) -> Figure:
    """Leave room beside labels of words, whose widths differ between the formats."""
    fig.set_layout_engine("constrained", w_pad=0.08)
    return fig


def _curve(ax: Axes, campaigns: pd.DataFrame, question: str, **style: object) -> None:
    """Draw a share over the size, with its intervals."""
    table = shares(campaigns, question, "size")
    if len(table):
        _bars(ax, "size", table, **style)


def _bars(ax: Axes, x: str, table: pd.DataFrame, **style: object) -> None:
    y, error = _intervals(table)
    ax.errorbar(table[x], y, None if style.get("marker") == "" else error, elinewidth=0.8, **style)  # type: ignore[arg-type]


def _dots(ax: Axes, table: pd.DataFrame, offset: float, **style: object) -> None:
    x, error = _intervals(table)
    rows = np.arange(len(table)) + offset
    ax.errorbar(x, rows, xerr=error, elinewidth=0.8, linestyle="", **style)  # type: ignore[arg-type]


def _intervals(table: pd.DataFrame) -> tuple[np.ndarray, np.ndarray]:
    """Shares, and how far their intervals reach on either side."""
    share, low, high = (table[name].to_numpy(float) for name in ("share", "ci95_low", "ci95_high"))
    return share, np.abs(np.stack([share - low, high - share]))


def _rows(ax: Axes, labels: pd.Series) -> None:
    """Label the rows of a plot of dots, the first one on top."""
    names = sorted(labels.unique())
    ax.set_yticks(range(len(names)), names)
    ax.set_ylim(max(len(names), 1) - 0.5, -0.5)


def _with_legend(fig: Figure, columns: int) -> Figure:
    """Add one legend below all axes, and say in empty axes that there is nothing to show."""
    entries: dict[str, Artist] = {}
    for ax in fig.axes:
        handles, labels = ax.get_legend_handles_labels()
        entries |= {k: v for k, v in zip(labels, handles, strict=True) if k not in entries}
        if not labels and not ax.images:
            say_empty(ax, "no such campaigns")
    if entries:
        fig.legend([*entries.values()], [*entries], loc="outside lower center", ncols=columns)
    return fig


def _over_size(ax: Axes, apart: float = 0.2) -> None:
    """Make the abscissa one of sizes, with a tick at each simulated size that has room for it."""
    drawn = [np.asarray(curve[0].get_xdata(), dtype=float) for curve in ax.containers]
    sizes = np.unique(np.concatenate(drawn)) if drawn else np.array([25.0])
    ax.set_xscale("log")
    ax.set_xticks(sizes[spread(np.log(sizes), apart)])
    ax.xaxis.set_major_formatter("{x:g}")
    ax.minorticks_off()
    ax.set_xlabel("noncentrality $\\lambda$")
