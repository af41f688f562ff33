"""Each answer is judged by the truth of its campaign."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from itertools import permutations
from typing import Any

import pandas as pd

from accelstudy.effects import effect_names
from studies.hidden.physics.designs import DESIGNS, session
from studies.hidden.physics.oracle import CREDIBLE
from studies.hidden.study import Row, family_of

Class = Sequence[str]
"""Names that mean the same in a campaign."""

LISTS = ("classes", "found", "positions", "credible_set", "fits", "place", "true_place", "gross",
         "oracle_best", "oracle_told")  # fmt: skip
"""Columns of JSON that are judged."""
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
QUESTIONS = (
    "ok", "alarm", *VERDICTS, "answered", "right", "wrong", "one_of_two", "recognised", "one_name",
    "set_given", "set_holds", "set_has_noise", "top_right", "has_oracle", "oracle_found",
    "oracle_right", "told_right", "explanation_right", "has_place", "learnable", "place_right",
    "place_wrong", "large",
)  # fmt: skip
"""What is asked of a campaign; missing where a question does not arise."""
NUMBERS = ("set_names", "set_explanations", "set_posterior", "top_posterior", "explained")
RIGHT, NEAR, OTHER, NONE = "right name", "family or set", "other name", "no answer"
SAID = (RIGHT, NEAR, OTHER, "noise", "unknown", "learned", "nothing", NONE)
"""What may be said of what is hidden."""


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


def judge(campaigns: pd.DataFrame, own: Mapping[str, Sequence[str]] | None = None) -> pd.DataFrame:
    """Judge the answers to campaigns: the same with `QUESTIONS`, `NUMBERS`, and one of `SAID`.

    Parameters
    ----------
    campaigns : DataFrame, a row of truth and answer each
    own : of designs the names of what they have by themselves, which count neither as right nor as
        wrong
    """
    rows = []
    records: Any = campaigns.to_dict("records")
    for row in records:
        for name in LISTS:
            row[name] = json.loads(row[name]) if isinstance(row[name], str) else None
        rows.append(_judged(_without(row, (own or {}).get(row["design"], ()))))
    types = dict.fromkeys(QUESTIONS, "boolean") | dict.fromkeys(NUMBERS, "float64")
    judged = pd.DataFrame(rows, columns=[*types, "said"]).astype({**types, "said": "string"})
    return pd.concat(
        [campaigns.reset_index(drop=True).astype({"confirmed": "boolean"}), judged], axis=1
    )


def _without(row: Row, own: Sequence[str]) -> Row:
    """An answer without what a design has by itself."""
    if not own or row["error"]:
        return row
    given = [*zip(row["found"], row["positions"], strict=True)]
    rest = [(name, place) for name, place in given if name not in own]
    explanations = [
        {**one, "names": [name for name in one["names"] if name not in own]}
        for one in row["credible_set"]
    ]
    only = row["verdict"] in ("named", "narrowed") and not rest
    return {
        **row,
        "found": [name for name, _ in rest],
        "positions": [place for _, place in rest],
        "verdict": "no_effect" if only else row["verdict"],
        "credible_set": [one for one in explanations if one["names"]],
    }


def _judged(row: Row) -> Row:
    """Answers to all questions about a campaign; of a diagnosis that failed all are no."""
    ok, true = not row["error"], row["classes"]
    verdict = row["verdict"] if ok else ""
    names, explanations = [[name] for name in row["found"] or ()], row["credible_set"] or []
    hits = [same_effects([[name] for name in one["names"]], true) for one in explanations]
    in_set = {name for one in explanations for name in one["names"]}
    answered = verdict in ("named", "narrowed")
    right, correct = answered and same_effects(names, true), answered and all_true(names, true)
    place, given = row["true_place"], row["place"]
    learned = verdict == "learned"
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
        "has_oracle": bool(true) and not pd.isna(row["oracle_detected"]),
        "has_place": place is not None,
        # Of a log, no true noise is known.
        "explained": explained(row["fits"], row["design"])
        if learned and row["design"] in DESIGNS
        else None,
    }
    if explanations:
        judged |= {
            "set_holds": any(hits) if true else None,
            "set_names": len(in_set),
            "set_explanations": len(explanations),
            "set_has_noise": bool(in_set - {*effect_names()}),
            "set_posterior": sum(one["posterior"] for one in explanations),
            "top_posterior": explanations[0]["posterior"],
            "top_right": hits[0] if true else None,
        }
    if judged["has_oracle"]:
        found = bool(row["oracle_detected"])
        judged |= {
            "oracle_found": found,
            "oracle_right": found and same_effects(row["oracle_best"], true),
            "told_right": same_effects(row["oracle_told"], true),
            "explanation_right": any(hits[:1]),
        }
    if place is not None:
        judged |= {
            "learnable": place[0] in LEARNABLE.get(place[1], ()),
            "place_right": learned and given == place,
            "place_wrong": learned and given != place,
        }
    return judged | {"said": _said(row, judged)}


def _noise_known(row: Row) -> bool:
    """Whether sigma is given, or repeated positions tell it."""
    return row["sigma"] == "given" or (row["design"] in DESIGNS and session(row["design"]).repeats)


def _recognised(row: Row) -> bool:
    """Whether a gross error was recognised; one that ended the diagnosis was not."""
    if row["error"] or row["verdict"] != "gross_error":
        return False
    places = dict(zip(row["found"], row["positions"], strict=True))
    true, name = row["gross"].get("settings", {}).get("position"), row["gross_name"]
    return name in places and (true is None or places[name] == true)


def _said(row: Row, judged: Row) -> str:
    """What an answer says of what is hidden, one of `SAID`.

    "family or set": of two effects one; a set that holds the right names; other names of the same
    families; or a verdict "unknown" that leaves no doubt of such a family. Without its column, what
    a temperature does is a slow change in time.
    """
    if not judged["ok"]:
        return NONE
    if judged["right"] or judged["recognised"]:
        return RIGHT
    verdict, recorded = row["verdict"], row.get("recorded")
    if judged["one_of_two"] or (verdict == "narrowed" and judged.get("set_holds")):
        return NEAR
    families = [[kin for name in names for kin in _kin(name, recorded)] for names in row["classes"]]
    if verdict in ("named", "narrowed", "gross_error"):
        found = [[name] for name in row["found"]]
        return NEAR if families and all_true(found, families) else OTHER
    certain = [
        sum(one["posterior"] for one in row["credible_set"] if {*one["names"]} & {*family})
        for family in families
    ]
    if verdict == "unknown" and max(certain, default=0.0) >= CREDIBLE:
        return NEAR
    return str({"no_effect": "nothing", "noise_model": "noise"}.get(verdict, verdict))


def _kin(name: str, recorded: object) -> tuple[str, ...]:
    """Effects of the family of one, and of what it is where its column is missing."""
    missing = recorded is False and name in family_of("thermal_bias")
    return (*family_of(name), *(family_of("warm_up") if missing else ()))


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
