"""How far simulated calibrations are from linear theory, which knows no bias and one variance."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import pandas as pd

    from accelstudy.study.config import Study

MIN_NONLINEAR_SHARE = 0.01
"""Share of the variance from which linear theory counts as off."""


def knows_all(study: Study) -> bool:
    """Whether calibrations know of all that is simulated, and linear theory with them."""
    return study.simulated_effects is None and not study.noise.effects


def beyond_linear_theory(cells: pd.DataFrame, summary: pd.DataFrame) -> pd.DataFrame:
    """Bias and excess of the variance of each parameter of each cell, with their uncertainties.

    Parameters
    ----------
    cells, summary : tables of a study

    Returns
    -------
    DataFrame
        Rows of `summary` with `bias` over the standard deviation, `excess` (the variance over that
        of linear theory, less 1), and `bias_half` and `excess_half`: half the width of intervals
        that hold all numbers of their column together with a probability of 95 %.
    """
    from scipy import special

    compared = (cells["control"] == "linear") & (cells["n_converged"] > 1)
    compared &= cells["gravity_error_mps2"] == 0
    rows = summary[summary["cell"].isin(cells["cell"][compared])]
    relative = (rows["sd_empirical"] / rows["sd_linear"]) ** 2
    errors = {
        "bias": rows["bias_se"] / rows["sd_empirical"],
        "excess": 2 * relative * rows["sd_se"] / rows["sd_empirical"],
    }
    rows = rows.assign(bias=rows["bias"] / rows["sd_empirical"], excess=relative - 1)
    known = np.isfinite(errors["bias"]) & np.isfinite(errors["excess"])
    both_tails = 0.05 / max(int(known.sum()), 1)
    sigmas = special.stdtrit(rows["n_converged"] - 1, 1 - both_tails / 2)
    halves = {f"{name}_half": sigmas * error for name, error in errors.items()}
    return rows.assign(**halves)[known]


def noise_when_off(noise: Any, excess: Any) -> Any:
    """Noise from which linear theory is off: the excess grows with the square of the noise.

    All other noise grows in proportion. It is infinite where there is no excess.
    """
    with np.errstate(divide="ignore"):
        return noise * np.sqrt(MIN_NONLINEAR_SHARE / np.asarray(excess))
