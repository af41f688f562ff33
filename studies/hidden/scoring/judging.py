"""Each answer is judged by the truth of its campaign: a column for each question of a score."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from itertools import permutations
from typing import Any

import numpy as np
import pandas as pd

from studies.hidden.physics.designs import DESIGNS, session
from studies.hidden.physics.kinds import NOWHERE
from studies.hidden.physics.oracle import CREDIBLE
from studies.hidden.scoring.tables import SCORES
from studies.hidden.study import Row, family_of

Class = Collection[str]  # names that mean the same in a campaign
LARGE = 150.0  # λ from which on physics outside the catalogue must not get a name of the catalogue
LEARNABLE, P_CLASSES = (SCORES["score"][name] for name in ("learnable", "p_classes"))


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
    judged = pd.DataFrame([_judged(row, (own or {}).get(row["design"], ())) for row in rows])
    for name, question in SCORES["score"]["columns"].items():
        judged[name] = judged.eval(question, engine="python")
    return judged.assign(said=[_said(row) for row in judged.to_dict("records")])


def _judged(row: Row, own: Sequence[str]) -> Row:
    """Truth and answer of a campaign, and what else is asked about it."""
    ok, true, place, oracle = not row["error"], row["classes"], row["true_place"], row["oracle"]
    explanations = [
        {**one, "names": names}
        for one in row.get("credible_set", ())
        if (names := [name for name in one["names"] if name not in own])
    ]
    answers = zip(row.get("found", ()), row.get("positions", ()), strict=True)
    given = [(name, position) for name, position in answers if name not in own]
    found, verdict = [name for name, _ in given], row["verdict"] if ok else ""
    if own and verdict in ("named", "narrowed") and not found:
        verdict = "no_effect"
    names = [[name] for name in found]
    hits = [same_effects([[name] for name in one["names"]], true) for one in explanations]
    in_set = {name for one in explanations for name in one["names"]}
    answered, learned = verdict in ("named", "narrowed"), verdict == "learned"
    best, told = (oracle[key] if oracle else [] for key in ("best", "told"))
    top: Row = explanations[0] if explanations else {"names": [], "posterior": np.nan}
    certain = [{*names} for names in row.get("certain", ())]
    stated = [any(names & {*one} for one in true) for names in certain]
    covered = [any(names & {*one} for names in certain) for one in true]
    strange, gross = NOWHERE.get(row["what"]), row["gross"]
    bump = gross["settings"].get("position")
    true_noise = row["design"] in DESIGNS  # of a log it is not known
    return {
        **row,
        "verdict": verdict,
        "found": found,
        "credible_set": explanations,
        "ok": ok,
        "confirmed": ok and row["confirmed"],
        "name_confirmed": ok and row["name_confirmed"],
        # All effects, and no others; of some effects the names, and no others.
        "right": answered and same_effects(names, true),
        "correct": answered and all_true(names, true),
        # A gross error is named, and a bumped position where it is.
        "recognised": verdict == "gross_error"
        and any(name == gross["name"] and bump in (None, at) for name, at in given),
        "large": row["size"] >= LARGE
        and (row["sigma"] == "given" or (true_noise and session(row["design"]).repeats)),
        "explained": explained(row["fits"], row["design"]) if learned and true_noise else np.nan,
        "set_holds": any(hits),
        "set_names": len(in_set),
        "set_posterior": sum(one["posterior"] for one in explanations),
        "explanation": "+".join(top["names"]),
        "top_posterior": top["posterior"],
        "top_right": any(hits[:1]),
        "covered": np.mean(covered) if ok and true else np.nan,
        "misstated": np.mean(np.logical_not(stated)) if stated else np.nan,
        "has_oracle": bool(true and oracle),
        "oracle_found": bool(true and oracle and oracle["detected"]),
        "oracle_right": same_effects(best, true),
        "oracle_told": told,
        "oracle_alternatives": oracle["alternatives"] if oracle else np.nan,
        "told_right": same_effects(told, true),
        "its_place": ", ".join(strange.place if strange and strange.place else ("–",)),
        "has_place": place is not None,
        "learnable": place is not None and place[0] in LEARNABLE.get(place[1], ()),
        "place_right": learned and place is not None and row["place"] == place,
        "its_column": "not recorded" if row["recorded"] is False else "recorded",
        "p_class": next(
            (p for p, end in reversed(P_CLASSES.items()) if row["p_known"] < end), None
        ),
    }


def _said(row: Mapping[Any, Any]) -> str:
    """What an answer says of what is hidden, in two or three words.

    "family or set": of two effects one; a set that holds the right names; other names of the same
    families; or a verdict "unknown" that leaves no doubt of such a family. Without its column, what
    a temperature does is a slow change in time.
    """
    verdict, near = row["verdict"], "family or set"
    if not row["ok"]:
        return "no answer"
    if row["right"] or row["recognised"]:
        return "right name"
    if row["one_of_two"] or (verdict == "narrowed" and row["set_holds"]):
        return near
    slow = family_of("warm_up") if row["its_column"] == "not recorded" else ()
    heat = family_of("thermal_bias") if slow else ()
    families = [
        {kin for name in names for kin in (*family_of(name), *(slow if name in heat else ()))}
        for names in row["classes"]
    ]
    if verdict in ("named", "narrowed", "gross_error"):
        found = [[name] for name in row["found"]]
        return near if families and all_true(found, families) else "other name"
    certain = [
        sum(one["posterior"] for one in row["credible_set"] if family & {*one["names"]})
        for family in families
    ]
    if verdict == "unknown" and max(certain, default=0.0) >= CREDIBLE:
        return near
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
