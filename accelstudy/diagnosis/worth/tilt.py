"""What a missing effect is worth: the tilt error of a calibrated sensor without and with it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from accelstudy.adjustment.quality import Solution
from accelstudy.basics.units import GON
from accelstudy.effects import HoldConditions
from accelstudy.leveling.angles import angles_of, tilt_slope, wrapped
from accelstudy.leveling.error import ATTITUDES, MAX_TILT_GON, cap_forces, holds_in_use

Array = NDArray[np.float64]


def in_use(hold: HoldConditions, g: float) -> tuple[Array, HoldConditions]:
    """Specific forces (n, 3) of all tilts up to 50 gon, and holds like those of a campaign.

    Parameters
    ----------
    hold : HoldConditions, of the campaign, with the attitudes
    g : float, m/s²
    """
    f_b = cap_forces(MAX_TILT_GON * GON, ATTITUDES, g)
    return f_b, holds_in_use(hold, len(hold.column("roll")), f_b)


def leveling_rms(
    base: Solution, extended: Solution, hold: HoldConditions, variance: float
) -> tuple[float, float] | None:
    """Rms of roll and pitch, rad, that either calibration leaves if the extended model is right.

    None if readings of the extended sensor, which clips, have no tilt.

    It is taken over all tilts up to 50 gon and over the temperatures, times and changes of position
    of the campaign. The noise of the leveled reading is not included, nor are effects of the rig,
    which is absent when the sensor is used.

    Parameters
    ----------
    base, extended : Solution
    hold : HoldConditions, of the campaign
    variance : float, of unit weight
    """
    g = extended.gravity
    f_b, used = in_use(hold, g)
    angles = np.column_stack([used.column("roll"), used.column("pitch")])
    stays = extended.model.stays
    truth = np.where(stays, extended.parameters[: len(stays)], 0.0)
    output = extended.model.sense(f_b, truth, g, used)

    squares = []
    for solution in (base, extended):
        model = solution.model
        kept = model.stays
        p = np.where(kept, solution.parameters[: len(kept)], 0.0)
        corrected = model.correct(output, p, g, used)
        offset = wrapped(angles_of(corrected) - angles)
        slope = tilt_slope(model, p, output, corrected, g, used)[..., kept]
        cofactors = solution.cofactors[: len(p), : len(p)][np.ix_(kept, kept)]
        formal = variance * np.einsum("kau,uv,kav->ka", slope, cofactors, slope)
        squares.append(float(np.mean(offset**2 + formal)))
    if not np.all(np.isfinite(squares)):
        return None
    return float(np.sqrt(squares[0])), float(np.sqrt(squares[1]))
