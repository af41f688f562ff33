"""What a missing effect did to the other parameters: as theory predicts, and as the refit shows.

An effect with the signature S (whitened, by its parameters p) that a model with the design Ã lacks
shifts the estimates of the model by −(ÃᵀÃ)⁻¹ Ãᵀ S p (omitted-variable bias). With the effect added
they shift back: by as much, if first order is enough and the extended model is right.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from accelstudy.adjustment.quality import Solution
from accelstudy.diagnosis.space.frame import Frame
from accelstudy.diagnosis.space.residuals import Residuals
from accelstudy.diagnosis.space.signatures import signature
from accelstudy.effects import Effect

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Change:
    """Change of a parameter of the base model by the effects that were added, SI.

    Attributes
    ----------
    parameter, unit : str
    before, after : float, estimates without and with the effects
    predicted : float, of after − before
    sigma : float, of after − before
    """

    parameter: str
    unit: str
    before: float
    after: float
    predicted: float
    sigma: float

    @property
    def estimated(self) -> float:
        """After − before."""
        return self.after - self.before


def parameter_changes(
    base: Solution, final: Solution, frame: Frame, effects: Sequence[Effect], variance: float
) -> tuple[Change, ...]:
    """Predict and show the changes of the parameters of the base model.

    Parameters
    ----------
    base, final : Solution, without and with the effects, of the same positions
    frame : Frame, of the base model, in which the effects are evaluated
    effects : those that were added, after the parameters of the base model
    variance : float, of unit weight
    """
    u, residuals = base.model.n_parameters, Residuals.of(base)
    shown = [signature(e, frame.sensed, frame.angles, base.gravity, frame.hold) for e in effects]
    rows = np.concatenate([residuals.whitened(one) for one in shown], axis=1)
    shift = np.linalg.lstsq(base.design, rows, rcond=None)[0][:u]
    added = slice(u, u + rows.shape[1])
    predicted = shift @ final.parameters[added]
    # By the same theory the noise of the effect's size is all that makes the change uncertain.
    spread = np.einsum("ik,kl,il->i", shift, final.cofactors[added, added], shift)
    sigma = np.sqrt(variance * spread)
    return tuple(
        Change(
            parameter=parameter.name,
            unit=parameter.unit,
            before=float(base.parameters[i]),
            after=float(final.parameters[i]),
            predicted=float(predicted[i]),
            sigma=float(sigma[i]),
        )
        for i, parameter in enumerate(base.model.parameters)
    )
