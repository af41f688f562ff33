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
from accelstudy.diagnosis.space.frame import Frame
from accelstudy.diagnosis.space.residuals import Residuals
from accelstudy.effects import Effect, HoldConditions
from accelstudy.leveling.angles import angles_of, tilt_slope, wrapped
from accelstudy.leveling.error import ATTITUDES, MAX_TILT_GON, cap_forces, holds_in_use

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
    base: Solution, frame: Frame, effects: Sequence[Effect], final: Solution, variance: float
) -> tuple[Change, ...]:
    """Compare what added effects should change of the other parameters with what they do.

    Parameters
    ----------
    base, final : Solution, without and with the effects
    frame : Frame, of the fit in which the effects were found
    effects : that were added, in their order
    variance : float, of unit weight
    """
    u, residuals = base.model.n_parameters, Residuals.of(base)
    rows = np.concatenate([residuals.whitened(frame.signature(e)) for e in effects], axis=1)
    shift = np.linalg.lstsq(base.design, rows, rcond=None)[0][:u]
    added = slice(u, u + rows.shape[1])
    # By the same theory the noise of the effect's size is all that makes the change uncertain.
    spread = np.einsum("ik,kl,il->i", shift, final.cofactors[added, added], shift)
    before, after = base.parameters[:u], final.parameters[:u]
    columns = (before, after, shift @ final.parameters[added], after - before)
    rows_of = zip(*(c.tolist() for c in (*columns, np.sqrt(variance * spread))), strict=True)
    named = zip(base.model.parameters, rows_of, strict=True)
    return tuple(Change(p.name, p.unit, *values) for p, values in named)


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
    variance : float, of unit weight of the extended fit
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
        taken = variance * relative_variance(extended, solution)
        formal = taken * np.einsum("kau,uv,kav->ka", slope, cofactors, slope)
        squares.append(float(np.mean(offset**2 + formal)))
    if not np.all(np.isfinite(squares)):
        return None
    return float(np.sqrt(squares[0])), float(np.sqrt(squares[1]))
