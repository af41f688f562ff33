"""What the pages say of a score beside its targets: one row for each share or mean."""

from __future__ import annotations

import json
from collections.abc import Iterator

import numpy as np
import pandas as pd

from accelstudy.basics.shares import clopper_pearson
from accelstudy.basics.wording import words
from accelstudy.diagnosis.decision.priors import MANY
from accelstudy.effects import effect_names
from accelstudy.hidden.score.targets import LARGE

SURER = (0.8, 0.85)
"""Posteriors above the one from which on a name is given."""

Row = dict[str, object]


def further(judged: pd.DataFrame) -> pd.DataFrame:
    """Shares and means that explain the targets.

    Parameters
    ----------
    judged : DataFrame, of `accelstudy.hidden.score.judging.judge`

    Returns
    -------
    DataFrame
        figure, cases, measured, ci95_low and ci95_high (NaN for means), n
    """
    columns = ["figure", "cases", "measured", "ci95_low", "ci95_high", "n"]
    rows = [*_of_one(judged), *_of_names(judged), *_of_others(judged)]
    return pd.DataFrame(rows, columns=columns)


def _of_one(judged: pd.DataFrame) -> Iterator[Row]:
    """One effect: sets beside those of the oracle, and names that are withheld."""
    one = judged[judged["set"] == "one"]
    for size, part in one.groupby("size"):
        cases = f"one effect, λ = {size:g}"
        given = part[part["set_given"].eq(True)]
        more = given["set_names"].astype(float) - given["oracle_alternatives"].astype(float)
        yield _mean("names in a 90 % set beyond the oracle's", cases, more)
        right = part[part["top_right"].eq(True)]
        withheld = right[right["right"].eq(False)]
        yield _share("right, and withheld", cases, right, right["right"].eq(False))
        many = withheld["set_explanations"].astype(float) > MANY
        yield _share(f"more than {MANY} explanations, of those withheld", cases, withheld, many)
        few = withheld[~many]
        noise = few["credible_set"].map(_has_noise)
        yield _share("noise in the set, of the others withheld", cases, few, noise)


def _of_names(judged: pd.DataFrame) -> Iterator[Row]:
    """One and two effects: names that are given, and wrong."""
    named = judged[judged["set"].isin(["one", "two"]) & (judged["verdict"] == "named")]
    stated = named["top_posterior"].astype(float)
    yield _mean("named, and wrong, as the posteriors expect", "one and two effects", 1 - stated)
    for least in SURER:
        part = named[stated >= least]
        yield _share("named, and wrong", f"posterior from {least:g} on", part, part["wrong"])
    single = named["found"].map(lambda found: len(json.loads(found)) == 1)
    wrong = named[(named["set"] == "one") & named["wrong"].eq(True) & single]
    yield _share("the oracle wrong, too", "one effect, a wrong single name", wrong,
                 wrong["oracle_right"].eq(False))  # fmt: skip
    for size, part in judged[judged["set"] == "two"].groupby("size"):
        cases = f"two effects, λ = {size:g} each"
        yield _share("one of the two alone", cases, part, part["one_of_two"])


def _of_others(judged: pd.DataFrame) -> Iterator[Row]:
    """Physics that the diagnosis does not know, and names where nothing is missing."""
    large = judged[judged["size"] >= LARGE]
    for what, part in large[large["set"] == "outside"].groupby("what"):
        cases = f"{words(str(what))}, λ ≥ {LARGE:g}"
        yield _share("named or narrowed wrongly", cases, part, part["wrong"])
    removed = large[(large["set"] == "removed") & large["wrong"].eq(True)]
    yield _share("confirmed, of those wrong", f"family taken out, λ ≥ {LARGE:g}", removed,
                 removed["confirmed"])  # fmt: skip
    null = judged[(judged["set"] == "null") & judged["confirmed"].eq(True)]
    blind = (null["approach"] == "gravity") & (null["sigma"] == "not given")
    yield _share("by gravity alone, sigma not given", "nothing missing, confirmed", null, blind)


def _has_noise(credible_set: str) -> bool:
    """Whether an explanation of a set is the noise, or something that the catalogue lacks."""
    names = {name for one in json.loads(credible_set) for name in one["names"]}
    return bool(names - {*effect_names()})


def _share(figure: str, cases: str, part: pd.DataFrame, yes: pd.Series) -> Row:
    count, n = int(yes.astype(bool).sum()), len(part)
    low, high = clopper_pearson(count, n)
    measured = count / n if n else np.nan
    return {"figure": figure, "cases": cases, "measured": measured, "ci95_low": float(low),
            "ci95_high": float(high), "n": n}  # fmt: skip


def _mean(figure: str, cases: str, values: pd.Series) -> Row:
    mean = float(values.mean()) if len(values) else np.nan
    return {"figure": figure, "cases": cases, "measured": mean, "ci95_low": np.nan,
            "ci95_high": np.nan, "n": len(values)}  # fmt: skip
