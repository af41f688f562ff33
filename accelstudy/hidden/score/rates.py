"""Shares of campaigns with their intervals: by set, effect, size, design, approach and noise."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
import pandas as pd

from accelstudy.basics.shares import clopper_pearson

ALL = "all"
"""Value of a column by which a share is not divided."""
COLUMNS = ("set", "what", "size", "design", "approach", "sigma")
"""Columns by which campaigns are divided; a size of NaN stands for all sizes, or none."""
SPLITS: tuple[tuple[str, ...], ...] = (
    ("set",),
    ("set", "size"),
    ("set", "what"),
    ("set", "what", "size"),
    ("set", "sigma"),
    ("set", "size", "sigma"),
    ("set", "approach", "sigma"),
    ("set", "size", "approach", "sigma"),
    ("set", "design", "approach", "sigma"),
)
"""Divisions of the table of shares."""


def with_intervals(table: pd.DataFrame) -> pd.DataFrame:
    """Add the share and its 95 % interval to a table of `count` and `n`."""
    low, high = clopper_pearson(table["count"], table["n"])
    share = table["count"] / table["n"].where(table["n"] > 0)
    return table.assign(share=share, ci95_low=low, ci95_high=high)


Answers = Callable[[pd.DataFrame], pd.Series]
"""Yes, no or None for each campaign; None where the question does not arise."""


def _answer(name: str) -> Answers:
    return lambda judged: judged[name]


def _verdict(name: str) -> Answers:
    return lambda judged: judged["verdict"] == name


def _of(condition: Answers, answer: Answers) -> Answers:
    return lambda judged: answer(judged).astype(object).where(condition(judged).eq(True), None)


QUESTIONS: Mapping[str, Answers] = {
    "failed": lambda judged: ~judged["ok"].astype(bool),
    "alarm": _answer("alarm"),
    **{
        name: _verdict(name)
        for name in ("named", "narrowed", "unknown", "noise_model", "gross_error")
    },
    "answered": _answer("answered"),
    "right": _answer("right"),
    "wrong": _answer("wrong"),
    "one of two": _answer("one_of_two"),
    "recognised": _answer("recognised"),
    "confirmed": _answer("confirmed"),
    "wrong, of those named": _of(_verdict("named"), _answer("wrong")),
    "wrong, of those answered": _of(_answer("answered"), _answer("wrong")),
    "confirmed, of those answered": _of(_answer("answered"), _answer("confirmed")),
    "set holds the truth": _answer("set_holds"),
    "explanation right": _of(
        lambda judged: judged["oracle_right"].notna(), lambda judged: judged["top_right"].eq(True)
    ),
    "oracle found": _of(lambda judged: judged["oracle_right"].notna(), _answer("oracle_detected")),
    "oracle right": _answer("oracle_right"),
    "oracle right if told": _answer("told_right"),
}
"""What is asked of each campaign; *answered* is one that got names, `named` or `narrowed`."""


def shares(judged: pd.DataFrame, splits: Sequence[Sequence[str]] = SPLITS) -> pd.DataFrame:
    """Shares of the campaigns of which the answer to each of `QUESTIONS` is yes.

    Parameters
    ----------
    judged : DataFrame, of `accelstudy.hidden.score.judging.judge`
    splits : what the campaigns are divided by

    Returns
    -------
    DataFrame
        `COLUMNS`, quantity, count, n, share, ci95_low, ci95_high
    """
    asked = []
    for quantity, answers in QUESTIONS.items():
        yes = answers(judged)
        known = yes.notna()
        part = judged.loc[known, list(COLUMNS)]
        asked.append(part.assign(quantity=quantity, yes=yes[known].astype(bool)))
    table = pd.concat(asked, ignore_index=True)
    return with_intervals(
        pd.concat([_counted(table, [*split]) for split in splits], ignore_index=True)
    )


def _counted(table: pd.DataFrame, split: list[str]) -> pd.DataFrame:
    """Counts of a division, with `ALL` and NaN in the columns that it does not divide by."""
    groups = table.groupby([*split, "quantity"], sort=True)["yes"]
    counted = groups.agg(count="sum", n="size").reset_index()
    for name in COLUMNS:
        if name not in split:
            counted[name] = np.nan if name == "size" else ALL
    return counted[[*COLUMNS, "quantity", "count", "n"]]


def share_of(
    table: pd.DataFrame, quantity: str, set_: str, **division: str | float
) -> pd.Series | None:
    """Row of a table of shares; None where it has no campaign of that kind.

    Parameters
    ----------
    table : DataFrame, of `shares`
    quantity : str, one of `QUESTIONS`
    set_ : str
    division : values of those of `COLUMNS` by which the share is divided
    """
    found = (table["quantity"] == quantity) & (table["set"] == set_)
    for name in COLUMNS[1:]:
        if name in division:
            found &= table[name] == division[name]
        else:
            found &= table[name].isna() if name == "size" else table[name] == ALL
    return table[found].iloc[0] if found.any() else None
