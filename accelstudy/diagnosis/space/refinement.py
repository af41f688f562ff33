"""Shapes of an effect between those that are tried at first."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from accelstudy.diagnosis.space.examined import ExaminedFit
from accelstudy.diagnosis.space.hypotheses import EffectShapes, Hypothesis, Shapes

Array = NDArray[np.float64]

ROUNDS = 3
"""How often shapes are added about the best one."""
BETWEEN = 5
"""Shapes that are added between its neighbours."""


def strongest(shapes: Shapes, z: Array) -> Hypothesis:
    """Shape that explains most of residuals z (m,)."""
    return shapes[int(np.argmax(shapes.parts(z)))]


def refined(examined: ExaminedFit, shapes: Shapes) -> Shapes:
    """Add shapes between the neighbours of the best one, and again between those."""
    z = examined.frame.residuals.z
    if not isinstance(shapes, EffectShapes) or len(shapes) < 2:
        return shapes
    if shapes[0].smooth is None:
        return _completed(examined, shapes)
    for _ in range(ROUNDS):
        best = int(np.argmax(shapes.parts(z)))
        around = (shapes[max(best - 1, 0)].value, shapes[min(best + 1, len(shapes) - 1)].value)
        tried = _all_shaped(examined, shapes[best], np.geomspace(*around, BETWEEN + 2)[1:-1])
        fine = [*shapes, *(h for h in tried if h is not None)]
        shapes = EffectShapes.of(sorted(fine, key=lambda h: h.value))
    return shapes


def shaped(examined: ExaminedFit, hypothesis: Hypothesis, value: float) -> Hypothesis | None:
    """Return a smooth effect with another value of its setting; None if less of it shows."""
    return _all_shaped(examined, hypothesis, [value])[0]


def _all_shaped(
    examined: ExaminedFit, hypothesis: Hypothesis, values: Iterable[float]
) -> list[Hypothesis | None]:
    """Likewise with several values."""
    assert hypothesis.effect is not None
    assert hypothesis.smooth is not None
    kind, name = type(hypothesis.effect), hypothesis.smooth
    found = examined.frame.hypotheses([kind(**{name: float(f"{v:.6g}")}) for v in values])
    return [h if h is not None and h.dim == hypothesis.dim else None for h in found]


def _completed(examined: ExaminedFit, shapes: EffectShapes) -> EffectShapes:
    """Add the shapes next to the best one that were passed over, until none is left."""
    z, hold = examined.frame.residuals.z, examined.frame.hold
    while True:
        best = int(np.argmax(shapes.parts(z)))
        effect = shapes[best].effect
        assert effect is not None
        fine = list(shapes)
        for near in (best + 1, best - 1):
            if 0 <= near < len(shapes):
                other = shapes[near].effect
                assert other is not None
                between = effect.between(other, hold)
                tried = examined.frame.hypotheses(between) if between else []
                found = [h for h in tried if h is not None and h.dim == shapes[best].dim]
                fine[max(best, near) : max(best, near)] = found
        if len(fine) == len(shapes):
            return shapes
        shapes = EffectShapes.of(fine)
