"""What a scheme can determine: rank, condition and linear theory, before any simulation."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from accelstudy.adjustment import whitened_jacobian
from accelstudy.adjustment.observations import Known
from accelstudy.approaches import Approach
from accelstudy.basics.units import STANDARD_GRAVITY
from accelstudy.design.information import rank_of
from accelstudy.effects import HoldConditions
from accelstudy.positions.points import evenly_spread
from accelstudy.positions.scheme import Scheme
from accelstudy.sensors.sensor import SensorModel
from accelstudy.simulation.hold_plan import HoldPlan
from accelstudy.simulation.sessions import Noise, session

Array = NDArray[np.float64]

ABOVE_NOISE = 3.0
"""How far a combination of parameters must show above what the noise of readings makes of it. Where
positions do not determine it, it shows by noise alone, at about 1 whatever the noise is."""
SUFFICIENT_POSITIONS = 60
"""Positions that determine whatever an approach can determine at all."""
EVERYTHING_VARIES = HoldPlan(60.0, (0.0, 40.0), "random", (0.0, 1.0), "random")


@dataclass(frozen=True)
class Estimability:
    """What one scheme determines of one model with one approach, by linear theory.

    Attributes
    ----------
    parameter_names : tuple of str
    rank : int, of the design matrix at the ideal sensor
    condition : float, of the design matrix with columns of unit length; inf if singular
    redundancy : int, r = conditions − unknowns
    not_estimable : tuple of str, parameters that the scheme cannot determine
    reason : str, why; empty if all is estimable
    cofactors : (u, u) array, Q_xx of linear theory at the given parameters; NaN if not estimable
    """

    parameter_names: tuple[str, ...]
    rank: int
    condition: float
    redundancy: int
    not_estimable: tuple[str, ...]
    reason: str
    cofactors: Array

    @property
    def estimable(self) -> bool:
        """Whether every parameter is determined."""
        return not self.not_estimable

    @property
    def sigma(self) -> Array:
        """Standard deviations of linear theory, (u,), SI."""
        return np.sqrt(np.diag(self.cofactors))


def estimability(
    scheme: Scheme,
    model: SensorModel,
    approach: Approach,
    noise: Noise | None = None,
    parameters: Array | None = None,
    gravity: float = STANDARD_GRAVITY,
    hold: HoldConditions | None = None,
    known: Known | None = None,
    forces: Array | None = None,
    blur: float = 0.0,
) -> Estimability:
    """Work out what a scheme determines, before any simulation.

    Rank and condition are those at the ideal sensor (all parameters zero): what is singular there
    is near-singular for every real sensor. The cofactors are taken at `parameters`.

    Noise gives any readings full rank. So by readings a combination of parameters counts as
    determined only if it shows by `ABOVE_NOISE` times what the noise adds to the design matrix.
    Without a `blur` the positions are exact, as in a study, whose simulation shows what noise does.

    Parameters
    ----------
    scheme : Scheme
    model : SensorModel
    approach : Approach
    noise : Noise, optional
    parameters : (u,) array, SI, optional; the ideal sensor by default
    gravity : float, m/s²
    hold : HoldConditions, optional
        What a session knows of its positions beyond their directions (temperature, time, …).
    known : mapping, optional, what is known of parameters a priori, as in `Observations`
    forces : (n, 3) array, m/s², optional
        Noisy readings in place of the directions, corrected up to a linear map: their lengths
        count, as unit vectors would have the sensor's errors in their directions.
    blur : float, m/s², noise of readings by which they are judged
    """
    noise, ideal = noise or Noise(), np.zeros(model.n_parameters)
    names = (*model.parameter_names, "g") if noise.sigma_gravity > 0 else model.parameter_names
    directions = scheme.directions if forces is None else -forces / gravity
    design = partial(_design, (model, approach, noise, gravity, hold, known or {}))
    a = design(directions, ideal)
    rank, condition, free = exact = rank_of(a)
    if blur and not free.any():
        shifts = blur / gravity * np.eye(3)
        changes = np.concatenate([design(directions + shift, ideal) - a for shift in shifts])
        rank, condition, free = rank_of(a, ABOVE_NOISE * changes)
    not_estimable = tuple(name for name, is_free in zip(names, free, strict=True) if is_free)
    reason = ""
    cofactors = np.full((len(names), len(names)), np.nan)
    if not np.isfinite(a).all():
        reason = "the sigmas differ too much: the conditions have no weights to compute with"
    elif not_estimable:
        blind = is_blind(model, approach, noise, gravity)
        reason = (
            f"rank {rank} of {len(names)}: {', '.join(not_estimable)} cannot be told apart by "
            + (f"the {approach.name} approach in any scheme" if blind else "these positions")
            + (f" with a noise of {1e3 * blur:.2g} mm/s²" if rank < exact[0] else "")
        )
    else:
        if parameters is not None:
            a = design(scheme.directions, np.asarray(parameters, dtype=float))
        scale = np.linalg.norm(a, axis=0)
        cofactors = np.linalg.inv((a / scale).T @ (a / scale)) / np.outer(scale, scale)
    redundancy = len(a) - len(names)
    return Estimability(names, rank, condition, redundancy, not_estimable, reason, cofactors)


SetUp = tuple[SensorModel, Approach, Noise, float, HoldConditions | None, Known]


def _design(set_up: SetUp, directions: Array, parameters: Array) -> Array:
    """Design matrix (conditions, u) with unit weights."""
    model, approach, noise, gravity, hold, known = set_up
    ideal = session(model, parameters, directions, gravity, hold)
    observed = replace(ideal.observations(noise), known=known)
    return whitened_jacobian(model, approach, observed, parameters)


def is_blind(model: SensorModel, approach: Approach, noise: Noise, gravity: float) -> bool:
    """Whether an approach cannot determine a model in any scheme, whatever the conditions are."""
    hold = EVERYTHING_VARIES.hold(SUFFICIENT_POSITIONS)
    set_up: SetUp = (model, approach, noise, gravity, hold, {})
    a = _design(set_up, evenly_spread(SUFFICIENT_POSITIONS), np.zeros(model.n_parameters))
    return rank_of(a)[0] < a.shape[1]
