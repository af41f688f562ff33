"""Whether an answer is right: one diagnosis beside the truth of its campaign."""

from __future__ import annotations

import json
from collections.abc import Sequence
from itertools import permutations
from typing import Any

import pandas as pd

EFFECTS_GIVEN = ("named", "narrowed")
"""Verdicts that give effects."""

Class = Sequence[str]
"""Names that mean the same in a campaign."""

JUDGED = (
    "ok", "alarm", "answered", "right", "wrong", "one_of_two", "recognised",
    "set_given", "set_holds", "set_names", "set_explanations", "set_posterior",
    "top_posterior", "top_right", "oracle_right", "told_right",
)  # fmt: skip
"""Columns that judging adds to a campaign."""


def same_effects(given: Sequence[Class], true: Sequence[Class]) -> bool:
    """Whether names or classes are those of the truth, each of another of its classes."""
    return len(given) == len(true) and all_true(given, true)


def all_true(given: Sequence[Class], true: Sequence[Class]) -> bool:
    """Whether names or classes are all of the truth, each of another of its classes."""
    if not given or len(given) > len(true):
        return False
    return any(
        all(set(one) & set(other) for one, other in zip(given, order, strict=True))
        for order in permutations(true, len(given))
    )


def judge(campaigns: pd.DataFrame) -> pd.DataFrame:
    """Judge the answers to campaigns.

    Parameters
    ----------
    campaigns : DataFrame
        Truths and outcomes side by side, as `accelstudy.hidden.study.diagnosing` writes them.

    Returns
    -------
    DataFrame
        The same with the columns `JUDGED`, and None where a question does not arise: whether a set
        holds the truth where no set is given, say. Of a diagnosis that failed all is false.
    """
    judged = pd.DataFrame([_judged(row) for row in campaigns.to_dict("records")], columns=JUDGED)
    return pd.concat([campaigns.reset_index(drop=True), judged], axis=1)


def _judged(row: dict[Any, Any]) -> dict[str, Any]:
    true = json.loads(row["classes"])
    ok = not row["error"]
    found = [[name] for name in json.loads(row["found"])] if ok else []
    answered = ok and row["verdict"] in EFFECTS_GIVEN
    right = answered and same_effects(found, true)
    correct = answered and all_true(found, true)
    judged_set = _judged_set(json.loads(row["credible_set"]) if ok else [], true)
    # A narrowed answer only says that it is one of the set.
    held = row["verdict"] == "narrowed" and bool(judged_set.get("set_holds"))
    return {
        "ok": ok,
        "alarm": ok and row["verdict"] != "no_effect",
        "answered": answered,
        "right": right,
        "wrong": answered and not correct and not held,
        "one_of_two": correct and not right,
        "recognised": _recognised(row) if row["gross_name"] else None,
        **judged_set,
        **_judged_oracle(row, true),
    }


def _recognised(row: dict[Any, Any]) -> bool:
    """Whether a gross error was recognised; one that ended the diagnosis was not."""
    if row["error"] or row["verdict"] != "gross_error":
        return False
    places = dict(zip(json.loads(row["found"]), json.loads(row["positions"]), strict=True))
    true = json.loads(row["gross"]).get("settings", {}).get("position")
    name = row["gross_name"]
    return name in places and (true is None or places[name] == true)


def _judged_set(explanations: Sequence[dict[str, Any]], true: Sequence[Class]) -> dict[str, Any]:
    """Judge a credible set; its first explanation is the most probable one."""
    if not explanations:
        return {"set_given": False}
    names = {name for one in explanations for name in one["names"]}
    hits = [same_effects([[name] for name in one["names"]], true) for one in explanations]
    return {
        "set_given": True,
        "set_holds": any(hits) if true else None,
        "set_names": len(names),
        "set_explanations": len(explanations),
        "set_posterior": sum(one["posterior"] for one in explanations),
        "top_posterior": explanations[0]["posterior"],
        "top_right": hits[0] if true else None,
    }


def _judged_oracle(row: dict[Any, Any], true: Sequence[Class]) -> dict[str, Any]:
    """Judge what the oracle says of a campaign with effects; it says nothing of others."""
    if not true or row["oracle_detected"] is None or pd.isna(row["oracle_detected"]):
        return {}
    return {
        "oracle_right": bool(row["oracle_detected"])
        and same_effects(json.loads(row["oracle_best"]), true),
        "told_right": same_effects(json.loads(row["oracle_told"]), true),
    }
