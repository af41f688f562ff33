"""The information of each position: its rows of the design matrix, and their normal matrix."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from accelstudy.adjustment import whitened_jacobian
from accelstudy.approaches import Approach
from accelstudy.basics.units import STANDARD_GRAVITY
from accelstudy.effects import HoldConditions
from accelstudy.sensors.sensor import SensorModel
from accelstudy.simulation.sessions import Noise, session

Array = NDArray[np.float64]


def position_rows(
    model: SensorModel,
    approach: Approach,
    noise: Noise,
    directions: ArrayLike,
    parameters: Array | None = None,
    gravity: float = STANDARD_GRAVITY,
    hold: HoldConditions | None = None,
) -> Array:
    """Rows of the design matrix that each position contributes, at unit weight.

    The normal matrix of any choice of positions is the sum of RᵀR over their rows R. Where
    effects depend on the position before, the order of the directions is that of the session.

    Parameters
    ----------
    model : SensorModel
    approach : Approach
    noise : Noise
        With `sigma_gravity` > 0 gravity is the last parameter. Its observation belongs to no
        position, so its weight 1/σ² is not in the rows.
    directions : (k, 3) array of unit vectors, gravity in the body frame
    parameters : (u,) array, SI, optional; the ideal sensor by default
    gravity : float, m/s²
    hold : HoldConditions, optional
        What else is known of the k positions.

    Returns
    -------
    (k, c, u') array, with the c conditions of the approach

    Raises
    ------
    InputError
        If the model needs what `hold` does not tell.
    """
    directions = np.asarray(directions, dtype=float)
    at = np.zeros(model.n_parameters) if parameters is None else np.asarray(parameters, float)
    ideal = session(model, at, directions, gravity, hold)
    rows = whitened_jacobian(model, approach, ideal.observations(noise), at)
    k, c = len(directions), approach.n_conditions
    return np.ascontiguousarray(rows[: c * k].reshape(c, k, -1).swapaxes(0, 1))


def information(rows: Array) -> Array:
    """Normal matrices RᵀR, (k, u, u), of the rows (k, c, u) of k positions."""
    return np.einsum("kcu,kcw->kuw", rows, rows)
