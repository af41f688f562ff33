"""Tables of simulated sessions, in SI."""

from __future__ import annotations

import pandas as pd

from accelstudy.basics.progress import track
from accelstudy.sequential.simulated.config import SequentialConfig
from accelstudy.sequential.simulated.sessions import SetUp, simulate
from accelstudy.sequential.simulated.summary import identity, summarise


def set_ups(config: SequentialConfig, approach: str) -> list[SetUp]:
    """Set-ups of an approach."""
    pairs = [(rule, multiple) for rule in config.rules for multiple in config.accuracies]
    return [SetUp(config, approach, rule, multiple) for rule, multiple in pairs]


def sessions_table(config: SequentialConfig, approach: str, seed: int) -> pd.DataFrame:
    """All sessions of an approach, one row each: the columns of `simulate` and its set-up."""
    parts = []
    for one in track(set_ups(config, approach), "sessions"):
        parts.append(simulate(one, seed).assign(**identity(one)))
    return pd.concat(parts, ignore_index=True)


def summary_table(config: SequentialConfig, sessions: pd.DataFrame) -> pd.DataFrame:
    """One row for each set-up, with the columns of `summarise`."""
    rows = []
    for approach in config.approaches:
        for one in set_ups(config, approach):
            chosen = (
                (sessions["approach"] == one.approach)
                & (sessions["rule"] == one.rule)
                & (sessions["multiple"] == one.multiple)
            )
            rows.append(summarise(one, sessions[chosen]))
    return pd.DataFrame(rows)
