"""The score of a study: its tables, its figures, and its page in Markdown."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from accelstudy.basics.wording import number, words
from accelstudy.drawing.saving import save_all
from accelstudy.files.outputs import whole_file
from accelstudy.files.tables import origin, read_table, write_table
from studies.hidden.campaigns import TABLES
from studies.hidden.config import HiddenConfig
from studies.hidden.figures import figures
from studies.hidden.judging import ALL, share_of
from studies.hidden.limits import study_limits
from studies.hidden.physics.generate import place_of
from studies.hidden.scoring import sample, score_tables
from studies.hidden.targets import LARGE, further, plain

PARTS = ("truths", "outcomes", "baselines", "seconds")
"""Tables that the chunks write."""


def write_score(
    config: HiddenConfig,
    inputs: Mapping[str, Sequence[str]],
    outputs: Mapping[str, str],
    provenance: Mapping[str, Any],
) -> str:
    """Score a study; returns the page.

    Parameters
    ----------
    config : HiddenConfig
    inputs : paths of all chunks of each of `PARTS`
    outputs : paths of each of `studies.hidden.cells.TABLES`, of the page, and of the
        folder of the figures
    provenance : see `accelstudy.files.tables.origin`
    """
    parts = {name: read_table([*inputs[name]]) for name in PARTS}
    tables = score_tables(
        parts["truths"], parts["outcomes"], parts["baselines"], study_limits(config)
    )
    for name in TABLES:
        write_table(outputs[name], tables[name], provenance)
    folder = Path(outputs["figures"])
    folder.mkdir(parents=True, exist_ok=True)
    save_all(figures(tables), folder)
    page = score_page(tables, parts["seconds"], origin(provenance))
    with whole_file(outputs["page"]) as path:
        path.write_text(page, encoding="utf-8")
    return page


Tables = Mapping[str, pd.DataFrame]


def score_page(tables: Tables, seconds: pd.DataFrame, origin: Mapping[str, Any]) -> str:
    """Write the score as tables in Markdown.

    Parameters
    ----------
    tables : those of `studies.hidden.cells.TABLES`
    seconds : DataFrame, processor time of each diagnosis
    origin : see `accelstudy.files.tables.origin`
    """
    campaigns = tables["campaigns"]
    each = seconds["seconds"]
    parts = [
        "# Score of the study of hidden effects",
        "Written by `make hidden-effects`, not by hand; hidden-effects.md explains it.",
        f"{len(campaigns)} campaigns, configuration `{origin['config_hash']}`, seed "
        f"{origin['seed']}, accelstudy {origin['version']}, commit `{origin['commit'][:10]}`. A "
        f"diagnosis took {number(float(each.median()))} s of processor time (median; 95 % of them "
        f"below {number(float(each.quantile(0.95)))} s).",
        "## Targets",
        figure_table(tables["targets"]),
        "## Beside the targets",
        figure_table(further(campaigns)),
        "## One effect, over its size",
        size_table(tables["shares"]),
        "## Verdicts",
        verdict_table(tables["shares"]),
        "## What the catalogue lacks",
        KINDS_TEXT,
        kind_table(campaigns),
        "## Simpler methods on the same campaigns",
        method_table(tables["baselines"]),
        "## Confirmed: how far the residuals shrink",
        shrink_table(campaigns),
        "## Each effect",
        effect_table(tables["shares"], tables["limits"]),
    ]
    parts += ["## A sample", SAMPLE_TEXT, sample_table(sample(campaigns))]
    failed = campaigns[~campaigns["ok"].astype(bool)]
    if len(failed):
        parts += ["## Without an answer", failure_table(failed)]
    return "\n\n".join(parts) + "\n"


FIGURES = {
    "figure": "figure",
    "cases": "campaigns",
    "wanted": "target",
    "measured": "measured",
    "interval": "95 % interval",
    "n": "n",
    "met": "met",
}
"""Columns of the tables of targets and of further shares, and their heads."""


def figure_table(table: pd.DataFrame) -> str:
    """Each share or mean with its interval; targets with what is wanted, and whether it is met."""
    ends = zip(table["ci95_low"], table["ci95_high"], table["n"], strict=True)
    shown = table.assign(
        measured=table["measured"].map(share_text),
        interval=[interval_text(low, high) if n else "" for low, high, n in ends],
    )
    return markdown(shown[[name for name in FIGURES if name in shown]].rename(columns=FIGURES))


SHOWN = {
    "found": "alarm",
    "oracle": "oracle found",
    "named": "named",
    "narrowed": "narrowed",
    "unknown": "unknown",
    "name right": "right",
    "oracle right": "oracle right",
    "wrong": "wrong",
    "explanation right": "explanation right",
    "set holds the truth": "set holds the truth",
}
"""Columns of the table over the size."""


def size_table(shares: pd.DataFrame) -> str:
    """Shares over the size of one effect."""
    sizes = shares.loc[(shares["set"] == "one") & shares["size"].notna(), "size"]
    rows = [
        (f"{size:g}", *(_share(shares, quantity, "one", size=size) for quantity in SHOWN.values()))
        for size in sorted(sizes.unique())
    ]
    return markdown(pd.DataFrame(rows, columns=["λ", *SHOWN]))


VERDICTS = (
    "alarm", "named", "narrowed", "learned", "unknown", "noise_model", "gross_error", "confirmed",
)  # fmt: skip


def verdict_table(shares: pd.DataFrame) -> str:
    """Shares of the verdicts in each set."""
    rows = [
        (title, *(_share(shares, quantity, name) for quantity in VERDICTS))
        for name, title in _SETS.items()
        if share_of(shares, "alarm", name) is not None
    ]
    return markdown(pd.DataFrame(rows, columns=["campaigns", *map(words, VERDICTS)]))


_SETS = {
    "null": "nothing missing",
    "noise": "wrong noise only",
    "one": "one effect",
    "two": "two effects",
    "removed": "family taken out",
    "outside": "never in the catalogue",
    "unforeseen": "unforeseen",
    "gross": "gross errors",
    "invisible": "cannot be seen",
}


KINDS_TEXT = (
    f"Campaigns of λ ≥ {LARGE:g} with a given sigma or repeated positions. The place is the "
    "coordinate and the target; – is none. Whether it is right is asked where the campaign records "
    "the coordinate. Confirmed, and the median of the share of λ that is explained, are of those "
    "whose place is right."
)


def kind_table(campaigns: pd.DataFrame) -> str:
    """What becomes of each kind of physics that the catalogue lacks."""
    large = plain(campaigns)
    rows = []
    for name in ("outside", "unforeseen"):
        for what, part in large[large["set"] == name].groupby("what"):
            place = place_of(str(what))
            right = part[part["place_right"].eq(True)]
            rows.append(
                (
                    _SETS[name],
                    words(str(what)),
                    ", ".join(place) if place else "–",
                    len(part),
                    *(
                        share_text(float(part[one].astype(bool).mean()))
                        for one in ("wrong", "learned")
                    ),
                    *(_share_of_placed(part[one]) for one in ("place_right", "place_wrong")),
                    _share_of_placed(right["confirmed"]),
                    share_text(float(right["explained"].astype(float).median())),
                )
            )
    heads = ["campaigns", "kind", "place", "n", "wrong name", "learned", "place right",
             "place wrong", "confirmed", "explained"]  # fmt: skip
    return markdown(pd.DataFrame(rows, columns=heads))


def _share_of_placed(values: pd.Series) -> str:
    """Share of those to which a question applies."""
    asked = values[values.notna()]
    return share_text(float(asked.astype(bool).mean())) if len(asked) else "–"


def method_table(baselines: pd.DataFrame) -> str:
    """The simpler methods, the diagnosis and the oracle, over all sizes."""
    whole = baselines[baselines["size"].isna()].set_index(["method", "set", "quantity"])["share"]
    columns = {
        "false alarm": ("null", "detected"),
        "wrong noise named": ("noise", "wrong"),
        "one: found": ("one", "detected"),
        "one: all names right": ("one", "right"),
        "one: first name right": ("one", "first right"),
        "one: some name wrong": ("one", "wrong"),
        "two: both right": ("two", "right"),
    }
    methods = dict.fromkeys(["diagnosis", "oracle", *baselines["method"]])
    rows = [
        (method, *(share_text(whole.get((method, *key), np.nan)) for key in columns.values()))
        for method in methods
    ]
    return markdown(pd.DataFrame(rows, columns=["method", *columns]))


def shrink_table(campaigns: pd.DataFrame) -> str:
    """Variance of unit weight before and after what was confirmed."""
    chosen = campaigns[campaigns["set"].isin(["one", "two"]) & campaigns["confirmed"].eq(True)]
    rows = [
        (
            _SETS[str(name)],
            f"{size:g}",
            len(part),
            number(part["sigma0_before"].median()),
            number(part["sigma0_after"].median()),
            number((part["sigma0_after"] / part["sigma0_before"]).median()),
        )
        for (name, size), part in chosen.groupby(["set", "size"])
    ]
    heads = ["campaigns", "λ", "confirmed", "σ₀² before", "σ₀² after", "ratio (medians)"]
    return markdown(pd.DataFrame(rows, columns=heads))


def effect_table(shares: pd.DataFrame, limits: pd.DataFrame) -> str:
    """Each effect over all sizes, and from its limits on."""
    one = shares[(shares["set"] == "one") & shares["size"].isna()]
    asked = {"found": "alarm", "name right": "right", "oracle": "oracle right", "wrong": "wrong"}
    rows = []
    for name in sorted(set(one["what"]) - {ALL}):
        part = limits[limits["what"] == name]
        rows.append(
            (
                words(name),
                *(_share(shares, quantity, "one", what=name) for quantity in asked.values()),
                _weighted(part, "detected", "above_mdb"),
                _weighted(part, "right", "above_mib"),
            )
        )
    heads = ["effect", *asked, "found from the MDB on", "right from the MIB on"]
    return markdown(pd.DataFrame(rows, columns=heads))


SAMPLE_TEXT = (
    "A test diagnoses these campaigns again. Where another answer comes out, the score is older "
    "than the code. The explanation is the most probable one, with its posterior; σ₀² is that of "
    "the base fit."
)


def sample_table(chosen: pd.DataFrame) -> str:
    """Campaigns of a sample, and what was said of each.

    Parameters
    ----------
    chosen : DataFrame, of `studies.hidden.scoring.sample`
    """
    rows = [
        {
            "cell": row["cell"],
            "campaign": row["campaign"],
            "verdict": words(row["verdict"]) if isinstance(row["verdict"], str) else "no answer",
            "confirmed": "yes" if row["confirmed"] is True else "no",
            "explanation": words(row["explanation"]),
            "posterior": number(row["posterior"]),
            "σ₀²": number(row["sigma0_before"]),
        }
        for row in chosen.to_dict("records")
    ]
    return markdown(pd.DataFrame(rows))


def failure_table(failed: pd.DataFrame) -> str:
    """Errors that ended a diagnosis, and how often each did."""
    counts = failed["error"].value_counts()
    return markdown(counts.rename_axis("error").reset_index(name="campaigns"))


def _weighted(part: pd.DataFrame, column: str, n: str) -> str:
    total = part[n].sum()
    if not total:
        return "–"
    return share_text(float((part[column].fillna(0) * part[n]).sum() / total))


def _share(shares: pd.DataFrame, quantity: str, set_: str, **division: str | float) -> str:
    row = share_of(shares, quantity, set_, **division)
    return "–" if row is None else share_text(row["share"])


def share_text(value: float) -> str:
    """Write a share to two digits, or three decimals."""
    return "–" if np.isnan(value) else f"{value:.3f}" if value < 0.0995 else f"{value:.2f}"


def interval_text(low: float, high: float) -> str:
    """Write an interval of a share."""
    return "–" if np.isnan(low) else f"{share_text(low)} … {share_text(high)}"


def markdown(table: pd.DataFrame) -> str:
    """Write a table in Markdown."""
    rows: list[Iterable[object]] = [table.columns, ["---"] * table.shape[1]]
    rows += table.itertuples(index=False)
    return "\n".join("| " + " | ".join(map(str, row)) + " |" for row in rows)
