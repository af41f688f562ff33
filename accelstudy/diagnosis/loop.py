"""Closing the loop: whether a simulation with the named effect contains the measurement.

Sessions of the campaign's own positions, holds and noise are simulated with the base model as it
was fitted (the old simulation) and with the extended one (the new simulation), and calibrated. The
right simulation contains the variance of unit weight of the measurement.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from accelstudy.adjustment import Adjustment, Observations, calibrate
from accelstudy.adjustment.quality import Solution
from accelstudy.basics.progress import track
from accelstudy.basics.units import MGON
from accelstudy.diagnosis.consequences import forces_in_use
from accelstudy.diagnosis.result import Diagnosis
from accelstudy.effects import HoldConditions
from accelstudy.leveling.error import leveling_error
from accelstudy.simulation.sessions import Noise, session, with_angle_errors

Array = NDArray[np.float64]

REPLICATES = 1000
CASES = (("old", "base"), ("new", "base"), ("new", "extended"))
"""Each simulation with a model by which it is calibrated."""
COLUMNS = [
    *("simulation", "calibration", "replicate"),
    *("sigma0_squared", "tilt_error_rad", "converged"),
]
MAX_POSITIONS = 500_000
"""Most positions in all sessions of a simulation together; they are drawn at once."""
MIN_SESSIONS = 100
"""Least number of sessions of a simulation, however many positions they have."""


@dataclass(frozen=True)
class Loop:
    """Simulated sessions beside the measured one.

    Attributes
    ----------
    sessions : DataFrame, one row per simulated and calibrated session: simulation ("old", "new"),
        calibration ("base", "extended"), replicate, sigma0_squared, tilt_error_rad (rms of roll and
        pitch that the calibration leaves of the simulated sensor) and converged
    measured : dict of calibration to the variance of unit weight of the measurement
    """

    sessions: pd.DataFrame
    measured: dict[str, float]

    def case(self, simulation: str, calibration: str) -> pd.DataFrame:
        """Sessions of one simulation and one calibration that converged to a variance."""
        s = self.sessions
        chosen = (s["simulation"] == simulation) & (s["calibration"] == calibration)
        return s[chosen & s["converged"] & _comparable(s["sigma0_squared"])]

    @property
    def document(self) -> dict[str, Any]:
        """Plain data for `diagnosis.json`; tilt errors are rms over the sessions."""
        cases = []
        for simulation, calibration in CASES:
            case = self.case(simulation, calibration)
            low, high = np.quantile(case["sigma0_squared"], [0.025, 0.975]).tolist()
            cases.append(
                {
                    "simulation": simulation,
                    "calibration": calibration,
                    "sigma0_squared_central95": [low, high],
                    "contains_measurement": low <= self.measured[calibration] <= high,
                    "tilt_rms_mgon": float(np.sqrt(np.mean(case["tilt_error_rad"] ** 2))) / MGON,
                }
            )
        replicates = int(self.sessions["replicate"].max()) + 1
        return {"replicates": replicates, "measured_sigma0_squared": self.measured, "cases": cases}


def close_loop(diagnosis: Diagnosis, replicates: int = REPLICATES, seed: int = 1) -> Loop | None:
    """Simulate the campaign with the base and with the extended model, and calibrate.

    Parameters
    ----------
    diagnosis : Diagnosis
    replicates : int, sessions of each simulation, limited by `MAX_POSITIONS`, but to `MIN_SESSIONS`
    seed : int

    Returns
    -------
    Loop; None if the diagnosis did not extend the model, so that there is nothing to compare, if
    readings of the extended sensor, which clips, have no tilt, or if the measurement or all
    simulated sessions of a kind have no solution.
    """
    d = diagnosis
    if d.extended_model is d.model or d.leveling is None:
        return None
    fits, hold = {"base": d.base, "extended": d.final.solution}, d.frame.hold
    kept = np.flatnonzero(d.used_positions)
    noise = Noise(
        sigma_force=d.sigma_position,
        sigma_angle=d.campaign.sigma_angle or 0.0,
        sigma_gravity=d.campaign.sigma_gravity,
    )
    # The measurement is weighted like the simulations, or the variances could not be compared.
    taken = replace(d.base.observed.take(kept), sigma_force=noise.sigma_force)
    measured = {
        name: float(_calibrated(fit, taken).variance_posteriori[0]) for name, fit in fits.items()
    }
    if not _comparable(list(measured.values())).all():
        return None
    n = d.campaign.n_positions
    replicates = min(replicates, max(MIN_SESSIONS, MAX_POSITIONS // n))
    tables = []
    for stream, simulation in enumerate(("old", "new")):
        simulated = fits["base" if simulation == "old" else "extended"]
        p = simulated.parameters[: simulated.model.n_parameters]
        f_b = simulated.model.correct(d.campaign.forces, p, simulated.gravity, hold)
        if np.isnan(f_b).any():
            return None
        directions = -f_b / np.linalg.norm(f_b, axis=1, keepdims=True)
        ideal = session(simulated.model, p, directions, simulated.gravity, hold)
        rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(stream,)))
        size = max(1, MAX_POSITIONS // n)
        for first in track(range(0, replicates, size), f"{simulation} simulation"):
            numbers = np.arange(first, min(first + size, replicates))
            drawn = ideal.draw(noise, len(numbers), rng)
            drawn = with_angle_errors(ideal, drawn, taken.angle_errors, rng).take(kept)
            for calibration in (c for s, c in CASES if s == simulation):
                table = _session_table(simulated, fits[calibration], drawn, hold)
                if table is None:
                    return None
                table = table.assign(simulation=simulation, calibration=calibration)
                tables.append(table.assign(replicate=numbers)[COLUMNS])
    loop = Loop(pd.concat(tables, ignore_index=True), measured)
    return loop if all(len(loop.case(*case)) for case in CASES) else None


def _comparable(variances: ArrayLike) -> NDArray[np.bool_]:
    """Which variances of unit weight can be compared: a fit without residuals has none."""
    values = np.asarray(variances, dtype=float)
    return np.isfinite(values) & (values > 0)


def _session_table(
    simulated: Solution, estimated: Solution, observed: Observations, hold: HoldConditions
) -> pd.DataFrame | None:
    """Calibrate simulated sessions; None if readings that were corrected so have no tilt."""
    result, g = _calibrated(estimated, observed), simulated.gravity
    truth = simulated.parameters[: simulated.model.n_parameters]
    estimates = result.parameters[result.converged, : estimated.model.n_parameters]
    f_b, used = forces_in_use(hold, g)
    error = leveling_error(simulated.model, truth, estimated.model, estimates, f_b, g, used)
    tilt = np.full(len(result.converged), np.nan)
    tilt[result.converged] = np.sqrt(np.mean(error.per_replicate**2, axis=1))
    if np.isnan(tilt[result.converged]).any():
        return None
    return pd.DataFrame(
        {
            "sigma0_squared": result.variance_posteriori,
            "tilt_error_rad": tilt,
            "converged": result.converged,
        }
    )


def _calibrated(fit: Solution, observed: Observations) -> Adjustment:
    """Calibrate sessions with the model of a fit, from its estimates on."""
    initial = fit.parameters[: fit.model.n_parameters]
    return calibrate(fit.model, fit.approach, replace(observed, initial=initial))
