"""The score: truths and outcomes joined, and all tables that follow from them."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from accelstudy.basics.errors import InputError
from accelstudy.basics.wording import words
from accelstudy.effects import get_effect
from studies.hidden.campaigns import KEY
from studies.hidden.judging import all_true, judge, same_effects, shares, with_intervals
from studies.hidden.limits import limit_table
from studies.hidden.targets import targets

BINS = (0.0, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 1.0)
"""Bounds of the classes of stated probabilities."""


def score_tables(
    truths: pd.DataFrame, outcomes: pd.DataFrame, answers: pd.DataFrame, limits: pd.DataFrame
) -> dict[str, pd.DataFrame]:
    """All tables of a score, by the names in `studies.hidden.cells.TABLES`.

    Parameters
    ----------
    truths, outcomes : DataFrame, of all chunks
    answers : DataFrame, of the simpler methods
    limits : DataFrame, of `studies.hidden.limits.study_limits`
    """
    judged = judge(joined(truths, outcomes))
    return {
        "campaigns": judged,
        "targets": targets(judged),
        "shares": shares(judged),
        "confusion": confusion(judged),
        "calibration": calibration(judged),
        "baselines": baseline_table(judged, answers),
        "limits": limit_table(judged, limits),
    }


def joined(truths: pd.DataFrame, outcomes: pd.DataFrame) -> pd.DataFrame:
    """Truths and outcomes side by side, one row for each campaign.

    Raises
    ------
    InputError
        If a campaign has a truth and no outcome, or the other way round.
    """
    table = truths.merge(outcomes, on=KEY, how="outer", validate="1:1", indicator=True)
    alone = table[table["_merge"] != "both"]
    if len(alone):
        first = alone.iloc[0]
        lacks = "outcome" if first["_merge"] == "left_only" else "truth"
        raise InputError(
            f"{first['cell']}, campaign {first['campaign']}: has no {lacks}; {len(alone)} in all; "
            "run the study again"
        )
    return table.drop(columns="_merge")


def confusion(judged: pd.DataFrame) -> pd.DataFrame:
    """What single effects of each family are taken for: truth, answer, count, n and share.

    The answer is the family of the effect that is given first, or the verdict that gives none.
    """
    one = judged[(judged["set"] == "one") & judged["ok"]]
    table = pd.DataFrame(
        {
            "truth": [family_name(name) for name in one["what"]],
            "answer": [_answer_family(row) for row in one.to_dict("records")],
        }
    )
    counts = table.groupby(["truth", "answer"]).size().rename("count").reset_index()
    counts["n"] = counts.groupby("truth")["count"].transform("sum")
    return with_intervals(counts)


def family_name(name: str) -> str:
    """Return the family of an effect or, where it has none, its name, in plain words."""
    return get_effect(name).family or words(name)


VERDICTS = {
    "no_effect": "nothing",
    "learned": "learned",
    "unknown": "unknown",
    "noise_model": "noise",
    "gross_error": "gross error",
}
"""Answers that give no effect."""


def _answer_family(row: Mapping[Any, Any]) -> str:
    if row["verdict"] in VERDICTS:
        return VERDICTS[row["verdict"]]
    return family_name(json.loads(row["found"])[0])


def calibration(judged: pd.DataFrame) -> pd.DataFrame:
    """Stated probabilities, beside how often they come true.

    Of campaigns with one or two effects in which something was found.

    Returns
    -------
    DataFrame
        of ("explanation": the most probable one, "set": one of the credible set), bounds of the
        stated probability, mean of the stated ones, count, n, share, ci95_low, ci95_high
    """
    hidden = judged[judged["set"].isin(["one", "two"]) & judged["set_given"].eq(True)]
    rows = []
    kinds = {"explanation": ("top_posterior", "top_right"), "set": ("set_posterior", "set_holds")}
    for kind, (stated, true) in kinds.items():
        values = hidden[stated].to_numpy(float)
        yes = hidden[true].to_numpy(bool)
        which = np.clip(np.digitize(values, BINS) - 1, 0, len(BINS) - 2)
        for i in np.unique(which):
            here = which == i
            rows.append(
                {
                    "of": kind,
                    "from": BINS[i],
                    "to": BINS[i + 1],
                    "stated": values[here].mean(),
                    "count": int(yes[here].sum()),
                    "n": int(here.sum()),
                }
            )
    columns = ["of", "from", "to", "stated", "count", "n"]
    return with_intervals(pd.DataFrame(rows, columns=columns))


def baseline_table(judged: pd.DataFrame, answers: pd.DataFrame) -> pd.DataFrame:
    """The simpler methods, the diagnosis and the oracle on the same campaigns.

    Returns
    -------
    DataFrame
        method, set, size (NaN: all), quantity ("detected", "right": all names and no other,
        "first right": the strongest name, "wrong": some name), count, n, share, ci95_low, ci95_high
    """
    columns = [*KEY, "set", "size", "classes", "ok", "alarm", "right", "wrong", "oracle_detected",
               "oracle_right", "found", "answered"]  # fmt: skip
    table = answers.merge(judged[columns], on=KEY, suffixes=("", "_diagnosis"))
    rows = [_baseline_row(row) for row in table.to_dict("records")]
    same = judged.merge(answers[KEY].drop_duplicates(), on=KEY)
    rows += [row for one in same.to_dict("records") for row in _reference_rows(one)]
    long = pd.DataFrame(rows, columns=["method", "set", "size", *_QUANTITIES]).melt(
        ["method", "set", "size"], var_name="quantity", value_name="yes"
    )
    long = long[long["yes"].notna()].astype({"yes": bool})
    sized = long.groupby(["method", "set", "size", "quantity"])["yes"]
    whole = long.groupby(["method", "set", "quantity"])["yes"]
    counted = [part.agg(count="sum", n="size").reset_index() for part in (sized, whole)]
    return with_intervals(pd.concat(counted, ignore_index=True))


_QUANTITIES = ("detected", "right", "first right", "wrong")


def _baseline_row(row: Mapping[Any, Any]) -> dict[str, Any]:
    return {
        "method": row["method"],
        "detected": bool(row["detected"]),
        **_judged_names(json.loads(row["found"]), json.loads(row["classes"])),
        **{name: row[name] for name in ("set", "size")},
    }


def _judged_names(names: Sequence[str], true: Sequence[Sequence[str]]) -> dict[str, bool]:
    given = [[name] for name in names]
    return {
        "right": same_effects(given, true),
        "first right": all_true(given[:1], true),
        "wrong": bool(given) and not all_true(given, true),
    }


def _reference_rows(row: Mapping[Any, Any]) -> list[dict[str, Any]]:
    place = {name: row[name] for name in ("set", "size")}
    true = json.loads(row["classes"])
    names = json.loads(row["found"]) if row["answered"] else []
    diagnosis = {"method": "diagnosis", "detected": row["alarm"], **_judged_names(names, true)}
    rows = [{**place, **diagnosis}]
    if not pd.isna(row["oracle_detected"]):
        best = [[*one] for one in json.loads(row["oracle_best"])]
        rows.append(
            {
                **place,
                "method": "oracle",
                "detected": bool(row["oracle_detected"]),
                "right": same_effects(best, true),
                "first right": all_true(best[:1], true),
                "wrong": bool(best) and not all_true(best, true),
            }
        )
    return rows


BY_KIND = ("noise", "one", "gross")
"""Sets of which each kind has its campaign; of the others each size has one."""


def sample(campaigns: pd.DataFrame) -> pd.DataFrame:
    """Choose a campaign of each kind or size, as good as at random, whatever others there are.

    Parameters
    ----------
    campaigns : DataFrame, truths and outcomes side by side

    Returns
    -------
    DataFrame
        cell, campaign; verdict, whether it is confirmed, the most probable explanation with its
        posterior, and the variance of unit weight before
    """
    kind = campaigns["what"].where(campaigns["set"].isin(BY_KIND), campaigns["size"])
    keys = campaigns["cell"] + " " + campaigns["campaign"].astype(str)
    digest = keys.map(lambda key: hashlib.sha256(key.encode()).hexdigest())
    chosen = (
        campaigns.assign(kind=kind, digest=digest)
        .sort_values("digest")
        .drop_duplicates(["set", "kind"])
        .sort_values("cell", kind="stable")
    )
    first = [(json.loads(one) if one else []) for one in chosen["credible_set"].fillna("")]
    return chosen[[*KEY, "verdict", "confirmed"]].assign(
        explanation=["+".join(one[0]["names"]) if one else "" for one in first],
        posterior=[one[0]["posterior"] if one else float("nan") for one in first],
        sigma0_before=chosen["sigma0_before"],
    )
