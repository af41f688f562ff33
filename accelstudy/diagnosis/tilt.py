"""What a missing effect is worth: the tilt error of a calibrated sensor without and with it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from accelstudy.adjustment.quality import Solution
from accelstudy.effects import Hold
from accelstudy.leveling import jacobian, roll_pitch
from accelstudy.leveling_error import cap_forces
from accelstudy.units import GON

Array = NDArray[np.float64]

MAX_TILT = 50 * GON
ATTITUDES = 200


def leveling_rms(
    base: Solution, extended: Solution, hold: Hold, variance: float
) -> tuple[float, float]:
    """Rms of roll and pitch, rad, that either calibration leaves if the extended model is right.

    It is taken over all tilts up to 50 gon and over the temperatures, times and changes of position
    of the campaign. The noise of the leveled reading itself is not in it, and neither is what
    belongs to the rig, which is not there when the sensor is used.

    Parameters
    ----------
    base, extended : Solution
    hold : Hold, of the campaign
    variance : float, of unit weight
    """
    g = extended.gravity
    f_b = cap_forces(MAX_TILT, ATTITUDES, g)
    roll, pitch = roll_pitch(tuple(f_b.T))
    n = base.observed.forces.shape[1]
    used = replace(hold.take(np.arange(ATTITUDES) % n), roll=roll, pitch=pitch)
    truth = extended.parameters[: extended.model.n_parameters].copy()
    in_use = np.array(
        [effect.part == "sensor" for effect in extended.model.effects for _ in effect.parameters]
    )
    truth[~in_use] = 0.0
    output = extended.model.sense(f_b, truth, g, used)

    squares = []
    for solution in (base, extended):
        model = solution.model
        p = solution.parameters[: model.n_parameters].copy()
        stays = np.ones(len(p), dtype=bool)
        if solution is extended:
            p, stays = truth, in_use
        corrected = model.correct(output, p, g, used)
        offset = np.column_stack(roll_pitch(tuple(corrected.T))) - np.column_stack([roll, pitch])
        offset = (offset + np.pi) % (2 * np.pi) - np.pi
        slope = jacobian(corrected) @ model.correction_jacobian(output, p, g, used)
        slope = slope[..., stays]
        cofactors = solution.cofactors[: len(p), : len(p)][np.ix_(stays, stays)]
        formal = variance * np.einsum("kau,uv,kav->ka", slope, cofactors, slope)
        squares.append(float(np.mean(offset**2 + formal)))
    return float(np.sqrt(squares[0])), float(np.sqrt(squares[1]))
