"""Each answer is judged by the truth of its campaign: a column for each question of a score."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import permutations

import numpy as np
import pandas as pd

from accelstudy.effects import effect_names
from studies.hidden.physics.designs import DESIGNS, session
from studies.hidden.physics.oracle import CREDIBLE
from studies.hidden.physics.outside import NOWHERE
from studies.hidden.study import Row, family_of

Class = Sequence[str]
"""Names that mean the same in a campaign."""

LARGE = 150.0
"""λ from which on physics outside the catalogue must not get a name of the catalogue."""
LEARNABLE: Mapping[str, Sequence[str]] = {
    "bias": ("force", "previous", "next", "yaw", "vibration", "temperature", "dT/dt", "time"),
    "scale": ("vibration", "temperature", "dT/dt", "time"),
    "nonorthogonality": ("temperature", "time"),
    "tilt": ("yaw", "vibration", "temperature", "time"),
    "reading": ("angle", "yaw", "move", "vibration", "temperature", "time"),
}
"""Target -> coordinates of which the diagnosis can learn a function for it."""

VERDICTS = ("named", "narrowed", "learned", "unknown", "noise_model", "gross_error")
"""Verdicts that something is missing; the first two give effects."""
RIGHT, NEAR, OTHER, NONE = "right name", "family or set", "other name", "no answer"
P_CLASSES = {"> 0.01": 1.1, "10⁻⁴ … 0.01": 1e-2, "< 10⁻⁴": 1e-4}
"""Classes of the p-value of the F test that knows the form, and their upper ends."""


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


def judge(rows: Iterable[Row], own: Mapping[str, Sequence[str]] | None = None) -> pd.DataFrame:
    """Judge the answers to campaigns.

    Parameters
    ----------
    rows : of `studies.hidden.campaigns.row_of`
    own : of designs the names of what they have by themselves, which count neither as right nor as
        wrong

    Returns
    -------
    DataFrame
        The same with the answers to all questions; of a diagnosis that failed all are no
    """
    return pd.DataFrame([_judged(row, (own or {}).get(row["design"], ())) for row in rows])


def _judged(row: Row, own: Sequence[str]) -> Row:
    """Truth and answer of a campaign, and the answers to all questions about it."""
    ok, true, place, oracle = not row["error"], row["classes"], row["true_place"], row["oracle"]
    explanations = row.get("credible_set", [])
    given = [*zip(row.get("found", ()), row.get("positions", ()), strict=True)]
    verdict = row["verdict"] if ok else ""
    if own:
        explanations = [
            {**one, "names": names}
            for one in explanations
            if (names := [name for name in one["names"] if name not in own])
        ]
        given = [(name, position) for name, position in given if name not in own]
        if verdict in ("named", "narrowed") and not given:
            verdict = "no_effect"
    found = [name for name, _ in given]
    names = [[name] for name in found]
    hits = [same_effects([[name] for name in one["names"]], true) for one in explanations]
    in_set = {name for one in explanations for name in one["names"]}
    answered, learned = verdict in ("named", "narrowed"), verdict == "learned"
    right, correct = answered and same_effects(names, true), answered and all_true(names, true)
    has_oracle = bool(true and oracle)
    oracle_found = has_oracle and oracle["detected"]
    top: Row = explanations[0] if explanations else {"names": [], "posterior": np.nan}
    certain = [{*names} for names in row.get("certain", ())]
    stated = [any(names & {*one} for one in true) for names in certain]
    covered = [any(names & {*one} for names in certain) for one in true]
    strange = NOWHERE.get(row["what"])
    true_noise = row["design"] in DESIGNS  # of a log it is not known
    judged = {
        **row,
        "verdict": verdict,
        "found": found,
        "credible_set": explanations,
        "ok": ok,
        "alarm": ok and verdict != "no_effect",
        "confirmed": ok and row["confirmed"],
        **{name: verdict == name for name in VERDICTS},
        "answered": answered,
        "right": right,
        # A narrowed answer only says that it is one of the set.
        "wrong": answered and not correct and not (verdict == "narrowed" and any(hits)),
        "one_of_two": correct and not right,
        "recognised": verdict == "gross_error" and _recognised(row["gross"], dict(given)),
        "one_name": len(names) == 1,
        "large": row["size"] >= LARGE
        and (row["sigma"] == "given" or (true_noise and session(row["design"]).repeats)),
        "explained": explained(row["fits"], row["design"]) if learned and true_noise else np.nan,
        "set_given": bool(explanations),
        "set_holds": any(hits),
        "set_names": len(in_set),
        "set_explanations": len(explanations),
        "set_has_noise": bool(in_set - {*effect_names()}),
        "set_posterior": sum(one["posterior"] for one in explanations),
        "explanation": "+".join(top["names"]),
        "top_posterior": top["posterior"],
        "top_right": any(hits[:1]),
        "covered": np.mean(covered) if ok and true else np.nan,
        "misstated": np.mean(np.logical_not(stated)) if stated else np.nan,
        "has_oracle": has_oracle,
        "oracle_found": oracle_found,
        "oracle_right": oracle_found and same_effects(oracle["best"], true),
        "oracle_told": oracle["told"] if oracle else [],
        "oracle_alternatives": oracle["alternatives"] if oracle else np.nan,
        "told_right": has_oracle and same_effects(oracle["told"], true),
        "its_place": ", ".join(strange.place if strange and strange.place else ("–",)),
        "has_place": place is not None,
        "learnable": place is not None and place[0] in LEARNABLE.get(place[1], ()),
        "place_right": learned and place is not None and row["place"] == place,
        "place_wrong": learned and place is not None and row["place"] != place,
        "its_column": "not recorded" if row["recorded"] is False else "recorded",
        "p_class": next((p for p, end in [*P_CLASSES.items()][::-1] if row["p_known"] < end), None),
    }
    return judged | {"said": _said(judged)}


def _recognised(gross: Row, places: Mapping[str, float | None]) -> bool:
    """Whether a gross error is named, and a bumped position where it is."""
    true, name = gross["settings"].get("position"), gross["name"]
    return name in places and (true is None or places[name] == true)


def _said(row: Row) -> str:
    """What an answer says of what is hidden, in two or three words.

    "family or set": of two effects one; a set that holds the right names; other names of the same
    families; or a verdict "unknown" that leaves no doubt of such a family. Without its column, what
    a temperature does is a slow change in time.
    """
    verdict = row["verdict"]
    if not row["ok"]:
        return NONE
    if row["right"] or row["recognised"]:
        return RIGHT
    if row["one_of_two"] or (verdict == "narrowed" and row["set_holds"]):
        return NEAR
    slow = family_of("warm_up") if row["its_column"] == "not recorded" else ()
    heat = family_of("thermal_bias") if slow else ()
    families = [
        {kin for name in names for kin in (*family_of(name), *(slow if name in heat else ()))}
        for names in row["classes"]
    ]
    if verdict in ("named", "narrowed", "gross_error"):
        found = [[name] for name in row["found"]]
        return NEAR if families and all_true(found, [[*family] for family in families]) else OTHER
    certain = [
        sum(one["posterior"] for one in row["credible_set"] if family & {*one["names"]})
        for family in families
    ]
    if verdict == "unknown" and max(certain, default=0.0) >= CREDIBLE:
        return NEAR
    return str({"no_effect": "nothing", "noise_model": "noise"}.get(verdict, verdict))


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
