"""The score of the study with real noise, as tables in Markdown."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from accelstudy.basics.shares import clopper_pearson
from accelstudy.basics.wording import words
from accelstudy.files.outputs import whole_file
from accelstudy.files.tables import origin, read_table, write_table
from studies.hidden.page import interval_text, markdown, share_text
from studies.hidden.real_noise import NEAR, NONE, RIGHT, SAID, RealNoiseConfig

CLASSES = {"> 0.01": 1.0, "10⁻⁴ … 0.01": 1e-2, "< 10⁻⁴": 1e-4}
"""Classes of the p-value of the F test that knows the form, and their upper ends."""
PLAIN = [*CLASSES][-1]
P = "p of the F test"
WITHIN = 3.0
"""Sigmas within which a size counts as right."""


def write_real_score(
    config: RealNoiseConfig,
    inputs: Sequence[str],
    outputs: Mapping[str, str],
    provenance: Mapping[str, Any],
) -> str:
    """Score a study; returns the page.

    Parameters
    ----------
    config : RealNoiseConfig
    inputs : paths of the tables of all logs
    outputs : paths of the table `campaigns` and of the `page`
    provenance : see `accelstudy.files.tables.origin`
    """
    campaigns = read_table(inputs)
    write_table(outputs["campaigns"], campaigns, provenance)
    page = real_page(config, campaigns, origin(provenance))
    with whole_file(outputs["page"]) as path:
        path.write_text(page, encoding="utf-8")
    return page


def real_page(config: RealNoiseConfig, campaigns: pd.DataFrame, origin: Mapping[str, Any]) -> str:
    """Write the score.

    Parameters
    ----------
    config : RealNoiseConfig
    campaigns : DataFrame, of all logs
    origin : see `accelstudy.files.tables.origin`
    """
    put = campaigns[campaigns["set"] != "null"]
    put = put.assign(p=[_class_of(p) for p in put["p_known"]], column=put["recorded"].map(_column))
    said = [one for one in SAID if one == RIGHT or (campaigns["said"] == one).any()]
    order = {what: i for i, what in enumerate(config.effects)}
    groups: list[tuple[Any, pd.DataFrame]] = [*put.groupby(["what", "column", "p"])]
    groups.sort(key=lambda item: (order[item[0][0]], item[0][1], [*CLASSES, ""].index(item[0][2])))
    by_effect = [
        (words(what), column, p, str(len(part)), *_said(part, said), *_beside(part))
        for (what, column, p), part in groups
    ]
    heads = ["effect", "its column", P, "n", *said, *BESIDE]
    in_all = ["what", P, "n", RIGHT, "95 %", *said[1:], *BESIDE]
    parts = [
        "# Score of the study with real noise",
        "Written by `make real-noise`, not by hand; hidden-effects.md explains it.",
        f"{len(campaigns)} campaigns from {len(config.logs)} logs, configuration "
        f"`{config.fingerprint}`, seed {origin['seed']}, accelstudy {origin['version']}, commit "
        f"`{origin['commit'][:10]}`.",
        "## In all",
        markdown(pd.DataFrame(_in_all(put, said), columns=in_all)),
        "## Each effect",
        markdown(pd.DataFrame(by_effect, columns=heads)),
        "## Nothing put in",
        markdown(
            pd.DataFrame(_nothing(config, campaigns, said), columns=["log", "truth", "n", *said])
        ),
        "## Plain, and said otherwise",
        PLAIN_TEXT,
        markdown(pd.DataFrame(_otherwise(put), columns=OTHERWISE)),
    ]
    return "\n\n".join(parts) + "\n"


def _class_of(p: float) -> str:
    """Class of a p-value, "" where there is none."""
    return "" if np.isnan(p) else next(name for name in [*CLASSES][::-1] if p <= CLASSES[name])


def _column(recorded: Any) -> str:
    return "–" if pd.isna(recorded) else "recorded" if recorded else "not recorded"


BESIDE = ("size within 3σ", "the same of the F test", "oracle: name right")


def _beside(part: pd.DataFrame) -> Iterator[str]:
    """How often sizes are right, by the diagnosis and by the F test, and the oracle's names."""
    for ratio, sigma in (("ratio", "ratio_sigma"), ("known_ratio", "known_sigma")):
        yield _of(abs(part[ratio] - 1) <= WITHIN * part[sigma], part[ratio])
    yield _of(part["oracle_right"].eq(True), part["oracle_right"])


def _said(part: pd.DataFrame, said: Sequence[str]) -> list[str]:
    return [str(int((part["said"] == one).sum())) for one in said]


def _of(yes: pd.Series, asked: pd.Series) -> str:
    """How many of those of which it is asked."""
    n = int(asked.notna().sum())
    return f"{int((yes & asked.notna()).sum())} of {n}" if n else "–"


def _in_all(put: pd.DataFrame, said: Sequence[str]) -> Iterator[tuple[str, ...]]:
    """Shares over all effects, by what the F test says and whether the columns are there."""
    missing = put["column"] == "not recorded"
    kinds = {
        "one effect, with its column": ~missing & (put["set"] == "one"),
        "one effect, without its column": missing,
        "two effects": put["set"] == "two",
    }
    for title, chosen in kinds.items():
        for name in CLASSES:
            part = put[chosen & (put["p"] == name)]
            if not len(part):
                continue
            counts = np.array([(part["said"] == one).sum() for one in said])
            low, high = clopper_pearson(counts[:1], np.array([len(part)]))
            ends = interval_text(float(low[0]), float(high[0]))
            first, *others = (share_text(count / len(part)) for count in counts)
            yield title, name, str(len(part)), first, ends, *others, *_beside(part)


def _nothing(
    config: RealNoiseConfig, campaigns: pd.DataFrame, said: Sequence[str]
) -> Iterator[tuple[str, ...]]:
    """What is said of each log into which nothing was put, beside what it has by itself."""
    for name, log in config.logs.items():
        part = campaigns[(campaigns["set"] == "null") & (campaigns["design"] == name)]
        yield name, log.note, str(len(part)), *_said(part, said)


OTHERWISE = ["campaign", P, "said", "verdict", "found", "oracle"]
PLAIN_TEXT = (
    f"Campaigns with p {PLAIN} that got neither the right name nor its family, nor a set that "
    "holds it, and the name that the oracle gives."
)


def _otherwise(put: pd.DataFrame) -> Iterator[tuple[str, ...]]:
    """Campaigns whose effect is plain, and that got another answer."""
    chosen = put[(put["p"] == PLAIN) & ~put["said"].isin([RIGHT, NEAR])]
    for row in chosen.to_dict("records"):
        said = row["error"] if row["said"] == NONE else words(row["verdict"])
        found, oracle = (_names(row[key]) for key in ("found", "oracle_told"))
        yield row["cell"], f"{row['p_known']:.1e}", row["said"], said, found, oracle


def _names(text: str) -> str:
    """Names of a list in JSON, or of lists of them."""
    each = [one if isinstance(one, str) else " = ".join(one) for one in json.loads(text)]
    return words(" + ".join(each)) or "–"
