"""What follows from what was added to a model: what it changed, and what it is worth.

What it changed: an effect with the signature S (whitened, by its parameters p) that a model with
the design Ã lacks shifts the estimates of the model by −(ÃᵀÃ)⁻¹ Ãᵀ S p (omitted-variable bias).
With the effect added they shift back: by as much, if first order is enough and the extended model
is right.

What it is worth: the tilt error of a calibrated sensor without and with it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from accelstudy.adjustment.quality import Solution
from accelstudy.basics.units import GON
from accelstudy.diagnosis.prediction import relative_variance
from accelstudy.diagnosis.space.frame import SessionFit
from accelstudy.diagnosis.space.residuals import Residuals
from accelstudy.effects import Effect, HoldConditions
from accelstudy.leveling.error import (
    ATTITUDES,
    MAX_TILT_GON,
    cap_forces,
    holds_in_use,
    tilt_error,
)

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Change:
    """Change of a parameter of the base model by the effects that were added, SI.

    Attributes
    ----------
    parameter, unit : str
    before, after : float, estimates without and with the effects
    predicted, estimated : float, of after − before, by theory and by the fits
    sigma : float, of after − before
    """

    parameter: str
    unit: str
    before: float
    after: float
    predicted: float
    estimated: float
    sigma: float


def parameter_changes(
    base: Solution, frame: SessionFit, effects: Sequence[Effect], final: Solution, variance: float
) -> tuple[Change, ...]:
    """Compare what added effects should change of the other parameters with what they do.

    Parameters
    ----------
    base, final : Solution, without and with the effects
    frame : SessionFit, of the fit in which the effects were found
    effects : that were added, in their order
    variance : float, of unit weight
    """
    u, residuals = base.model.n_parameters, Residuals.of(base)
    rows = np.concatenate([residuals.whiten(frame.signatures((e,))) for e in effects], axis=1)
    shift = np.linalg.lstsq(base.design, rows, rcond=None)[0][:u]
    added = slice(u, u + rows.shape[1])
    # By the same theory the noise of the effect's size is all that makes the change uncertain.
    spread = np.einsum("ik,kl,il->i", shift, final.cofactors[added, added], shift)
    before, after = base.parameters[:u], final.parameters[:u]
    columns = (before, after, shift @ final.parameters[added], after - before)
    rows_of = zip(*(c.tolist() for c in (*columns, np.sqrt(variance * spread))), strict=True)
    named = zip(base.model.parameters, rows_of, strict=True)
    return tuple(Change(p.name, p.unit, *values) for p, values in named)


def forces_in_use(hold: HoldConditions, g: float) -> tuple[Array, HoldConditions]:
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
    variance : float, of unit weight of the extended fit
    """
    g, model = extended.gravity, extended.model
    f_b, used = forces_in_use(hold, g)
    truth = extended.parameters[: model.n_parameters]
    squares = []
    for one in (base, extended):
        u, taken = one.model.n_parameters, variance * relative_variance(extended, one)
        error = tilt_error(model, truth, one.model, one.parameters[:u], f_b, g, used)
        squares.append(np.mean(error.rms_of_all(taken * one.cofactors[:u, :u]) ** 2))
    before, after = np.sqrt(squares).tolist()
    return (before, after) if np.isfinite([before, after]).all() else None
