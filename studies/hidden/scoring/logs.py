"""The score of the study with real noise: what is said of what was put in, and its page."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from accelstudy.basics.shares import clopper_pearson
from accelstudy.basics.wording import words
from accelstudy.files.tables import origin, read_table, write_table
from studies.hidden.cells import family_of
from studies.hidden.physics.oracle import CREDIBLE
from studies.hidden.real_noise import RealNoiseConfig
from studies.hidden.scoring.judging import JUDGED, Row, all_true, judge
from studies.hidden.scoring.page import interval_text, render, share_text, written


def write_real_score(
    config: RealNoiseConfig,
    inputs: Sequence[str],
    outputs: Mapping[str, str],
    provenance: Mapping[str, Any],
) -> str:
    """Score a study with real noise, as `write_score` does, from the tables of all logs."""
    own = {name: log.own for name, log in config.logs.items()}
    campaigns = judge_logs(read_table([*inputs]), own)
    write_table(outputs["campaigns"], campaigns, provenance)
    return written(outputs["page"], real_page(config, campaigns, origin(provenance)))


RIGHT, NEAR, OTHER, NONE = "right name", "family or set", "other name", "no answer"
SAID = (RIGHT, NEAR, OTHER, "noise", "unknown", "learned", "nothing", NONE)
"""What may be said of what was put in."""


def judge_logs(campaigns: pd.DataFrame, own: Mapping[str, Sequence[str]]) -> pd.DataFrame:
    """Judge the answers to campaigns of logs: the same with `JUDGED`, and `said`, one of `SAID`.

    Parameters
    ----------
    campaigns : DataFrame, of `log_table`
    own : of each log the names of what it has by itself, which count neither as right nor as wrong
    """
    rows = [_without(row, own.get(row["design"], ())) for row in campaigns.to_dict("records")]
    judged = judge(pd.DataFrame(rows, columns=campaigns.columns))
    said = [said_of(row) for row in judged.to_dict("records")]
    return pd.concat([campaigns.reset_index(drop=True), judged[[*JUDGED]]], axis=1).assign(
        said=pd.Series(said, dtype="string")
    )


def _without(row: Mapping[Any, Any], own: Sequence[str]) -> Row:
    """An answer without what a log has by itself."""
    if row["error"]:
        return {**row}
    given = [*zip(json.loads(row["found"]), json.loads(row["positions"]), strict=True)]
    rest = [(name, place) for name, place in given if name not in own]
    explanations = [
        {**one, "names": [name for name in one["names"] if name not in own]}
        for one in json.loads(row["credible_set"])
    ]
    only = own and row["verdict"] in ("named", "narrowed") and not rest
    return {
        **row,
        "found": json.dumps([name for name, _ in rest]),
        "positions": json.dumps([place for _, place in rest]),
        "verdict": "no_effect" if only else row["verdict"],
        "credible_set": json.dumps([one for one in explanations if one["names"]]),
    }


def said_of(row: Mapping[Any, Any]) -> str:
    """What an answer says of what was put in, one of `SAID`.

    "family or set": of two effects one; a set that holds the right names; other names of the same
    families; or a verdict "unknown" that leaves no doubt of such a family. Without its column, what
    a temperature does is a slow change in time.
    """
    if not row["ok"]:
        return NONE
    if row["right"] or row["recognised"] is True:
        return RIGHT
    verdict = str(row["verdict"])
    families = [
        [kin for name in names for kin in _kin(name, row["recorded"])]
        for names in json.loads(row["classes"])
    ]
    if row["one_of_two"] or (verdict == "narrowed" and row["set_holds"] is True):
        return NEAR
    if verdict in ("named", "narrowed", "gross_error"):
        found = [[name] for name in json.loads(row["found"])]
        return NEAR if families and all_true(found, families) else OTHER
    explanations = json.loads(row["credible_set"])
    certain = [
        sum(one["posterior"] for one in explanations if set(one["names"]) & set(family))
        for family in families
    ]
    if verdict == "unknown" and max(certain, default=0.0) >= CREDIBLE:
        return NEAR
    return {"no_effect": "nothing", "noise_model": "noise"}.get(verdict, verdict)


def _kin(name: str, recorded: bool | None) -> tuple[str, ...]:
    """Effects of the family of one, and of what it is where its column is missing."""
    missing = recorded is False and name in family_of("thermal_bias")
    return (*family_of(name), *(family_of("warm_up") if missing else ()))


# --- the page -----------------------------------------------------------------------------------

CLASSES = {"> 0.01": 1.0, "10⁻⁴ … 0.01": 1e-2, "< 10⁻⁴": 1e-4}
"""Classes of the p-value of the F test that knows the form, and their upper ends."""
PLAIN = [*CLASSES][-1]
P = "p of the F test"
WITHIN = 3.0
"""Sigmas within which a size counts as right."""


def real_page(config: RealNoiseConfig, campaigns: pd.DataFrame, origin: Mapping[str, Any]) -> str:
    """Write the score of a study with real noise.

    Parameters
    ----------
    config : RealNoiseConfig
    campaigns : DataFrame, of ``judge_logs``
    origin : see `accelstudy.files.tables.origin`
    """
    put = campaigns[campaigns["set"] != "null"]
    column = [
        "–" if pd.isna(one) else "recorded" if one else "not recorded" for one in put["recorded"]
    ]
    p = pd.Categorical([_class_of(p) for p in put["p_known"]], [*CLASSES, ""])
    what = pd.Categorical(put["what"], config.effects)
    put = put.assign(effect=what, column=column, p=p)
    said = [one for one in SAID if one == RIGHT or (campaigns["said"] == one).any()]
    return render(
        "real.md.j2",
        n=len(campaigns),
        logs=len(config.logs),
        fingerprint=config.fingerprint,
        origin=origin,
        whole=pd.DataFrame([*_whole(put, said)]),
        effects=pd.DataFrame([*_by_effect(put, said)]),
        nothing=pd.DataFrame([*_nothing(config, campaigns, said)]),
        plain=PLAIN,
        otherwise=pd.DataFrame([*_otherwise(put)], columns=OTHERWISE),
    )


def _class_of(p: float) -> str:
    """Class of a p-value, "" where there is none."""
    return "" if np.isnan(p) else next(name for name in [*CLASSES][::-1] if p <= CLASSES[name])


def _counts(part: pd.DataFrame, said: Sequence[str]) -> dict[str, int]:
    return {one: int((part["said"] == one).sum()) for one in said}


def _beside(part: pd.DataFrame) -> dict[str, str]:
    """How often sizes are right, by the diagnosis and by the F test, and the oracle's names."""

    def within(ratio: str, sigma: str) -> str:
        return _of(abs(part[ratio] - 1) <= WITHIN * part[sigma], part[ratio])

    return {
        "size within 3σ": within("ratio", "ratio_sigma"),
        "the same of the F test": within("known_ratio", "known_sigma"),
        "oracle: name right": _of(part["oracle_right"].eq(True), part["oracle_right"]),
    }


def _of(yes: pd.Series, asked: pd.Series) -> str:
    """How many of those of which it is asked."""
    n = int(asked.notna().sum())
    return f"{int((yes & asked.notna()).sum())} of {n}" if n else "–"


def _whole(put: pd.DataFrame, said: Sequence[str]) -> Iterator[dict[str, Any]]:
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
            n = len(part)
            if n:
                first, *others = _counts(part, said).items()
                low, high = clopper_pearson(first[1], n)
                yield {
                    "what": title, P: name, "n": n, first[0]: share_text(first[1] / n),
                    "95 %": interval_text(float(low), float(high)),
                    **{one: share_text(count / n) for one, count in others}, **_beside(part),
                }  # fmt: skip


def _by_effect(put: pd.DataFrame, said: Sequence[str]) -> Iterator[dict[str, Any]]:
    """Each effect, by whether its columns are there and what the F test says."""
    for (what, column, p), part in put.groupby(["effect", "column", "p"], observed=True):
        place = {"effect": words(str(what)), "its column": column, P: p, "n": len(part)}
        yield {**place, **_counts(part, said), **_beside(part)}


def _nothing(
    config: RealNoiseConfig, campaigns: pd.DataFrame, said: Sequence[str]
) -> Iterator[dict[str, Any]]:
    """What is said of each log into which nothing was put, beside what it has by itself."""
    for name, log in config.logs.items():
        part = campaigns[(campaigns["set"] == "null") & (campaigns["design"] == name)]
        yield {"log": name, "truth": log.note, "n": len(part), **_counts(part, said)}


OTHERWISE = ["campaign", P, "said", "verdict", "found", "oracle"]


def _otherwise(put: pd.DataFrame) -> Iterator[tuple[str, ...]]:
    """Campaigns whose effect is plain, and that got another answer."""
    chosen = put[(put["p"] == PLAIN) & ~put["said"].isin([RIGHT, NEAR])]
    for row in chosen.to_dict("records"):
        failed = row["said"] == NONE
        verdict = row["error"] if failed else words(row["verdict"])
        found = "[]" if failed else row["found"]
        names = _names(found), _names(row["oracle_told"])
        yield row["cell"], f"{row['p_known']:.1e}", row["said"], verdict, *names


def _names(text: str) -> str:
    """Names of a list in JSON, or of lists of them."""
    each = [one if isinstance(one, str) else " = ".join(one) for one in json.loads(text)]
    return words(" + ".join(each)) or "–"
