"""The linearised conditions of all positions so far, session by session.

They are kept so that residuals are known at any time, and so that some sessions can be linearised
anew while others stay as they are. All conditions of a session refer to one point x₀: at unit
weight they are Ã (x − x₀) + w̃.
"""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
from numpy.typing import NDArray

from accelstudy.adjustment.gauss_helmert import Whitened

Array = NDArray[np.float64]

_ARRAYS = tuple(field.name for field in fields(Whitened))
_SESSIONS = -2
"""Axis of the sessions in all arrays; the last axis is that of the positions."""


def seen_from(part: Whitened, step: Array) -> Whitened:
    """Conditions referred to a point that is `step` (u, R) away from their own."""
    return replace(part, misclosures=part.solved(step)[0])


def no_conditions(conditions: int, unknowns: int, observed: tuple[int, ...]) -> Whitened:
    """Conditions of no positions; `observed` is the shape (R, 0, o) of the observations."""
    c, u, (sessions, _, o) = conditions, unknowns, observed
    shapes = ((c, c), (c, u), (c,), (c, o))
    return Whitened(*(np.zeros((*shape, sessions, 0)) for shape in shapes))


def with_next(before: Whitened, new: Whitened) -> Whitened:
    """Join the conditions of earlier and of further positions."""
    pairs = {name: (getattr(before, name), getattr(new, name)) for name in _ARRAYS}
    return Whitened(**{name: np.concatenate(pair, axis=-1) for name, pair in pairs.items()})


def of_sessions(whole: Whitened, chosen: NDArray[np.int_]) -> Whitened:
    """Conditions of some of the sessions."""
    return Whitened(**{n: np.take(getattr(whole, n), chosen, axis=_SESSIONS) for n in _ARRAYS})


def put(whole: Whitened, chosen: NDArray[np.int_], part: Whitened) -> None:
    """Replace the conditions of some of the sessions, in place."""
    for name in _ARRAYS:
        getattr(whole, name)[..., chosen, :] = getattr(part, name)


def rows(part: Whitened) -> Array:
    """Rows [Ã | −w̃] of the conditions, (R, c n, u + 1)."""
    both = np.concatenate([part.design, -part.misclosures[:, None]], axis=1)
    return both.transpose(2, 3, 0, 1).reshape(both.shape[2], -1, both.shape[1])
