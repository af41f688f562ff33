"""A check, by simulation, of the sigmas that an adjustment claims for a measured campaign."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
from scipy import special

from accelstudy.adjustment import calibrate
from accelstudy.basics.errors import InputError
from accelstudy.basics.progress import track
from accelstudy.basics.units import display_unit, to_display
from accelstudy.campaign.calibration.campaign_fit import CampaignFit
from accelstudy.campaign.calibration.fit import campaign_noise
from accelstudy.simulation.sessions import BLOCK, session, with_angle_errors

AT_ONCE = 500_000
"""Positions of all sessions of a block together, at most."""


def check_sigmas(fit: CampaignFit, replicates: int = 2000, seed: int = 1) -> pd.DataFrame:
    """Simulate sessions with the positions, noise and parameters of a campaign, and calibrate them.

    The simulation has the noise that the sigmas are quoted from: the stated one if it is trusted,
    else that of the residuals, which scales forces and angles alike. So it finds sigmas that are
    wrong because the model is not linear within its errors, and none that are wrong because this
    noise is; see `wording.sentences`.

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
        If there are no sigmas, or fewer than two simulated calibrations converge.
    """
    model, approach = fit.model, fit.approach
    noise = campaign_noise(fit.campaign)
    if not np.isfinite(fit.sigma_position):
        raise InputError(
            f"{fit.campaign.name}: no noise is stated, and no redundancy tells it: there is no "
            "sigma to check"
        )
    scale = float(np.sqrt(fit.noise.variance))
    noise = replace(noise, sigma_force=fit.sigma_position, sigma_angle=scale * noise.sigma_angle)
    angle_errors = fit.solution.observed.angle_errors
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
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(0, 1)))
    for _, observed in drawn:
        observed = with_angle_errors(ideal, observed, angle_errors, rng, scale)
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
    low, high = (sd * np.sqrt((n - 1) / special.chdtri(n - 1, p)) for p in (0.025, 0.975))
    table = pd.DataFrame(
        {
            "estimate": fit.parameters,
            "sigma": fit.sigma,
            "sd_empirical": sd,
            "sd_ci95_low": low,
            "sd_ci95_high": high,
            "bias": errors.mean(axis=0),
        }
    )
    units = [parameter.unit for parameter in model.parameters]
    table = table.mul([float(to_display(1.0, unit)) for unit in units], axis=0)
    table.insert(0, "parameter", model.parameter_names)
    table.insert(1, "unit", [*map(display_unit, units)])
    return table.assign(ratio=fit.sigma / sd, n_converged=n)
