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
from studies.hidden.judging import ALL
from studies.hidden.limits import EDGES, power_over
from studies.hidden.physics.generate import place_of
from studies.hidden.scoring import VERDICTS
from studies.hidden.targets import LARGE, MOST_NAMES, plain

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
SIZE = "noncentrality $\\lambda$"


def figures(tables: Tables) -> dict[str, Callable[[], Figure]]:
    """Figures by name, each as a function that draws it from the tables of a score."""
    drawn = {
        "alarms": alarms,
        "naming": naming,
        "methods": methods,
        "sets": sets,
        "calibration": calibration,
        "confusion": confusion,
        "outside": outside,
        "places": places,
        "limits": limits,
    }
    return {name: partial(draw, tables) for name, draw in drawn.items()}


def alarms(tables: Tables) -> Figure:
    """False alarms where nothing is missing, and effects named where only the noise is wrong."""
    fig = _wide_labels(new_figure(FULL, 88))
    left, right = fig.subplots(1, 2)
    table = tables["shares"]
    null = table[(table["set"] == "null") & (table["quantity"] == "alarm")]
    null = null[(null["design"] != ALL)]
    null = null.assign(label=null["design"] + ", " + null["approach"])
    for sigma, offset, style in (("given", -0.15, OURS), ("not given", 0.15, OTHERS["F test"])):
        part = null[null["sigma"] == sigma].sort_values("label")
        _dots(left, part, offset, label=f"sigma {sigma}", **style)
    _rows(left, null["label"])
    left.axvline(0.05, color=INK, linewidth=0.8, linestyle="--")
    left.set_title("nothing missing: false alarms")
    noise = table[(table["set"] == "noise") & (table["what"] != ALL) & table["size"].isna()]
    for quantity, offset, style in (
        ("noise_model", -0.15, OTHERS["known sigma"]),
        ("answered", 0.15, OTHERS["BIC forward"]),
    ):
        part = noise[noise["quantity"] == quantity].sort_values("what")
        name = {"noise_model": "noise found", "answered": "effects named or narrowed"}[quantity]
        _dots(right, part, offset, label=name, **style)
    _rows(right, noise["what"])
    right.set_title("only the noise is wrong")
    for ax in (left, right):
        ax.set_xlabel("share of campaigns")
        ax.set_xlim(left=0)
    _legend(fig, 4)
    return fig


def naming(tables: Tables) -> Figure:
    """Found and named rightly over λ, beside the oracle; one effect, and two."""
    fig = new_figure(FULL, 72)
    detected, one, two = axes = fig.subplots(1, 3, sharey=True)
    table = tables["shares"]
    _curve(detected, table, "one", "alarm", label="found, or right", **OURS)
    _curve(detected, table, "one", "oracle found", label="oracle", **ORACLE)
    detected.set_title("one effect: something found")
    _curve(one, table, "one", "right", **OURS)
    _curve(one, table, "one", "named", label="named, right or wrong", **OTHERS["known sigma"])
    _curve(one, table, "one", "wrong", label="wrong", **OTHERS["BIC forward"])
    _curve(one, table, "one", "oracle right", **ORACLE)
    _curve(
        one, table, "one", "oracle right if told", label="oracle, told that there is one", **TOLD
    )
    one.set_title("one effect: name right")
    _curve(two, table, "two", "right", **OURS)
    _curve(two, table, "two", "one of two", label="one of two right, none wrong",
           **OTHERS["F test"])  # fmt: skip
    _curve(two, table, "two", "wrong", **OTHERS["BIC forward"])
    _curve(two, table, "two", "oracle right", **ORACLE)
    two.set_title("two effects: both right")
    for ax in axes:
        _over_size(ax)
    _shares(detected)
    _legend(fig, 3)
    return fig


def methods(tables: Tables) -> Figure:
    """Simpler methods on the same campaigns: all names right, and any name wrong."""
    fig = new_figure(FULL, 70)
    axes = fig.subplots(1, 2, sharey=True)
    table = tables["baselines"]
    one = table[(table["set"] == "one") & table["size"].notna()]
    styles = {"diagnosis": OURS, "oracle": ORACLE, **OTHERS}
    for ax, quantity in zip(axes, ("first right", "wrong"), strict=True):
        for method, style in styles.items():
            part = one[(one["method"] == method) & (one["quantity"] == quantity)]
            if method != "chi2 omnibus":  # which names nothing
                _line(ax, part.sort_values("size"), label=method, **style)
        _over_size(ax)
    axes[0].set_title("one effect: the first name is right")
    axes[1].set_title("one effect: some name is wrong")
    _shares(axes[0])
    _legend(fig, 6)
    return fig


def sets(tables: Tables) -> Figure:
    """How often a credible set holds the truth, and how many names it has."""
    fig = new_figure(FULL, 66)
    left, right = fig.subplots(1, 2)
    two = OTHERS["BIC forward"]
    _curve(left, tables["shares"], "one", "set holds the truth", label="one effect", **OURS)
    _curve(left, tables["shares"], "two", "set holds the truth", label="two effects", **two)
    left.axhline(CREDIBLE, color=INK, linewidth=0.8, linestyle="--", label="stated")
    left.set_ylim(0, 1.02)
    left.set_ylabel("sets that hold the truth")
    campaigns = tables["campaigns"]
    for name, style in (("one", OURS), ("two", two)):
        given = campaigns[(campaigns["set"] == name) & campaigns["set_given"].eq(True)]
        mean = given.groupby("size")["set_names"].agg(["mean", "sem"]).reset_index()
        if len(mean):
            error = 1.96 * mean["sem"].fillna(0)
            right.errorbar(mean["size"], mean["mean"], error, elinewidth=0.8, **style)
    one = campaigns[(campaigns["set"] == "one") & campaigns["set_given"].eq(True)]
    ideal = one.groupby("size")["oracle_alternatives"].mean()
    right.plot(ideal.index, ideal.astype(float), label="oracle, one effect", **ORACLE)
    right.plot([*MOST_NAMES], [*MOST_NAMES.values()], "_", color=INK, markersize=12,
               label="wanted at most of one effect")  # fmt: skip
    right.set_ylim(bottom=0)
    right.set_ylabel("names in a set, mean")
    for ax in (left, right):
        _over_size(ax)
    _legend(fig, 4)
    return fig


def calibration(tables: Tables) -> Figure:
    """Stated probabilities beside what they achieve."""
    fig = new_figure(COLUMN, 80)
    ax = fig.subplots()
    ax.plot([0, 1], [0, 1], color=INK, linewidth=0.8, linestyle="--")
    table = tables["calibration"]
    names = {"explanation": "most probable explanation", "set": "credible set"}
    for (kind, label), style in zip(names.items(), (OURS, OTHERS["BIC forward"]), strict=True):
        part = table[table["of"] == kind]
        if len(part):
            _bars(ax, part["stated"], part, label=label, linestyle="", **style)
    ax.set_xlabel("stated probability")
    ax.set_ylabel("share that is true")
    ax.set_xlim(0, 1.02)
    ax.set_ylim(0, 1.02)
    ax.set_aspect("equal")
    _legend(fig, 2)
    return fig


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
    answers = sorted(others, key=lambda name: name in VERDICTS.values())
    answers = [*families, *answers]
    wide = wide.reindex(columns=answers, fill_value=0.0)
    values = wide.to_numpy()
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
    fig = new_figure(FULL, 66)
    axes = fig.subplots(1, 3, sharey=True)
    titles = {
        "outside": "never in the catalogue",
        "unforeseen": "unforeseen",
        "removed": "its family is taken out",
    }
    for ax, (name, title) in zip(axes, titles.items(), strict=True):
        table = tables["shares"]
        _curve(ax, table, name, "alarm", label="something found", **OURS)
        _curve(ax, table, name, "unknown", label="unknown", **OTHERS["F test"])
        _curve(ax, table, name, "learned", label="learned", **OTHERS["known sigma"])
        _curve(ax, table, name, "wrong", label="wrong name", **OTHERS["BIC forward"])
        _over_size(ax, 0.45)
        ax.axvline(LARGE, color=INK, linewidth=0.6, linestyle=":")
        ax.set_title(title)
    _shares(axes[0])
    _legend(fig, 4)
    return fig


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
    left, right = fig.subplots(1, 2)
    campaigns = plain(tables["campaigns"])
    for ax, name, title in ((left, "outside", "never in the catalogue"),
                            (right, "unforeseen", "unforeseen")):  # fmt: skip
        part = campaigns[campaigns["set"] == name]
        if len(part):
            _fates(ax, part)
            ax.set_title(title)
            ax.set_xlabel("share of campaigns")
    _legend(fig, 3)
    return fig


def _fates(ax: Axes, part: pd.DataFrame) -> None:
    """Draw a bar of each kind, those with a place first."""
    fates = np.select(
        [part["place_right"].eq(True), part["learned"].eq(True), part["verdict"].eq("unknown"),
         part["wrong"].eq(True)],
        ["place right", "learned, no or another place", "unknown", "wrong name"],
        "noise, gross error or nothing",
    )  # fmt: skip
    counted = pd.crosstab(part["what"], fates, normalize="index").reindex(columns=[*FATES])
    order = sorted(counted.index, key=lambda kind: (not place_of(kind), kind))
    shares = counted.fillna(0).loc[order]
    start = np.zeros(len(order))
    for fate, color in FATES.items():
        ax.barh(range(len(order)), shares[fate], left=start, color=color, label=fate)
        start += shares[fate].to_numpy()
    names = [f"{words(kind)} ({', '.join(place_of(kind) or ('–',))})" for kind in order]
    ax.set_yticks(range(len(order)), names, fontsize=6)
    ax.set_ylim(len(order) - 0.4, -0.6)
    ax.set_xlim(0, 1)
    ax.grid(False)


def limits(tables: Tables) -> Figure:
    """Power over the size beside the minimal detectable and identifiable sizes."""
    fig = new_figure(FULL, 66)
    axes = fig.subplots(1, 2, sharey=True)
    cases = (
        ("by_mdb", "alarm", "MDB", "something found"),
        ("by_mib", "right", "MIB", "name right"),
    )
    for ax, (column, answer, limit, title) in zip(axes, cases, strict=True):
        for sigma, style in (("given", OURS), ("not given", OTHERS["BIC forward"])):
            part = power_over(tables["campaigns"], tables["limits"], column, answer, sigma)
            _bars(ax, part["beside"], part, label=f"sigma {sigma}", **style)
        ax.axvline(1, color=INK, linewidth=0.6, linestyle=":")
        ax.axhline(0.8, color=INK, linewidth=0.6, linestyle=":")
        ax.set_xscale("log")
        log_ticks(ax.xaxis, EDGES[0], EDGES[-1])
        ax.set_xlabel(f"size / {limit}")
        ax.set_title(title)
    _shares(axes[0])
    _legend(fig, 2)
    return fig


def _shares(ax: Axes) -> None:
    """Make the vertical axis one of shares of campaigns."""
    ax.set_ylabel("share of campaigns")
    ax.set_ylim(0, 1.02)


def _wide_labels(fig: Figure) -> Figure:
    """Leave room beside labels of words, whose widths differ between the formats."""
    fig.set_layout_engine("constrained", w_pad=0.08)
    return fig


def _curve(ax: Axes, table: pd.DataFrame, set_: str, quantity: str, **style: object) -> None:
    """Draw a share over the size, with its intervals."""
    part = table[(table["set"] == set_) & (table["quantity"] == quantity) & table["size"].notna()]
    for name in ("what", "design", "approach", "sigma"):
        part = part[part[name] == ALL]
    _line(ax, part.sort_values("size"), **style)


def _line(ax: Axes, part: pd.DataFrame, **style: object) -> None:
    if len(part):
        _bars(ax, part["size"], part, **style)


def _bars(ax: Axes, x: pd.Series, part: pd.DataFrame, **style: object) -> None:
    y = part["share"].to_numpy(float)
    error = np.abs(np.stack([y - part["ci95_low"], part["ci95_high"] - y]).astype(float))
    ax.errorbar(x, y, None if style.get("marker") == "" else error, elinewidth=0.8, **style)  # type: ignore[arg-type]


def _dots(ax: Axes, part: pd.DataFrame, offset: float, **style: object) -> None:
    x = part["share"].to_numpy(float)
    error = np.abs(np.stack([x - part["ci95_low"], part["ci95_high"] - x]).astype(float))
    places = np.arange(len(part)) + offset
    ax.errorbar(x, places, xerr=error, elinewidth=0.8, linestyle="", **style)  # type: ignore[arg-type]


def _rows(ax: Axes, labels: pd.Series) -> None:
    """Label the rows of a plot of dots, the first one on top."""
    names = sorted(labels.unique())
    ax.set_yticks(range(len(names)), names)
    ax.set_ylim(max(len(names), 1) - 0.5, -0.5)


def _legend(fig: Figure, columns: int) -> None:
    """Add one legend below all axes, and say in empty axes that there is nothing to show."""
    entries: dict[str, Artist] = {}
    for ax in fig.axes:
        handles, labels = ax.get_legend_handles_labels()
        entries |= {k: v for k, v in zip(labels, handles, strict=True) if k not in entries}
        if not labels and not ax.images:
            say_empty(ax, "no such campaigns")
    if entries:
        fig.legend([*entries.values()], [*entries], loc="outside lower center", ncols=columns)


def _over_size(ax: Axes, apart: float = 0.2) -> None:
    """Make the abscissa one of sizes, with a tick at each simulated size that has room for it."""
    drawn = [np.asarray(curve[0].get_xdata(), dtype=float) for curve in ax.containers]
    sizes = np.unique(np.concatenate(drawn)) if drawn else np.array([25.0])
    ax.set_xscale("log")
    ax.set_xticks(sizes[spread(np.log(sizes), apart)])
    ax.xaxis.set_major_formatter("{x:g}")
    ax.minorticks_off()
    ax.set_xlabel(SIZE)
