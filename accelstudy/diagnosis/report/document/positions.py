"""What a diagnosis says of each position: the content of `positions.parquet`."""

from __future__ import annotations

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from accelstudy.adjustment.quality import Solution, position_tests
from accelstudy.basics.units import GON
from accelstudy.diagnosis.result import Diagnosis

Array = NDArray[np.float64]


def positions_table(diagnosis: Diagnosis) -> pd.DataFrame:
    """One row per position, in SI unless the name of a column says otherwise.

    Columns
    -------
    position, time_s, roll_gon, pitch_gon, temperature_degC : what was measured; NaN if it was not
    split : "fit", "held-out", or "left out" of the final fit as bumped
    residual_*_before_mps2, residual_*_after_mps2 : what the readings lack of the conditions, by the
        base fit and by the final one: the output less that in the robot's attitude, or the norm
        of f_b less gravity
    test_before, test_after : root of the test statistic of a gross error in the position, over the
        noise level that the diagnosis takes; signed where the position has one condition
    p_before, p_after : p-values of these tests, of each position by itself
    predicted_before_mps2, predicted_after_mps2 : of held-out positions, rms of the residuals by
        the fits to the other positions, without and with the effects that were found
    """
    d = diagnosis
    campaign, solution = d.campaign, d.final.frame.solution
    n = campaign.n_positions
    kept = d.kept
    held = np.zeros(n, dtype=bool)
    if d.gap.held_out is not None:
        held[list(d.gap.held_out.held)] = True

    def column(values: Array | None) -> Array:
        return np.full(n, np.nan) if values is None else values

    angles = d.examined.frame.angles
    table = {
        "position": campaign.positions,
        "time_s": column(campaign.time),
        "roll_gon": angles[:, 0] / GON,
        "pitch_gon": angles[:, 1] / GON,
        "temperature_degC": column(campaign.temperature),
        "split": np.where(held, "held-out", np.where(kept, "fit", "left out")),
    }
    for when, fitted, rows in (
        ("before", d.base, np.ones(n, dtype=bool)),
        ("after", solution, kept),
    ):
        names = ("norm",) if fitted.misclosures.shape[1] == 1 else ("x", "y", "z")
        for name, values in zip(names, fitted.misclosures.T, strict=True):
            table[f"residual_{name}_{when}_mps2"] = _placed(values, rows)
    for when, fitted, rows in (
        ("before", d.base, np.ones(n, dtype=bool)),
        ("after", solution, kept),
    ):
        tests = position_tests(fitted)
        table[f"test_{when}"] = _placed(tests.w / np.sqrt(d.unit_variance), rows)
        table[f"p_{when}"] = _placed(tests.p_known if d.sigma_holds else tests.p_unknown, rows)
    missed = ((), ()) if d.gap.held_out is None else d.gap.held_out.misses
    for when, values in zip(("before", "after"), missed, strict=True):
        table[f"predicted_{when}_mps2"] = _placed(np.array(values), held)
    return pd.DataFrame(table)


def condition_sigma(solution: Solution, variance: float) -> float:
    """Noise of a residual, m/s²: rms over positions and conditions, without that of parameters."""
    covariance = solution.whitening @ np.swapaxes(solution.whitening, 1, 2)
    return float(np.sqrt(variance * np.mean(np.einsum("ncc->nc", covariance))))


def _placed(values: Array, rows: NDArray[np.bool_]) -> Array:
    placed = np.full(len(rows), np.nan)
    placed[rows] = values
    return placed
