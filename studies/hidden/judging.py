"""Whether an answer is right: each diagnosis beside the truth of its campaign, and shares.

Shares have their intervals, by set, effect, size, design, approach and noise.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from itertools import permutations
from typing import Any

import numpy as np
import pandas as pd

from accelstudy.basics.shares import clopper_pearson
from studies.hidden.physics.designs import session

EFFECTS_GIVEN = ("named", "narrowed")
"""Verdicts that give effects."""
LEARNED = "learned"
"""Verdict that gives a function of a coordinate in place of a name."""

Class = Sequence[str]
"""Names that mean the same in a campaign."""

JUDGED = (
    "ok", "alarm", "answered", "right", "wrong", "one_of_two", "recognised",
    "set_given", "set_holds", "set_names", "set_explanations", "set_posterior",
    "top_posterior", "top_right", "oracle_right", "told_right",
    "learned", "has_place", "place_right", "place_wrong", "explained",
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
        Truths and outcomes side by side, as `studies.hidden.diagnosing` writes them.

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
    names = [[name] for name in json.loads(row["found"])] if ok else []
    answered = ok and row["verdict"] in EFFECTS_GIVEN
    right = answered and same_effects(names, true)
    correct = answered and all_true(names, true)
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
        **_judged_place(row),
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


def _judged_place(row: dict[Any, Any]) -> dict[str, Any]:
    """Judge the coordinate and target of a function that was learned, which is no name."""
    learned = not row["error"] and row["verdict"] == LEARNED
    true, given = (json.loads(row[name] or "null") for name in ("true_place", "place"))
    judged: dict[str, Any] = {"learned": learned, "has_place": true is not None}
    if learned and row["fits"]:  # of a real log, the true noise is not known
        judged["explained"] = explained(json.loads(row["fits"]), row["design"])
    if true is not None:
        judged["place_right"] = learned and given == true
        judged["place_wrong"] = learned and given != true
    return judged


def explained(fits: Sequence[Mapping[str, float]], design: str) -> float:
    """Share of the noncentrality that a fit explains, 1 − (Ω₂ − ν₂)/(Ω₁ − ν₁).

    Ω is the sum of squares of the residuals over the true σ² of forces and angles, whatever the
    diagnosis takes for them, before (1) and after (2). ν is what noise alone leaves of it, on
    average: the redundancy, if no parameter has a prior.

    Parameters
    ----------
    fits : two mappings with force (m²/s⁴), angle (rad²) and noise (ν), before and after
    design : str, of the session
    """
    true = session(design)
    before, after = (
        fit["force"] / true.sigma**2 + fit["angle"] / true.sigma_angle**2 - fit["noise"]
        for fit in fits
    )
    return 1 - after / before


ALL = "all"
"""Value of a column by which a share is not divided."""
COLUMNS = ("set", "what", "size", "design", "approach", "sigma")
"""Columns by which campaigns are divided; a size of NaN stands for all sizes, or none."""
SPLITS: tuple[tuple[str, ...], ...] = (
    ("set",),
    ("set", "size"),
    ("set", "what"),
    ("set", "what", "size"),
    ("set", "sigma"),
    ("set", "size", "sigma"),
    ("set", "approach", "sigma"),
    ("set", "size", "approach", "sigma"),
    ("set", "design", "approach", "sigma"),
)
"""Divisions of the table of shares."""


def with_intervals(table: pd.DataFrame) -> pd.DataFrame:
    """Add the share and its 95 % interval to a table of `count` and `n`."""
    low, high = clopper_pearson(table["count"], table["n"])
    share = table["count"] / table["n"].where(table["n"] > 0)
    return table.assign(share=share, ci95_low=low, ci95_high=high)


Answers = Callable[[pd.DataFrame], pd.Series]
"""Yes, no or None for each campaign; None where the question does not arise."""


def _answer(name: str) -> Answers:
    return lambda judged: judged[name]


def _verdict(name: str) -> Answers:
    return lambda judged: judged["verdict"] == name


def _of(condition: Answers, answer: Answers) -> Answers:
    return lambda judged: answer(judged).astype(object).where(condition(judged).eq(True), None)


QUESTIONS: Mapping[str, Answers] = {
    "failed": lambda judged: ~judged["ok"].astype(bool),
    "alarm": _answer("alarm"),
    **{
        name: _verdict(name)
        for name in (*EFFECTS_GIVEN, LEARNED, "unknown", "noise_model", "gross_error")
    },
    "answered": _answer("answered"),
    "right": _answer("right"),
    "wrong": _answer("wrong"),
    "one of two": _answer("one_of_two"),
    "recognised": _answer("recognised"),
    "confirmed": _answer("confirmed"),
    "wrong, of those named": _of(_verdict("named"), _answer("wrong")),
    "wrong, of those answered": _of(_answer("answered"), _answer("wrong")),
    "confirmed, of those answered": _of(_answer("answered"), _answer("confirmed")),
    "place right": _answer("place_right"),
    "place wrong": _answer("place_wrong"),
    "confirmed, of places that are right": _of(_answer("place_right"), _answer("confirmed")),
    "set holds the truth": _answer("set_holds"),
    "explanation right": _of(
        lambda judged: judged["oracle_right"].notna(), lambda judged: judged["top_right"].eq(True)
    ),
    "oracle found": _of(lambda judged: judged["oracle_right"].notna(), _answer("oracle_detected")),
    "oracle right": _answer("oracle_right"),
    "oracle right if told": _answer("told_right"),
}
"""What is asked of each campaign; *answered* is one that got names, `named` or `narrowed`."""


def shares(judged: pd.DataFrame, splits: Sequence[Sequence[str]] = SPLITS) -> pd.DataFrame:
    """Shares of the campaigns of which the answer to each of `QUESTIONS` is yes.

    Parameters
    ----------
    judged : DataFrame, of `studies.hidden.judging.judge`
    splits : what the campaigns are divided by

    Returns
    -------
    DataFrame
        `COLUMNS`, quantity, count, n, share, ci95_low, ci95_high
    """
    asked = []
    for quantity, answers in QUESTIONS.items():
        yes = answers(judged)
        answered = yes.notna()
        part = judged.loc[answered, list(COLUMNS)]
        asked.append(part.assign(quantity=quantity, yes=yes[answered].astype(bool)))
    table = pd.concat(asked, ignore_index=True)
    return with_intervals(
        pd.concat([_counted(table, [*split]) for split in splits], ignore_index=True)
    )


def _counted(table: pd.DataFrame, split: list[str]) -> pd.DataFrame:
    """Counts of a division, with `ALL` and NaN in the columns that it does not divide by."""
    groups = table.groupby([*split, "quantity"], sort=True)["yes"]
    counted = groups.agg(count="sum", n="size").reset_index()
    for name in COLUMNS:
        if name not in split:
            counted[name] = np.nan if name == "size" else ALL
    return counted[[*COLUMNS, "quantity", "count", "n"]]


def share_of(
    table: pd.DataFrame, quantity: str, set_: str, **division: str | float
) -> pd.Series | None:
    """Row of a table of shares; None where it has no campaign of that kind.

    Parameters
    ----------
    table : DataFrame, of `shares`
    quantity : str, one of `QUESTIONS`
    set_ : str
    division : values of those of `COLUMNS` by which the share is divided
    """
    chosen = (table["quantity"] == quantity) & (table["set"] == set_)
    for name in COLUMNS[1:]:
        if name in division:
            chosen &= table[name] == division[name]
        else:
            chosen &= table[name].isna() if name == "size" else table[name] == ALL
    return table[chosen].iloc[0] if chosen.any() else None
