"""The tables of a score: shares of the judged campaigns, and what `score.yaml` asks for."""

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

from accelstudy.adjustment.quality import noncentrality
from accelstudy.basics.shares import clopper_pearson, sigmas_95
from accelstudy.basics.wording import number, words
from accelstudy.diagnosis.visibility import POWER, examine_campaign, visibilities
from accelstudy.effects import get_effect
from accelstudy.sensors.models import get_model
from studies.hidden.physics.generate import Case, generate
from studies.hidden.scoring.judging import all_true, judge, same_effects
from studies.hidden.study import HiddenConfig, Row

Array = NDArray[np.float64]
Tables = Mapping[str, pd.DataFrame]

SCORE = yaml.safe_load((Path(__file__).parent / "score.yaml").read_text(encoding="utf-8"))


def score_tables(campaigns: pd.DataFrame, limits: pd.DataFrame) -> Tables:
    """All tables of a score.

    Parameters
    ----------
    campaigns : DataFrame, truths and outcomes side by side
    limits : DataFrame, of `study_limits`
    """
    judged = with_limits(judge(campaigns), limits)
    return {
        "campaigns": judged,
        "targets": targets(judged),
        "confusion": confusion(judged),
        "calibration": calibration(judged),
        "baselines": baseline_table(judged),
        "limits": limit_table(judged, limits),
    }


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
    asked = judged[judged[question].notna()].astype({question: int})
    return with_intervals(asked.groupby([*by])[question].agg(count="sum", n="size").reset_index())


def with_intervals(table: pd.DataFrame) -> pd.DataFrame:
    """Add the share and its 95 % interval to a table of `count` and `n`."""
    low, high = clopper_pearson(table["count"], table["n"])
    share = table["count"] / table["n"].where(table["n"] > 0)
    return table.assign(share=share, ci95_low=low, ci95_high=high)


# --- what is wanted -------------------------------------------------------------------------------


def targets(judged: pd.DataFrame) -> pd.DataFrame:
    """What `score.yaml` asks for, a row each.

    Returns
    -------
    DataFrame
        figure, cases (campaigns in words), wanted, least, most, measured, ci95_low, ci95_high, n,
        met: "yes", "no", or "–" if nothing was measured; no target is wanted of what explains them
    """
    told = judged.astype({name: object for name in ("set", "sigma", "approach")})
    yes = told.select_dtypes("boolean").fillna(value=False).astype(bool)
    told[yes.columns] = yes
    return pd.DataFrame([row for line in SCORE["targets"] for row in _lines(line, told)])


def _lines(line: Mapping[str, Any], judged: pd.DataFrame) -> Iterator[Row]:
    """Rows of a line: one, or some for each λ."""
    together = line.get("together", [line])
    of_set = judged if "set" not in together[0] else judged[judged["set"] == together[0]["set"]]
    by_size = "together" in line or "each" in line
    for size in sorted(of_set["size"].unique()) if by_size else [np.nan]:
        part = of_set[of_set["size"] == size] if by_size else of_set
        for one in together:
            chosen = part.query(one["filter"], engine="python") if "filter" in one else part
            row = _line(one, chosen, size)
            # A line whose bounds are of some λ only leaves out the others.
            if row["wanted"] or not {"least", "most"} & one.keys():
                yield row


def _line(line: Mapping[str, Any], part: pd.DataFrame, size: float) -> Row:
    """What was measured of some campaigns, beside what is wanted."""
    n, fewest = len(part), line.get("n", 0)
    values: Any = part.eval(line["of"], engine="python") if n else []
    measured, low, high = _measured(line.get("statistic", "share"), np.array(values, dtype=float))
    least, most = (
        bound.get(size) if isinstance(bound, dict) else bound
        for bound in (line.get("least"), line.get("most"))
    )
    oracle = wanted = met = ""
    if "beside" in line:
        oracle = f" (oracle {part[line['beside']].mean():.1f})"
    elif "below_oracle" in line:
        best, below = part["oracle_right"].mean(), line["below_oracle"]
        oracle = f" (oracle {best:.2f})" if least else f" (oracle {best:.2f} − {below:.2f})"
        least = least or best - below
    if least is not None or most is not None:
        wanted = "–"
        if n or not oracle:
            wanted = _wanted(least, most, oracle) + (f", n ≥ {fewest}" if fewest else "")
        within = (least or 0) - 1e-9 <= measured <= (np.inf if most is None else most) + 1e-9
        met = "–" if np.isnan(measured) else "yes" if within and n >= fewest else "no"
    return {
        **{"figure": line["figure"], "cases": line["campaigns"].format(size=size)},
        **{"wanted": wanted, "least": least, "most": most, "measured": measured},
        **{"ci95_low": low, "ci95_high": high, "n": n, "met": met},
    }


def _wanted(least: float | None, most: float | None, oracle: str) -> str:
    """Say what is wanted."""
    if most is None:
        return f"≥ {least:.2f}{oracle}"
    if least is None:
        return f"≤ {number(most)}{oracle}" if oracle else f"≤ {most:g}"
    if least == most:
        return f"{most:.2f}"
    return f"{(least + most) / 2:.2f} ± {(most - least) / 2:.2f}"


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


def confusion(judged: pd.DataFrame) -> pd.DataFrame:
    """What single effects of each family are taken for: truth, answer, count, n and share.

    The answer is the family of the effect that is given first, or the verdict that gives none.
    """
    one = judged[(judged["set"] == "one") & judged["ok"]]
    first = [
        NAMELESS.get(verdict) or family_name(json.loads(found)[0])
        for verdict, found in zip(one["verdict"], one["found"], strict=True)
    ]
    table = pd.DataFrame({"truth": one["what"].map(family_name), "answer": first})
    counts = table.value_counts(sort=False).reset_index()
    return with_intervals(counts.assign(n=counts.groupby("truth")["count"].transform("sum")))


def family_name(name: str) -> str:
    """Return the family of an effect or, where it has none, its name, in plain words."""
    return get_effect(name).family or words(name)


def calibration(judged: pd.DataFrame) -> pd.DataFrame:
    """Stated probabilities, beside how often they come true.

    Of campaigns with one or two effects in which something was found.

    Returns
    -------
    DataFrame
        of ("explanation": the most probable one, "set": one of the credible set), from and to
        (bounds of the stated probability), stated (mean), count, n, share, ci95_low, ci95_high
    """
    hidden = judged[judged["set"].isin(["one", "two"]) & judged["set_given"]]
    kinds = {"explanation": ("top_posterior", "top_right"), "set": ("set_posterior", "set_holds")}
    tables = []
    for kind, (stated, true) in kinds.items():
        bin_ = np.clip(np.digitize(hidden[stated], BINS) - 1, 0, len(BINS) - 2)
        groups = hidden.groupby(bin_).agg(
            stated=(stated, "mean"), count=(true, "sum"), n=(true, "size")
        )
        low, high = (np.array(BINS)[groups.index + up] for up in (0, 1))
        tables.append(groups.assign(of=kind, **{"from": low, "to": high}))
    table = pd.concat(tables, ignore_index=True).astype({"count": int})
    return with_intervals(table[["of", "from", "to", "stated", "count", "n"]])


def baseline_table(judged: pd.DataFrame) -> pd.DataFrame:
    """The simpler methods, the diagnosis and the oracle on the same campaigns.

    Returns
    -------
    DataFrame
        method, set, size (NaN: all), quantity ("detected", "right": all names and no other,
        "first right": the strongest name, "wrong": some name), count, n, share, ci95_low, ci95_high
    """
    rows = []
    for row in judged[judged["methods"] != "null"].to_dict("records"):
        told = json.loads(row["methods"])
        told["diagnosis"] = row["alarm"], json.loads(row["found"]) if row["answered"] else []
        if not pd.isna(row["oracle_detected"]):
            told["oracle"] = row["oracle_detected"], json.loads(row["oracle_best"])
        true = json.loads(row["classes"])
        for method, (detected, found) in told.items():
            names = [[one] if isinstance(one, str) else one for one in found]
            said = (bool(detected), same_effects(names, true), all_true(names[:1], true),
                    bool(names) and not all_true(names, true))  # fmt: skip
            rows.append((method, row["set"], row["size"], *said))
    quantities = ("detected", "right", "first right", "wrong")
    table = pd.DataFrame(rows, columns=["method", "set", "size", *quantities])
    return pd.concat(
        [
            shares(table, quantity, *by).assign(quantity=quantity)
            for by in (("method", "set", "size"), ("method", "set"))
            for quantity in quantities
        ],
        ignore_index=True,
    )


# --- the smallest size that a design should show --------------------------------------------------

ALPHA = 0.001
"""Level of the tests for which the minimal detectable and identifiable sizes are computed."""
EDGES = (0.4, 0.6, 0.75, 0.9, 1.1, 1.35, 1.7, 2.2, 3.0, 4.5, 7.0)
"""Bounds of the classes of sizes relative to a limit."""
PLACE = ["what", "design", "approach"]


def study_limits(config: HiddenConfig) -> pd.DataFrame:
    """Limits of all effects in each design and approach, from a campaign without any effect.

    The minimal detectable and identifiable sizes are also given as noncentralities λ, which do not
    depend on parameters and units. λ of the MDB is that of a test of one parameter. λ of the MIB is
    larger by (MIB/MDB)², since the nearest rival has to be excluded as well.
    """
    model, rows = get_model(config.model), []
    for design, approach in dict.fromkeys(place[:2] for place in config.places):
        case = Case("null", design, approach, sigma_known=True)
        campaign, _ = generate(case, case.seed(config.seed, 0))
        rows += [
            {"what": row.name, "design": design, "approach": approach, "mdb": row.mdb,
             "mib": row.mib, "unit": row.unit, "nearest": next(iter(row.confused), ("",))[0]}
            for row in visibilities(examine_campaign(campaign, model), ALPHA)
            if row.status == "visible" and np.isfinite(row.mdb)
        ]  # fmt: skip
    limits, least = pd.DataFrame(rows), noncentrality(1, ALPHA, POWER)
    ratio = limits["mib"] / limits["mdb"]
    return limits.assign(lambda_mdb=least, lambda_mib=least * ratio**2)


def with_limits(judged: pd.DataFrame, limits: pd.DataFrame) -> pd.DataFrame:
    """Add by_mdb and by_mib, the sizes of single effects as multiples of their limits.

    detected and identified say whether something is found from the MDB on, and the right name from
    the MIB on; both should be so in 0.8 of the campaigns at least.
    """
    table = judged.merge(limits[[*PLACE, "lambda_mdb", "lambda_mib"]], on=PLACE, how="left")
    one = table["set"] == "one"
    for limit, answer, question in (("mdb", "alarm", "detected"), ("mib", "right", "identified")):
        size = table["size"].where(one) / table.pop(f"lambda_{limit}")
        table[f"by_{limit}"] = np.sqrt(size)
        table[question] = table[answer].where(table[f"by_{limit}"] >= 1)
    return table


def limit_table(judged: pd.DataFrame, limits: pd.DataFrame) -> pd.DataFrame:
    """Limits of each effect in each design, beside the power that the study finds there.

    Parameters
    ----------
    judged : DataFrame, of `with_limits`
    limits : DataFrame, of `study_limits`

    Returns
    -------
    DataFrame
        A row per effect, design, approach and noise: the columns of `limits`, and above_mdb,
        detected, above_mib, right: campaigns from the limit on, and the share of them in which
        something is found, or the name is right
    """
    one = judged[judged["by_mdb"].notna()]
    counted = one.groupby([*PLACE, "sigma"]).agg(
        above_mdb=("detected", "count"), detected=("detected", "mean"),
        above_mib=("identified", "count"), right=("identified", "mean"),
    )  # fmt: skip
    return limits.merge(counted.reset_index(), on=PLACE)


def power_over(judged: pd.DataFrame, limit: str, answer: str) -> pd.DataFrame:
    """Share of campaigns with an answer, over their size beside a limit.

    Parameters
    ----------
    judged : DataFrame, of `with_limits`
    limit : str, "by_mdb" or "by_mib"
    answer : str, a column of `judged`

    Returns
    -------
    DataFrame
        beside (geometric mean), count, n, share, ci95_low, ci95_high
    """
    class_ = pd.cut(judged[limit], EDGES, labels=False)
    table = shares(judged.assign(class_=class_), answer, "class_")
    beside = np.exp(np.log(judged[limit]).groupby(class_).mean())
    return table.assign(beside=table["class_"].map(beside))
