"""Conditions of the next position, for effects that depend on more than the force."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from accelstudy.adjustment import Observations, whitened_jacobian
from accelstudy.approaches import Approach
from accelstudy.campaign.files.session import Campaign
from accelstudy.effects import HoldConditions
from accelstudy.effects.hold_conditions import REFERENCE_TEMPERATURE
from accelstudy.leveling.angles import angles_of, roll_pitch
from accelstudy.sensors.sensor import SensorModel
from accelstudy.simulation.sessions import Noise

Array = NDArray[np.float64]

INTERVAL = 60.0
"""s between two holds, until the session has two."""


def next_holds(campaign: Campaign, directions: Array) -> HoldConditions:
    """Conditions of each of k attitudes as the next position: those of the last, one hold later."""
    k, n = len(directions), campaign.n_positions
    last = campaign.hold.take(np.array([n - 1])) if n else HoldConditions()

    def goes_on(value: Array | None, usual: float) -> Array:
        return np.full(k, usual if value is None else float(value[0]))

    time = goes_on(last.time, 0.0)
    if campaign.time is not None and n > 1:
        time += np.median(np.diff(campaign.time))
    elif n:
        time += INTERVAL
    f_b = -campaign.gravity * directions
    step = f_b - campaign.forces[-1] if n else np.zeros_like(f_b)
    roll, pitch = roll_pitch(tuple(f_b.T))
    return HoldConditions(
        temperature=goes_on(last.temperature, REFERENCE_TEMPERATURE),
        time=time,
        vibration=goes_on(last.vibration, 0.0),
        roll=roll,
        pitch=pitch,
        yaw=goes_on(last.yaw, 0.0),
        step_x=step[:, 0],
        step_y=step[:, 1],
        step_z=step[:, 2],
        order=time if campaign.time is not None else np.full(k, n + 1.0),
        course=campaign.hold.take(np.arange(n)).course if n else None,
        full_range=campaign.full_range,
    )


def next_rows(
    campaign: Campaign, model: SensorModel, approach: Approach, noise: Noise, directions: Array
) -> Array:
    """Rows of the design matrix of each of k attitudes as the next position, (k, c, u')."""
    f_b, hold = -campaign.gravity * directions, next_holds(campaign, directions)
    observed = Observations(
        forces=f_b[None],  # of an ideal sensor, all of whose effects are zero
        sigma_force=noise.sigma_force,
        angles=angles_of(f_b)[None],
        sigma_angle=noise.sigma_angle,
        gravity=campaign.gravity,
        sigma_gravity=noise.sigma_gravity,
        hold=hold,
    )
    rows = whitened_jacobian(model, approach, observed, np.zeros(model.n_parameters))
    k, c = len(directions), approach.n_conditions
    return np.ascontiguousarray(rows[: c * k].reshape(c, k, -1).swapaxes(0, 1))
