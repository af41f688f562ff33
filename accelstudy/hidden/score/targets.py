"""The targets of the diagnosis, and what it achieves: one row for each."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pandas as pd

from accelstudy.basics.shares import clopper_pearson, sigmas_95
from accelstudy.basics.wording import number

LARGE = 150.0
"""λ from which on physics outside the catalogue must not get a name of the catalogue."""


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

    @property
    def met(self) -> str:
        """Return "yes", "no", or "–" if nothing was measured."""
        if np.isnan(self.measured):
            return "–"
        return "yes" if self.least - 1e-9 <= self.measured <= self.most + 1e-9 else "no"


def targets(judged: pd.DataFrame) -> pd.DataFrame:
    """All targets, in the order in which they are reported.

    Parameters
    ----------
    judged : DataFrame, of `accelstudy.hidden.score.judging.judge`

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
    yield _share("campaigns without an answer", "all", judged, ~judged["ok"].astype(bool), 0, 0)
    for sigma in ("given", "not given"):
        part = null[null["sigma"] == sigma]
        cases = f"nothing missing, sigma {sigma}"
        yield _share("false alarm", cases, part, part["alarm"], 0.04, 0.06)
    noise = of.get("noise", none)
    yield _share("named or narrowed to effects", "wrong noise only", noise, noise["answered"],
                 0, 0.03)  # fmt: skip
    yield from _names(one)
    named = judged[judged["set"].isin(["one", "two"]) & (judged["verdict"] == "named")]
    yield _share("named, and wrong", "one and two effects", named, named["wrong"], 0, 0.02)
    yield from _sets(one)
    for size, part in _by_size(two):
        yield _oracle("both of two right", f"two effects, λ = {size:g} each", part, 0.10)
    outside = judged[judged["set"].isin(["outside", "removed"]) & (judged["size"] >= LARGE)]
    for name, cases in (("outside", "never in the catalogue"), ("removed", "family taken out")):
        part = outside[outside["set"] == name]
        cases = f"{cases}, λ ≥ {LARGE:g}"
        yield _share("named or narrowed wrongly", cases, part, part["wrong"], 0, 0.03)
    yield _share("confirmed", "nothing missing", null, null["confirmed"], 0, 0.003)
    given = null[null["answered"].eq(True)]
    yield _share("confirmed, given a name", "nothing missing", given, given["confirmed"],
                 0.04, 0.06)  # fmt: skip
    gross = of.get("gross", none)
    yield _share("recognised", "gross errors", gross, gross["recognised"], 1, 1)


def _names(one: pd.DataFrame) -> Iterator[Target]:
    figure = "best name right, named or narrowed"
    for size, part in _by_size(one):
        yield _oracle(figure, f"one effect, λ = {size:g}", part, 0.03)
    yield _oracle(figure, "one effect, over all λ", one, 0.03)


MOST_NAMES = {25.0: 2.4, 40.0: 1.6, 60.0: 1.4}
"""Names in a set, on average, by λ."""


def _sets(one: pd.DataFrame) -> Iterator[Target]:
    given = one[one["set_given"].eq(True)]
    for size, part in _by_size(given):
        cases = f"one effect, λ = {size:g}"
        yield _share("90 % set holds the truth", cases, part, part["set_holds"], 0.90, 1)
    for size, part in _by_size(given):
        if size in MOST_NAMES:
            yield _mean("names in a 90 % set", f"one effect, λ = {size:g}", part, MOST_NAMES[size])


def _by_size(part: pd.DataFrame) -> Iterator[tuple[float, pd.DataFrame]]:
    for size in sorted(part["size"].unique()):
        yield float(size), part[part["size"] == size]


def _share(
    figure: str, cases: str, part: pd.DataFrame, yes: pd.Series, least: float, most: float
) -> Target:
    if least == most:
        wanted = f"{most:.2f}"
    elif least == 0:
        wanted = f"≤ {most:g}"
    elif most == 1:
        wanted = f"≥ {least:.2f}"
    else:
        wanted = f"{(least + most) / 2:.2f} ± {(most - least) / 2:.2f}"
    count, n = int(yes.astype(bool).sum()), len(part)
    low, high = clopper_pearson(count, n)
    measured = count / n if n else np.nan
    return Target(figure, cases, wanted, least, most, measured, float(low), float(high), n)


def _oracle(figure: str, cases: str, part: pd.DataFrame, below: float) -> Target:
    """Share of right answers, beside what the oracle has of the same campaigns."""
    known = part[part["oracle_right"].notna()]
    best = float(known["oracle_right"].astype(bool).mean()) if len(known) else np.nan
    wanted = f"≥ {best - below:.2f} (oracle {best:.2f} − {below:.2f})" if len(known) else "–"
    target = _share(figure, cases, known, known["right"], 0, 1)
    return Target(**{**vars(target), "wanted": wanted, "least": best - below})


def _mean(figure: str, cases: str, part: pd.DataFrame, most: float) -> Target:
    """Mean number of names, beside how many the oracle needs for the same campaigns."""
    x = part["set_names"].to_numpy(float)
    best = part["oracle_alternatives"].mean()
    spread = sigmas_95(len(x) - 1) * x.std(ddof=1) / np.sqrt(len(x)) if len(x) > 1 else np.nan
    mean = x.mean() if len(x) else np.nan
    wanted = f"≤ {number(most)} (oracle {best:.1f})"
    return Target(figure, cases, wanted, 0, most, mean, mean - spread, mean + spread, len(x))
