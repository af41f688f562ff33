"""The tables of a score: shares of the judged campaigns, and what `targets.yaml` asks for."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import yaml
from numpy.typing import NDArray
from scipy.stats import binom

from accelstudy.basics.shares import clopper_pearson, sigmas_95
from accelstudy.basics.wording import number, words
from accelstudy.effects import get_effect
from studies.hidden.scoring.judging import JUDGED, Row, all_true, same_effects

Array = NDArray[np.float64]

TARGETS = yaml.safe_load((Path(__file__).parent / "targets.yaml").read_text(encoding="utf-8"))


def with_intervals(table: pd.DataFrame) -> pd.DataFrame:
    """Add the share and its 95 % interval to a table of `count` and `n`."""
    low, high = clopper_pearson(table["count"], table["n"])
    share = table["count"] / table["n"].where(table["n"] > 0)
    return table.assign(share=share, ci95_low=low, ci95_high=high)


def shares(judged: pd.DataFrame, question: str, *by: str) -> pd.DataFrame:
    """Share of campaigns of which the answer is yes, of those of which it is asked.

    Parameters
    ----------
    judged : DataFrame, of `judge`
    question : a column
    by : columns that divide the campaigns

    Returns
    -------
    DataFrame
        `by`, count, n, share, ci95_low, ci95_high
    """
    asked = judged[judged[question].notna()]
    groups = asked.assign(yes=asked[question].astype(bool)).groupby([*by])["yes"]
    return with_intervals(groups.agg(count="sum", n="size").reset_index())


def targets(judged: pd.DataFrame) -> pd.DataFrame:
    """What `targets.yaml` asks for, a row each.

    Returns
    -------
    DataFrame
        figure, cases (campaigns in words), wanted, least, most, measured, ci95_low, ci95_high, n,
        met: "yes", "no", or "–" if nothing was measured; no target is wanted of what explains them
    """
    told = judged.astype({name: object for name in ("set", "sigma", "approach")})
    for name in (*JUDGED, "confirmed"):
        if told[name].dtype != float:
            told[name] = told[name].eq(True).fillna(value=False).astype(bool)
    return pd.DataFrame([row for line in TARGETS for row in _rows(line, told)])


def _rows(line: Mapping[str, Any], judged: pd.DataFrame) -> Iterator[Row]:
    """Rows of a line of the table: one, or some for each λ."""
    lines = line.get("together", [line])
    of_set = judged if "set" not in lines[0] else judged[judged["set"] == lines[0]["set"]]
    by_size = "together" in line or "each" in line
    for size in sorted(of_set["size"].unique()) if by_size else [np.nan]:
        part = of_set[of_set["size"] == size] if by_size else of_set
        for one in lines:
            chosen = part.query(one["filter"], engine="python") if "filter" in one else part
            least, most, said = _bounds(one, chosen, size)
            # A line whose bounds are of some λ only leaves out the others.
            if least is not None or most is not None or not {"least", "most"} & one.keys():
                yield _row(one, chosen, size, least, most, said)


def _bounds(
    line: Mapping[str, Any], part: pd.DataFrame, size: float
) -> tuple[float | None, float | None, str]:
    """Least and most that is wanted, and what the oracle has."""
    least, most = (
        bound.get(size) if isinstance(bound, dict) else bound
        for bound in (line.get("least"), line.get("most"))
    )
    if "beside" in line:
        return least, most, f" (oracle {part[line['beside']].mean():.1f})"
    if "below_oracle" not in line:
        return least, most, ""
    best, below = part["oracle_right"].mean(), line["below_oracle"]
    if least is not None:
        return least, most, f" (oracle {best:.2f})"
    return best - below, most, f" (oracle {best:.2f} − {below:.2f})"


def _row(
    line: Mapping[str, Any],
    part: pd.DataFrame,
    size: float,
    least: float | None,
    most: float | None,
    said: str,
) -> Row:
    """What was measured of some campaigns, beside what is wanted."""
    n = len(part)
    values: Any = part.eval(line["of"], engine="python") if n else []
    measured, low, high = _measured(line.get("statistic", "share"), np.array(values, dtype=float))
    row = {"figure": line["figure"], "cases": line["campaigns"].format(size=size), "wanted": "",
           "least": least, "most": most, "measured": measured, "ci95_low": low, "ci95_high": high,
           "n": n, "met": ""}  # fmt: skip
    if least is not None or most is not None:
        fewest = line.get("n", 0)
        row["wanted"] = _wanted(least, most, said, fewest) if n or not said else "–"
        above = least is None or least - 1e-9 <= measured
        within = above and (most is None or measured <= most + 1e-9) and n >= fewest
        row["met"] = "–" if np.isnan(measured) else "yes" if within else "no"
    return row


def _wanted(least: float | None, most: float | None, said: str, n: int) -> str:
    """Say what is wanted."""
    if least is None and most is not None:
        text = f"≤ {number(most) if said else f'{most:g}'}"
    elif most is None or least is None:
        text = f"≥ {least:.2f}"
    elif least == most:
        text = f"{most:.2f}"
    else:
        text = f"{(least + most) / 2:.2f} ± {(most - least) / 2:.2f}"
    return text + said + (f", n ≥ {n}" if n else "")


def _measured(statistic: str, values: Array) -> tuple[float, float, float]:
    """Share, mean, or median of values, and its 95 % interval; a mean that is expected has none."""
    n, x = len(values), np.sort(values)
    if statistic == "share":
        low, high = clopper_pearson(x.sum(), n)
        return float(x.sum() / n) if n else np.nan, float(low), float(high)
    if not n:
        return np.nan, np.nan, np.nan
    if statistic == "median":  # between two order statistics
        k = int(binom.ppf(0.025, n, 0.5))
        return float(np.median(x)), *((float(x[k - 1]), float(x[n - k])) if k else (np.nan, np.nan))
    mean, spread = float(values.mean()), np.nan
    if statistic == "mean" and n > 1:
        spread = sigmas_95(n - 1) * x.std(ddof=1) / np.sqrt(n)
    return mean, mean - spread, mean + spread


# --- other tables ---------------------------------------------------------------------------------

NAMELESS = {"no_effect": "nothing", "learned": "learned", "unknown": "unknown",
            "noise_model": "noise", "gross_error": "gross error"}  # fmt: skip
"""Verdicts that give no effect, and what they are called."""
BINS = (0.0, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 1.0)
"""Bounds of the classes of stated probabilities."""


def family_name(name: str) -> str:
    """Return the family of an effect or, where it has none, its name, in plain words."""
    return get_effect(name).family or words(name)


def confusion(judged: pd.DataFrame) -> pd.DataFrame:
    """What single effects of each family are taken for: truth, answer, count, n and share.

    The answer is the family of the effect that is given first, or the verdict that gives none.
    """
    one = judged[(judged["set"] == "one") & judged["ok"].eq(True)]
    answers = [
        NAMELESS.get(verdict) or family_name(json.loads(found)[0])
        for verdict, found in zip(one["verdict"], one["found"], strict=True)
    ]
    table = pd.DataFrame({"truth": [family_name(name) for name in one["what"]], "answer": answers})
    counts = table.groupby(["truth", "answer"]).size().rename("count").reset_index()
    return with_intervals(counts.assign(n=counts.groupby("truth")["count"].transform("sum")))


def calibration(judged: pd.DataFrame) -> pd.DataFrame:
    """Stated probabilities, beside how often they come true.

    Of campaigns with one or two effects in which something was found.

    Returns
    -------
    DataFrame
        of ("explanation": the most probable one, "set": one of the credible set), from and to
        (bounds of the stated probability), stated (mean), count, n, share, ci95_low, ci95_high
    """
    hidden = judged[judged["set"].isin(["one", "two"]) & judged["set_given"].eq(True)]
    kinds = {"explanation": ("top_posterior", "top_right"), "set": ("set_posterior", "set_holds")}
    tables = []
    for kind, (stated, true) in kinds.items():
        bin_ = np.clip(np.digitize(hidden[stated], BINS) - 1, 0, len(BINS) - 2)
        groups = hidden.assign(yes=hidden[true].astype(bool)).groupby(bin_)
        counts = groups.agg(stated=(stated, "mean"), count=("yes", "sum"), n=("yes", "size"))
        low, high = (np.array(BINS)[counts.index + up] for up in (0, 1))
        tables.append(counts.assign(of=kind, **{"from": low, "to": high}))
    table = pd.concat(tables, ignore_index=True)
    return with_intervals(table[["of", "from", "to", "stated", "count", "n"]])


def baseline_table(judged: pd.DataFrame, answers: pd.DataFrame) -> pd.DataFrame:
    """The simpler methods, the diagnosis and the oracle on the same campaigns.

    Parameters
    ----------
    judged : DataFrame, of `judge`
    answers : DataFrame, of the methods: cell, campaign, method, detected, found

    Returns
    -------
    DataFrame
        method, set, size (NaN: all), quantity ("detected", "right": all names and no other,
        "first right": the strongest name, "wrong": some name), count, n, share, ci95_low, ci95_high
    """
    key = ["cell", "campaign"]
    same = judged.merge(answers[key].drop_duplicates(), on=key)
    named = same["found"].where(same["answered"].astype(bool), "[]")
    of_diagnosis = same.assign(method="diagnosis", detected=same["alarm"], found=named)
    known = same[same["oracle_detected"].notna()]
    of_oracle = known.assign(
        method="oracle", detected=known["oracle_detected"], found=known["oracle_best"]
    )
    told = answers.merge(judged[[*key, "set", "size", "classes"]], on=key)
    rows = []
    for row in pd.concat([told, of_diagnosis, of_oracle])[
        ["method", "set", "size", "detected", "found", "classes"]
    ].to_dict("records"):
        true = json.loads(row["classes"])
        names = [[one] if isinstance(one, str) else one for one in json.loads(row["found"])]
        rows.append({
            **row,
            "detected": bool(row["detected"]),
            "right": same_effects(names, true),
            "first right": all_true(names[:1], true),
            "wrong": bool(names) and not all_true(names, true),
        })  # fmt: skip
    asked = ["detected", "right", "first right", "wrong"]
    long = pd.DataFrame(rows, columns=["method", "set", "size", *asked]).melt(
        ["method", "set", "size"], var_name="quantity", value_name="yes"
    )
    by = ["method", "set", "quantity"]
    counted = [
        long.groupby(keys)["yes"].agg(count="sum", n="size").reset_index()
        for keys in ([*by[:2], "size", by[2]], by)
    ]
    return with_intervals(pd.concat(counted, ignore_index=True))
