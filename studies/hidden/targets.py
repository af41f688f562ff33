"""What the diagnosis achieves: one row for each target, and for what explains the targets."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd
from scipy.stats import binom

from accelstudy.basics.shares import clopper_pearson, sigmas_95
from accelstudy.basics.wording import number, words
from accelstudy.diagnosis.decision.priors import MANY
from accelstudy.effects import effect_names
from studies.hidden.physics.designs import session

LARGE = 150.0
"""λ from which on physics outside the catalogue must not get a name of the catalogue."""
FEWEST = 150
"""Names and functions that are given where nothing is missing, for the share of confirmed ones."""
NAMED = {25.0: 0.66, 40.0: 0.81, 60.0: 0.86, 100.0: 0.89}
"""Share of single effects that are named rightly, at least, by λ; else it is the oracle's."""
BOTH = {25.0: 0.42, 40.0: 0.60, 60.0: 0.70}
"""Share of two effects that are both named rightly, at least, by λ."""
LEARNABLE: Mapping[str, Sequence[str]] = {
    "bias": ("force", "previous", "next", "yaw", "vibration", "temperature", "dT/dt", "time"),
    "scale": ("vibration", "temperature", "dT/dt", "time"),
    "tilt": ("yaw", "vibration", "temperature", "time"),
    "reading": ("angle", "yaw", "move", "vibration", "temperature", "time"),
}
"""Target -> coordinates of which the diagnosis can learn a function for it."""

Row = dict[str, Any]


@dataclass(frozen=True)
class Target:
    """A target, and what was measured.

    Attributes
    ----------
    figure : str, what is measured
    cases : str, on which campaigns
    wanted : str, the target in words
    least, most : float, range of the target
    measured : float; NaN if there are no such campaigns
    ci95_low, ci95_high : float
    n : int, campaigns
    fewest : int, campaigns without which it is not met
    """

    figure: str
    cases: str
    wanted: str
    least: float
    most: float
    measured: float
    ci95_low: float
    ci95_high: float
    n: int
    fewest: int = 0

    @property
    def met(self) -> str:
        """Return "yes", "no", or "–" if nothing was measured."""
        if np.isnan(self.measured):
            return "–"
        if self.n < self.fewest:
            return "no"
        return "yes" if self.least - 1e-9 <= self.measured <= self.most + 1e-9 else "no"


def targets(judged: pd.DataFrame) -> pd.DataFrame:
    """All targets, in the order in which they are reported.

    Parameters
    ----------
    judged : DataFrame, of `studies.hidden.judging.judge`

    Returns
    -------
    DataFrame
        The attributes of `Target`, and met.
    """
    return pd.DataFrame([{**vars(target), "met": target.met} for target in _targets(judged)])


def _targets(judged: pd.DataFrame) -> Iterator[Target]:
    of = dict(iter(judged.groupby("set")))
    none = judged[:0]
    null, one, two = (of.get(name, none) for name in ("null", "one", "two"))
    yield _target("campaigns without an answer", "all", judged, ~judged["ok"].astype(bool), 0, 0)
    for sigma in ("given", "not given"):
        part = null[null["sigma"] == sigma]
        cases = f"nothing missing, sigma {sigma}"
        yield _target("false alarm", cases, part, part["alarm"], 0.04, 0.06)
    noise = of.get("noise", none)
    yield _target("named or narrowed to effects", "wrong noise only", noise, noise["answered"],
                 0, 0.03)  # fmt: skip
    yield from _names(one)
    named = judged[judged["set"].isin(["one", "two"]) & (judged["verdict"] == "named")]
    yield _target("named, and wrong", "one and two effects", named, named["wrong"], 0, 0.02)
    yield from _sets(one)
    for size, part in _by_size(two):
        cases = f"two effects, λ = {size:g} each"
        yield _oracle("both of two right", cases, part, 0.10, BOTH.get(size))
    yield from _unnamed(plain(judged))
    yield _target("confirmed", "nothing missing", null, null["confirmed"], 0, 0.003)
    said = null["answered"].eq(True) | null["learned"].eq(True)
    yield _target("named, narrowed or learned", "nothing missing", null, said, 0, 0.013)
    given = null[said]
    confirmed = _target("confirmed, given a name or a function", "nothing missing", given,
                        given["confirmed"], 0.02, 0.08)  # fmt: skip
    yield replace(confirmed, wanted=f"{confirmed.wanted}, n ≥ {FEWEST}", fewest=FEWEST)
    gross = of.get("gross", none)
    yield _target("recognised", "gross errors", gross, gross["recognised"], 1, 1)


def plain(judged: pd.DataFrame) -> pd.DataFrame:
    """Campaigns with λ of at least `LARGE` in which the noise is known, by sigma or by repeats."""
    repeats = [name for name in judged["design"].unique() if session(name).repeats]
    known = (judged["sigma"] == "given") | judged["design"].isin(repeats)
    return judged[known & (judged["size"] >= LARGE)]


UNNAMED = f"λ ≥ {LARGE:g}"


def _unnamed(large: pd.DataFrame) -> Iterator[Target]:
    """What the catalogue has no name for: its place, and names that are wrong."""
    outside = large[large["set"] == "outside"]
    placed = outside[outside["has_place"].eq(True)]
    cases = f"never in the catalogue, with a place, {UNNAMED}"
    wrong = "named or narrowed wrongly"
    yield _target(wrong, cases, placed, placed["wrong"], 0, 0.03)
    yield _target("place right", cases, placed, placed["place_right"], 0.70, 1)
    yield _target("place wrong", cases, placed, placed["place_wrong"], 0, 0.02)
    right = placed[placed["place_right"].eq(True)]
    cases = f"never in the catalogue, place right, {UNNAMED}"
    yield _target("confirmed", cases, right, right["confirmed"], 0.80, 1)
    yield _middle("share of λ explained, median", cases, right["explained"], 0.85)
    for name, cases, most in (
        ("unforeseen", "unforeseen", 0.12),
        ("removed", "family taken out", 0.12),
    ):
        part = large[large["set"] == name]
        yield _target(wrong, f"{cases}, {UNNAMED}", part, part["wrong"], 0, most)


def _names(one: pd.DataFrame) -> Iterator[Target]:
    figure = "best name right, named or narrowed"
    for size, part in _by_size(one):
        yield _oracle(figure, f"one effect, λ = {size:g}", part, 0.03, NAMED.get(size))
    yield _oracle(figure, "one effect, over all λ", one, 0.03)


MOST_NAMES = {25.0: 2.4, 40.0: 1.6, 60.0: 1.4}
"""Names in a set, on average, by λ."""


def _sets(one: pd.DataFrame) -> Iterator[Target]:
    given = one[one["set_given"].eq(True)]
    for size, part in _by_size(given):
        cases = f"one effect, λ = {size:g}"
        yield _target("90 % set holds the truth", cases, part, part["set_holds"], 0.90, 1)
    for size, part in _by_size(given):
        if size in MOST_NAMES:
            yield _few_names(
                "names in a 90 % set", f"one effect, λ = {size:g}", part, MOST_NAMES[size]
            )


def _by_size(part: pd.DataFrame) -> Iterator[tuple[float, pd.DataFrame]]:
    for size in sorted(part["size"].unique()):
        yield float(size), part[part["size"] == size]


def _target(
    figure: str, cases: str, part: pd.DataFrame, yes: pd.Series, least: float, most: float
) -> Target:
    """Share of the campaigns of which `yes` is true, with the range that it should be in."""
    if least == most:
        wanted = f"{most:.2f}"
    elif least == 0:
        wanted = f"≤ {most:g}"
    elif most == 1:
        wanted = f"≥ {least:.2f}"
    else:
        wanted = f"{(least + most) / 2:.2f} ± {(most - least) / 2:.2f}"
    return Target(wanted=wanted, least=least, most=most, **_share(figure, cases, part, yes))


def _oracle(
    figure: str, cases: str, part: pd.DataFrame, below: float, least: float | None = None
) -> Target:
    """Share of right answers, beside what the oracle has of the same campaigns.

    At least so many are wanted or, where that is None, so much less than the oracle has.
    """
    judged = part[part["oracle_right"].notna()]
    best = float(judged["oracle_right"].astype(bool).mean()) if len(judged) else np.nan
    said = f"oracle {best:.2f}" if least else f"oracle {best:.2f} − {below:.2f}"
    least = best - below if least is None else least
    wanted = f"≥ {least:.2f} ({said})" if len(judged) else "–"
    return Target(
        wanted=wanted, least=least, most=1, **_share(figure, cases, judged, judged["right"])
    )


def _middle(figure: str, cases: str, values: pd.Series, least: float) -> Target:
    """Median, with the interval between two order statistics that holds it in 95 % of all cases."""
    x = np.sort(values.to_numpy(float))
    n = len(x)
    k = int(binom.ppf(0.025, n, 0.5)) if n else 0
    ends = (float(x[k - 1]), float(x[n - k])) if k else (np.nan, np.nan)
    middle = float(np.median(x)) if n else np.nan
    return Target(
        wanted=f"≥ {least:.2f}", least=least, most=np.inf, **_row(figure, cases, middle, *ends, n)
    )


def _few_names(figure: str, cases: str, part: pd.DataFrame, most: float) -> Target:
    """Mean number of names, beside how many the oracle needs for the same campaigns."""
    x = part["set_names"].to_numpy(float)
    best = part["oracle_alternatives"].mean()
    spread = sigmas_95(len(x) - 1) * x.std(ddof=1) / np.sqrt(len(x)) if len(x) > 1 else np.nan
    wanted = f"≤ {number(most)} (oracle {best:.1f})"
    return Target(
        wanted=wanted, least=0, most=most, **_mean(figure, cases, part["set_names"], spread)
    )


SURER = (0.8, 0.85)
"""Posteriors above the one from which on a name is given."""


def further(judged: pd.DataFrame) -> pd.DataFrame:
    """Shares and means that explain the targets.

    Parameters
    ----------
    judged : DataFrame, of `studies.hidden.judging.judge`

    Returns
    -------
    DataFrame
        figure, cases, measured, ci95_low and ci95_high (NaN for means), n
    """
    columns = ["figure", "cases", "measured", "ci95_low", "ci95_high", "n"]
    rows = [*_of_one(judged), *_of_names(judged), *_of_others(judged)]
    return pd.DataFrame(rows, columns=columns)


def _of_one(judged: pd.DataFrame) -> Iterator[Row]:
    """One effect: sets beside those of the oracle, and names that are withheld."""
    one = judged[judged["set"] == "one"]
    for size, part in one.groupby("size"):
        cases = f"one effect, λ = {size:g}"
        given = part[part["set_given"].eq(True)]
        more = given["set_names"].astype(float) - given["oracle_alternatives"].astype(float)
        yield _mean("names in a 90 % set beyond the oracle's", cases, more)
        right = part[part["top_right"].eq(True)]
        withheld = right[right["right"].eq(False)]
        yield _share("right, and withheld", cases, right, right["right"].eq(False))
        many = withheld["set_explanations"].astype(float) > MANY
        yield _share(f"more than {MANY} explanations, of those withheld", cases, withheld, many)
        few = withheld[~many]
        noise = few["credible_set"].map(_has_noise)
        yield _share("noise in the set, of the others withheld", cases, few, noise)


def _of_names(judged: pd.DataFrame) -> Iterator[Row]:
    """One and two effects: names that are given, and wrong."""
    named = judged[judged["set"].isin(["one", "two"]) & (judged["verdict"] == "named")]
    stated = named["top_posterior"].astype(float)
    yield _mean("named, and wrong, as the posteriors expect", "one and two effects", 1 - stated)
    for least in SURER:
        part = named[stated >= least]
        yield _share("named, and wrong", f"posterior from {least:g} on", part, part["wrong"])
    single = pd.Series([len(json.loads(names)) == 1 for names in named["found"]], named.index, bool)
    wrong = named[(named["set"] == "one") & named["wrong"].eq(True) & single]
    yield _share("the oracle wrong, too", "one effect, a wrong single name", wrong,
                 wrong["oracle_right"].eq(False))  # fmt: skip
    for size, part in judged[judged["set"] == "two"].groupby("size"):
        cases = f"two effects, λ = {size:g} each"
        yield _share("one of the two alone", cases, part, part["one_of_two"])


def _of_others(judged: pd.DataFrame) -> Iterator[Row]:
    """Physics that the diagnosis does not know, and names where nothing is missing."""
    large = plain(judged)
    outside = large[large["set"] == "outside"]
    without = outside[outside["has_place"].eq(False)]
    kinds = {
        "outside the catalogue, all": outside,
        "outside the catalogue, without a place": without,
    }
    for cases, part in kinds.items():
        cases = f"{cases}, {UNNAMED}"
        yield _share("named or narrowed wrongly", cases, part, part["wrong"])
        yield _share("learned", cases, part, part["learned"])
    can = [json.dumps([one, target]) for target, names in LEARNABLE.items() for one in names]
    placed = outside[outside["has_place"].eq(True)]
    placed = placed[placed["true_place"].isin(can)]
    cases = f"outside the catalogue, a place that can be learned, {UNNAMED}"
    yield _share("named or narrowed wrongly", cases, placed, placed["wrong"])
    for figure in ("place_right", "place_wrong"):
        yield _share(words(figure), cases, placed, placed[figure])
    later = large[large["set"] == "unforeseen"]
    placed = later[later["has_place"].eq(True)]
    for figure in ("place_right", "place_wrong"):
        cases = f"unforeseen, with a place, {UNNAMED}"
        yield _share(words(figure), cases, placed, placed[figure])
    for name, cases in (("unforeseen", "unforeseen"), ("removed", "family taken out")):
        wrong = large[(large["set"] == name) & large["wrong"].eq(True)]
        cases = f"{cases}, {UNNAMED}"
        yield _share("confirmed, of those wrong", cases, wrong, wrong["confirmed"])
    null = judged[(judged["set"] == "null") & judged["confirmed"].eq(True)]
    blind = (null["approach"] == "gravity") & (null["sigma"] == "not given")
    yield _share("by gravity alone, sigma not given", "nothing missing, confirmed", null, blind)


def _has_noise(credible_set: str) -> bool:
    """Whether an explanation of a set is the noise, or something that the catalogue lacks."""
    names = {name for one in json.loads(credible_set) for name in one["names"]}
    return bool(names - {*effect_names()})


def _share(figure: str, cases: str, part: pd.DataFrame, yes: pd.Series) -> Row:
    count, n = int(yes.astype(bool).sum()), len(part)
    low, high = clopper_pearson(count, n)
    return _row(figure, cases, count / n if n else np.nan, float(low), float(high), n)


def _mean(figure: str, cases: str, values: pd.Series, spread: float = np.nan) -> Row:
    mean = float(values.astype(float).mean()) if len(values) else np.nan
    return _row(figure, cases, mean, mean - spread, mean + spread, len(values))


def _row(figure: str, cases: str, measured: float, low: float, high: float, n: int) -> Row:
    return {"figure": figure, "cases": cases, "measured": measured, "ci95_low": low,
            "ci95_high": high, "n": n}  # fmt: skip
