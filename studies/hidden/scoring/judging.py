"""Each answer is judged by the truth of its campaign."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from itertools import permutations
from typing import Any

import pandas as pd

from accelstudy.effects import effect_names
from studies.hidden.physics.designs import DESIGNS, session

Row = dict[str, Any]
Class = Sequence[str]
"""Names that mean the same in a campaign."""

LARGE = 150.0
"""λ from which on physics outside the catalogue must not get a name of the catalogue."""
LEARNABLE: Mapping[str, Sequence[str]] = {
    "bias": ("force", "previous", "next", "yaw", "vibration", "temperature", "dT/dt", "time"),
    "scale": ("vibration", "temperature", "dT/dt", "time"),
    "tilt": ("yaw", "vibration", "temperature", "time"),
    "reading": ("angle", "yaw", "move", "vibration", "temperature", "time"),
}
"""Target -> coordinates of which the diagnosis can learn a function for it."""

VERDICTS = ("named", "narrowed", "learned", "unknown", "noise_model", "gross_error")
"""Verdicts that something is missing; the first two give effects."""
JUDGED = (
    "ok", "alarm", *VERDICTS, "answered", "right", "wrong", "one_of_two", "recognised", "one_name",
    "set_given", "set_holds", "set_names", "set_explanations", "set_has_noise", "set_posterior",
    "top_posterior", "top_right", "has_oracle", "oracle_found", "oracle_right", "told_right",
    "explanation_right", "has_place", "learnable", "place_right", "place_wrong", "explained",
    "large",
)  # fmt: skip
"""Columns that judging adds to a campaign; None where a question does not arise."""


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
    """Judge the answers to campaigns, a row of truth and answer each: the same with `JUDGED`."""
    rows = [_judged(row) for row in campaigns.to_dict("records")]
    judged = pd.DataFrame(rows, columns=JUDGED).astype(object)
    numbers = ["set_names", "set_explanations", "set_posterior", "top_posterior", "explained"]
    judged[numbers] = judged[numbers].astype(float)
    return pd.concat([campaigns.reset_index(drop=True), judged], axis=1)


def _judged(row: Mapping[Any, Any]) -> Row:
    """Answers to all questions about a campaign; of a diagnosis that failed all are no."""
    ok, true = not row["error"], json.loads(row["classes"])
    verdict = row["verdict"] if ok else ""
    names = [[name] for name in json.loads(row["found"])] if ok else []
    explanations = json.loads(row["credible_set"]) if ok else []
    hits = [same_effects([[name] for name in one["names"]], true) for one in explanations]
    answered = verdict in ("named", "narrowed")
    right, correct = answered and same_effects(names, true), answered and all_true(names, true)
    judged = {
        "ok": ok,
        "alarm": ok and verdict != "no_effect",
        **{name: verdict == name for name in VERDICTS},
        "answered": answered,
        "right": right,
        # A narrowed answer only says that it is one of the set.
        "wrong": answered and not correct and not (verdict == "narrowed" and any(hits)),
        "one_of_two": correct and not right,
        "recognised": _recognised(row) if row["gross_name"] else None,
        "one_name": len(names) == 1,
        "set_given": bool(explanations),
        "large": row["size"] >= LARGE and _noise_known(row),
        **_judged_place(row),
    }
    if explanations:
        in_set = {name for one in explanations for name in one["names"]}
        judged |= {
            "set_holds": any(hits) if true else None,
            "set_names": len(in_set),
            "set_explanations": len(explanations),
            "set_has_noise": bool(in_set - {*effect_names()}),
            "set_posterior": sum(one["posterior"] for one in explanations),
            "top_posterior": explanations[0]["posterior"],
            "top_right": hits[0] if true else None,
        }
    judged["has_oracle"] = bool(true) and not pd.isna(row["oracle_detected"])
    if judged["has_oracle"]:
        found = bool(row["oracle_detected"])
        judged |= {
            "oracle_found": found,
            "oracle_right": found and same_effects(json.loads(row["oracle_best"]), true),
            "told_right": same_effects(json.loads(row["oracle_told"]), true),
            "explanation_right": bool(hits) and hits[0],
        }
    return judged


def _noise_known(row: Mapping[Any, Any]) -> bool:
    """Whether sigma is given, or repeated positions tell it."""
    return row["sigma"] == "given" or (row["design"] in DESIGNS and session(row["design"]).repeats)


def _recognised(row: Mapping[Any, Any]) -> bool:
    """Whether a gross error was recognised; one that ended the diagnosis was not."""
    if row["error"] or row["verdict"] != "gross_error":
        return False
    places = dict(zip(json.loads(row["found"]), json.loads(row["positions"]), strict=True))
    true = json.loads(row["gross"]).get("settings", {}).get("position")
    name = row["gross_name"]
    return name in places and (true is None or places[name] == true)


def _judged_place(row: Mapping[Any, Any]) -> Row:
    """Judge the coordinate and target of a function that was learned, which is no name."""
    learned = not row["error"] and row["verdict"] == "learned"
    true, given = (
        json.loads(row[name]) if isinstance(row[name], str) else None
        for name in ("true_place", "place")
    )
    judged: Row = {"has_place": true is not None}
    if learned and row["design"] in DESIGNS:  # of a log, no true noise is known
        judged["explained"] = explained(json.loads(row["fits"]), row["design"])
    if true is not None:
        judged["learnable"] = true[0] in LEARNABLE.get(true[1], ())
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
