"""A check, by simulation, of the sigmas that an adjustment claims for a measured campaign."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
from scipy import stats

from accelstudy.adjustment import calibrate
from accelstudy.basics.errors import InputError
from accelstudy.basics.progress import track
from accelstudy.basics.units import display_unit, to_display
from accelstudy.campaign.calibration.fit import CampaignFit, campaign_noise
from accelstudy.simulation.sessions import BLOCK, session

AT_ONCE = 500_000
"""Positions of all sessions of a block together, at most."""


def check_sigmas(fit: CampaignFit, replicates: int = 2000, seed: int = 1) -> pd.DataFrame:
    """Simulate sessions with the positions, noise and parameters of a campaign, and calibrate them.

    If the campaign does not state its noise, the simulation takes the sigma a posteriori.

    Parameters
    ----------
    fit : CampaignFit
    replicates : int
    seed : int

    Returns
    -------
    DataFrame
        One row per parameter, in the units shown to people: parameter, unit, estimate, sigma (as
        claimed), sd_empirical with its 95 % interval, bias, ratio (sigma / sd_empirical),
        n_converged.

    Raises
    ------
    InputError
        If fewer than two simulated calibrations converge.
    """
    model, approach = fit.model, fit.approach
    noise = campaign_noise(fit.campaign)
    if not fit.trusts_sigma:
        noise = replace(noise, sigma_force=fit.sigma_position)
    directions = -fit.corrected
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    ideal = session(model, fit.parameters, directions, fit.gravity, fit.campaign.hold)
    estimates = []
    size = max(1, min(BLOCK, AT_ONCE // fit.campaign.n_positions))
    drawn = ideal.draw_blocks(
        noise,
        replicates,
        track(range(-(-replicates // size)), "simulated campaigns"),
        lambda block: np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(block,))),
        size,
    )
    for observed in drawn:
        result = calibrate(model, approach, replace(observed, initial=fit.parameters))
        estimates.append(result.parameters[result.converged, : model.n_parameters])
    errors = np.concatenate(estimates) - fit.parameters
    n = len(errors)
    if n < 2:
        raise InputError(
            f"{fit.campaign.name}: {n} of {replicates} simulated calibrations converge: no sigma "
            "can be checked"
        )
    sd = errors.std(axis=0, ddof=1)
    low, high = (sd * np.sqrt((n - 1) / stats.chi2.ppf(p, n - 1)) for p in (0.975, 0.025))
    rows = []
    for i, parameter in enumerate(model.parameters):
        shown = {
            "estimate": fit.parameters[i],
            "sigma": fit.sigma[i],
            "sd_empirical": sd[i],
            "sd_ci95_low": low[i],
            "sd_ci95_high": high[i],
            "bias": errors[:, i].mean(),
        }
        rows.append(
            {
                "parameter": parameter.name,
                "unit": display_unit(parameter.unit),
                **{key: float(to_display(value, parameter.unit)) for key, value in shown.items()},
                "ratio": float(fit.sigma[i] / sd[i]),
                "n_converged": n,
            }
        )
    return pd.DataFrame(rows)
