"""A score: what its YAML asks of judged campaigns, as a page in Markdown.

Each question is put to some campaigns: to those of a `set` for which `filter` holds, for the share
for which `of` does, or another `statistic` of it. Both are expressions over the columns of `judge`.
`score.yaml` has the questions of the study of hidden effects, `real.yaml` those of the one with
real noise.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import yaml
from numpy.typing import NDArray
from scipy.stats import binom, binomtest

from accelstudy.basics.shares import sigmas_95
from accelstudy.basics.wording import words
from studies.hidden.study import Row

SCORES = {name: yaml.safe_load(Path(__file__).with_name(f"{name}.yaml").read_text("utf-8"))
          for name in ("score", "real")}  # fmt: skip
SETS: Mapping[Any, str] = SCORES["score"]["sets"]
Question = Mapping[str, Any] | str


class Measurement(NamedTuple):
    """What was measured of some campaigns, its 95 % interval, and the number of them."""

    value: float
    low: float
    high: float
    n: int
    statistic: str

    @property
    def text(self) -> str:
        """Write it as a share, mean or median, or as its n, count, or count of n."""
        count = f"{self.value * self.n:.0f}" if self.n else "0"
        of = f"{count} of {self.n}" if self.n else "–"
        texts = {"n": str(self.n), "count": count, "of": of}
        return texts.get(self.statistic, share_text(self.value))

    @property
    def interval(self) -> str:
        """Write the interval."""
        ends = [*map(share_text, (self.low, self.high))]
        return "" if not self.n else "–" if "–" in ends else " … ".join(ends)


def chosen(rows: pd.DataFrame, question: Mapping[str, Any]) -> pd.DataFrame:
    """The campaigns that a question is put to."""
    if "set" in question:
        rows = rows[rows["set"] == question["set"]]
    return rows.query(question["filter"], engine="python") if "filter" in question else rows


def measure(rows: pd.DataFrame, question: Question) -> Measurement:
    """Put a question, or the name of a column, to campaigns."""
    question = {"of": question} if isinstance(question, str) else question
    rows = chosen(rows, question)
    values: Any = rows.eval(question["of"], engine="python") if len(rows) else []
    x = np.sort(np.array(values, dtype=float))
    return statistic(x[~np.isnan(x)], question.get("statistic", "share"))


def statistic(x: NDArray[np.float64], name: str) -> Measurement:
    """Share, mean or median of sorted values; a mean that is `expected` has no interval."""
    n, low, high = len(x), np.nan, np.nan
    if name in ("mean", "expected", "median") and n:
        value = float(np.median(x) if name == "median" else x.mean())
        if name == "mean" and n > 1:
            spread = sigmas_95(n - 1) * x.std(ddof=1) / np.sqrt(n)
            low, high = value - spread, value + spread
        # The interval of a median is between two order statistics.
        if name == "median" and (k := int(binom.ppf(0.025, n, 0.5))):
            low, high = x[k - 1], x[n - k]
        return Measurement(value, low, high, n, name)
    if not n:
        return Measurement(np.nan, 0.0, 1.0, n, name)
    low, high = binomtest(int(x.sum()), n).proportion_ci()
    return Measurement(float(x.sum() / n), low, high, n, name)


# --- text -----------------------------------------------------------------------------------------


def share_text(value: float) -> str:
    """Write a share to two digits, or three decimals."""
    return "–" if np.isnan(value) else f"{value:.3f}" if value < 0.0995 else f"{value:.2f}"


def label(value: Any) -> str:
    """Write a cell that is no share: a name, or lists of names."""
    if isinstance(value, list):
        value = " + ".join(one if isinstance(one, str) else " = ".join(one) for one in value)
    text = str(value or "–")
    return text if "/" in text else words(text)  # what identifies a campaign stays as it is


# --- tables ---------------------------------------------------------------------------------------


def table(section: Mapping[str, Any], frames: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """A table of a page as text: targets, a list of campaigns, or answers by groups of them."""
    rows = chosen(frames[section.get("frame", "campaigns")], section)
    if "targets" in section:
        lines = [row for line in section["targets"] for row in target_rows(line, rows)]
        kept = pd.DataFrame(lines)
        return kept if kept["target"].any() else kept.drop(columns=["target", "met"])
    if "list" in section:
        columns = section["list"].items()
        return pd.DataFrame({head: rows[column].map(label) for head, column in columns})
    heads, lines = [*section["by"]], []
    for key, part in rows.groupby([*section["by"].values()], observed=True):
        cells = [f"{one:g}" if isinstance(one, float) else label(SETS.get(one, one)) for one in key]
        answers = {head: measure(part, one).text for head, one in section["columns"].items()}
        lines.append(dict(zip(heads, cells, strict=True)) | answers)
    return pd.DataFrame(lines)


def target_rows(line: Mapping[str, Any], rows: pd.DataFrame) -> Iterator[Row]:
    """Rows of a target: one, or one for each λ; bounds that are of some λ leave out the others."""
    of_set = rows[rows["set"] == line["set"]] if "set" in line else rows
    for size, of_size in of_set.groupby("size") if "each" in line else [(np.nan, of_set)]:
        asked, measured = chosen(of_size, line), measure(of_size, line)
        fewest, oracle, target, met = line.get("n", 0), "", "", ""
        least, most = (
            bound.get(size) if isinstance(bound, dict) else bound
            for bound in (line.get("least"), line.get("most"))
        )
        if "beside" in line:
            oracle = f" (oracle {asked[line['beside']].mean():.1f})"
        elif "below_oracle" in line:
            best, below = asked["oracle_right"].mean(), line["below_oracle"]
            oracle = f" (oracle {best:.2f})" if least else f" (oracle {best:.2f} − {below:.2f})"
            least = least or best - below
        if least is not None or most is not None:
            target = bounds_text(least, most, oracle) + (f", n ≥ {fewest}" if fewest else "")
            highest = np.inf if most is None else most
            within = (least or 0) - 1e-9 <= measured.value <= highest + 1e-9
            met = "yes" if within and measured.n >= fewest else "no"
            if np.isnan(measured.value):
                target, met = "–" if oracle else target, "–"
        elif {"least", "most"} & line.keys():
            continue
        yield {
            **{"figure": line["figure"], "campaigns": line["campaigns"].format(size=size)},
            **{"target": target, "measured": measured.text},
            **{"95 % interval": measured.interval, "n": measured.n, "met": met},
        }


def bounds_text(least: float | None, most: float | None, oracle: str) -> str:
    """Write what is wanted."""
    if least is None or most is None:
        digits = "g" if not oracle and least is None else ".2f"
        return f"≥ {least:.2f}{oracle}" if most is None else f"≤ {most:{digits}}{oracle}"
    if least == most:
        return f"{most:.2f}"
    return f"{(least + most) / 2:.2f} ± {(most - least) / 2:.2f}"
