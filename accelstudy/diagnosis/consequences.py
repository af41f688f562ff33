"""What it is worth to add an effect to a model: the tilt error of a sensor without and with it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from accelstudy.adjustment.quality import Solution
from accelstudy.basics.units import GON
from accelstudy.diagnosis.held_out import relative_variance
from accelstudy.effects import HoldConditions
from accelstudy.leveling.error import (
    ATTITUDES,
    MAX_TILT_GON,
    cap_forces,
    holds_in_use,
    tilt_error,
)


class TiltErrors(NamedTuple):
    """Rms of roll and pitch that calibrations leave, rad.

    Attributes
    ----------
    promised : float, by the base model, as a simulation with it finds
    before, after : float, by the base model and by the extended one if the extended one is right
    """

    promised: float
    before: float
    after: float


def tilt_errors(
    base: Solution, extended: Solution, hold: HoldConditions, variance: float
) -> TiltErrors | None:
    """Tilt errors of calibrations with the base and the extended model.

    None if readings of the extended sensor, which clips, have no tilt.

    They are taken over all tilts up to 50 gon and over the temperatures, times and changes of
    position of the campaign. The noise of the leveled reading is not included, nor are effects of
    the rig, which is absent when the sensor is used.

    Parameters
    ----------
    base, extended : Solution
    hold : HoldConditions, of the campaign
    variance : float, of unit weight of the extended fit
    """
    f_b = cap_forces(MAX_TILT_GON * GON, ATTITUDES, extended.gravity)
    used = holds_in_use(hold, len(hold.column("roll")), f_b)

    def rms(right: Solution, fit: Solution) -> float:
        truth, u = right.parameters[: right.model.n_parameters], fit.model.n_parameters
        own, g = fit.parameters[:u], extended.gravity
        error = tilt_error(right.model, truth, fit.model, own, f_b, g, used)
        cofactors = variance * relative_variance(extended, fit) * fit.cofactors[:u, :u]
        return float(np.sqrt(np.mean(error.rms_of_all(cofactors) ** 2)))

    errors = TiltErrors(rms(base, base), rms(extended, base), rms(extended, extended))
    return errors if np.isfinite(errors).all() else None
