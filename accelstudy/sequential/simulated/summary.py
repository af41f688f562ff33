"""Results of simulated sessions, set-up by set-up."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from accelstudy.basics.shares import clopper_pearson, sigmas_95
from accelstudy.schemes import get_scheme
from accelstudy.sequential.simulated.sessions import SetUp

ROUNDING = 1e-9
CENTRAL = (0.05, 0.5, 0.95)


def identity(set_up: SetUp) -> dict[str, Any]:
    """Columns that identify the set-up of a row."""
    return {
        "approach": set_up.approach,
        "rule": set_up.rule,
        "multiple": set_up.multiple,
        "promised": set_up.promise.accuracy,
        "tilt_range": set_up.promise.tilt_range,
    }


def summarise(set_up: SetUp, sessions: pd.DataFrame) -> dict[str, Any]:
    """One row of the table: angles in rad, times in s, intervals of 95 %.

    `broken` is the share of sessions that stopped although, by the true noise, roll or pitch was
    not yet as accurate as promised. `rms` is over all sessions and attitudes, relative to the
    promise.
    """
    n, promised = len(sessions), set_up.promise.accuracy
    positions = sessions["positions"].to_numpy(dtype=float)
    true = sessions[["true_roll", "true_pitch"]].to_numpy().max(axis=1)
    broken = int(np.count_nonzero(sessions["kept"] & (true > promised * (1 + ROUNDING))))
    low, high = clopper_pearson(broken, n)
    actual = (sessions[["actual_roll", "actual_pitch"]].to_numpy() / promised) ** 2
    # How often the fixed scheme must be measured in full for the same accuracy.
    rounds = int(np.ceil(round(set_up.multiple**-2, 9)))
    fixed = rounds * get_scheme(set_up.config.instead_of).n_positions
    row: dict[str, Any] = {
        **identity(set_up),
        "sessions": n,
        "kept": float(sessions["kept"].mean()),
        "positions": positions.mean(),
        **{f"positions_{int(100 * q)}": float(np.quantile(positions, q)) for q in CENTRAL},
        "fixed_positions": fixed,
        "saved_positions": fixed - positions.mean(),
        "saved_seconds": set_up.config.seconds * (fixed - positions.mean()),
        "broken": broken / n,
        "broken_low": float(low),
        "broken_high": float(high),
        "variance": float(np.mean(_variance(sessions))),
    }
    for i, angle in enumerate(("roll", "pitch")):
        mean, half = _mean(actual[:, i])
        row[f"rms_{angle}"] = np.sqrt(mean)
        row[f"rms_{angle}_low"] = np.sqrt(max(mean - half, 0.0))
        row[f"rms_{angle}_high"] = np.sqrt(mean + half)
    for what in ("parameters", "angles"):
        mean, half = _mean(sessions[f"{what}_inside"].to_numpy())
        row |= {f"{what}_inside": mean, f"{what}_inside_low": mean - half}
        row[f"{what}_inside_high"] = mean + half
    row["relinearised"] = sessions["passes"].sum() / max(1, sessions["updates"].sum())
    return row


def _variance(sessions: pd.DataFrame) -> pd.Series[float]:
    """Variance of unit weight a posteriori at the end, which stopping by it biases."""
    return sessions["omega"] / sessions["redundancy"].where(sessions["redundancy"] > 0)


def _mean(values: np.ndarray[Any, np.dtype[np.float64]]) -> tuple[float, float]:
    """Mean, and half the width of its interval."""
    half = sigmas_95(len(values) - 1) * np.std(values, ddof=1) / np.sqrt(len(values))
    return float(np.mean(values)), float(half)
