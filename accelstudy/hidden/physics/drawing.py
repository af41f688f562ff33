"""Random effects of given noncentrality."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.errors import InputError
from accelstudy.hidden.physics.forward.effects import EFFECTS, Effect
from accelstudy.hidden.physics.forward.measuring import Cause, observe
from accelstudy.hidden.physics.forward.outside import OUTSIDE
from accelstudy.hidden.physics.forward.session import Session
from accelstudy.hidden.physics.seen.atlas import Shape
from accelstudy.hidden.physics.seen.conditions import Conditions
from accelstudy.hidden.physics.seen.oracle import Oracle

Array = NDArray[np.float64]

DRAWS = 200
"""Draws of an effect until one is as it should be."""


def drawn(
    name: str,
    lam: float,
    session: Session,
    conditions: Conditions,
    knowing: Oracle,
    rng: np.random.Generator,
) -> tuple[Cause, tuple[str, ...]]:
    """Draw an effect, and say what means the same.

    Parameters
    ----------
    name : str, of an effect of the catalogue or outside it
    lam : float, its noncentrality; 0 for an effect of usual size, however little of it shows
    session : Session, in which the joints stand where they really do
    conditions : Conditions, of this session with the sensor that has the effect
    knowing : Oracle, of the design

    Returns
    -------
    cause : Cause
    same : tuple of str, names of the catalogue

    Raises
    ------
    InputError
        If the design cannot see the effect.
    """
    own = knowing.atlas
    effect = EFFECTS[name] if name in EFFECTS else OUTSIDE[name]
    if not lam:
        return _of_usual_size(effect, session, rng), (name,)
    if effect.shows(own.session):
        for _ in range(DRAWS):
            shape = own.shape(effect, effect.draw(own.session, rng))
            if shape is None:
                continue
            cause, change = _scaled(shape, lam, session, conditions, rng)
            if name in EFFECTS or knowing.is_outside(change):
                return cause, own.same_as(shape)
    approach = "robot" if conditions.robot else "gravity"
    raise InputError(
        f"{own.session.name}, {approach}: cannot see {name} as such; "
        f"it sees {', '.join(own.visible)}"
    )


def _of_usual_size(effect: Effect, session: Session, rng: np.random.Generator) -> Cause:
    parameters = effect.typical * rng.standard_normal((1, effect.k))
    return Cause(effect, effect.draw(session, rng), parameters)


def _scaled(
    shape: Shape, lam: float, session: Session, conditions: Conditions, rng: np.random.Generator
) -> tuple[Cause, Array]:
    """Draw parameters with a given noncentrality; return the effect and what it leaves, (m,)."""
    parameters = rng.standard_normal(shape.effect.k)
    if shape.effect.loses:
        parameters = abs(parameters)
    # Directions that cannot be seen have no size.
    parameters = shape.directions @ (shape.directions.T @ parameters)
    cause = Cause(shape.effect, dict(shape.settings), shape.effect.typical * parameters[None])
    without = conditions.misclosures(*observe(session, conditions.sensor, ()))
    for _ in range(2):  # an effect is almost, but not quite, proportional to its parameters
        with_it = conditions.misclosures(*observe(session, conditions.sensor, (cause,)))
        change = conditions.left(with_it - without)[0]
        factor = np.sqrt(lam / float(change @ change))
        cause = replace(cause, parameters=cause.parameters * factor)
    return cause, change * factor
