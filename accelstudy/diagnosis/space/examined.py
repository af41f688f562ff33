"""A fit and all that may be missing from its model: the catalogue, evaluated in its session."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from accelstudy.adjustment.quality import Solution
from accelstudy.basics.errors import InputError
from accelstudy.diagnosis.space.frame import Frame
from accelstudy.diagnosis.space.hypotheses import (
    ALIKE,
    OUTLIER,
    BumpedPositions,
    EffectShapes,
    Hypothesis,
    Shapes,
    same_space,
)
from accelstudy.diagnosis.space.spaces import Bases
from accelstudy.effects import Effect, effect_names, get_effect

Array = NDArray[np.float64]
IMITATES = 0.9995
"""Canonical cosine from which on two signatures are held to be the same in what is confirmed."""
AT_ONCE = 10_000_000
"""Numbers in one block of work, about."""


@dataclass(frozen=True)
class ExaminedFit:
    """A calibrated session with the hypotheses about it, each evaluated at first use.

    Attributes
    ----------
    frame : Frame
    """

    frame: Frame

    @property
    def candidates(self) -> Mapping[str, Shapes]:
        """Shapes of what may be missing, by its name."""
        return self._catalogue[0]

    @property
    def invisible(self) -> tuple[str, ...]:
        """Effects of rank 0."""
        return self._catalogue[1]

    @property
    def untestable(self) -> Mapping[str, str]:
        """Why an effect cannot be tested, by its name."""
        return self._catalogue[2]

    @cached_property
    def _catalogue(self) -> tuple[dict[str, Shapes], tuple[str, ...], dict[str, str]]:
        """Evaluate the effects that are not in the model, and bumped positions."""
        frame, solution = self.frame, self.frame.solution
        residuals = frame.residuals
        known = {effect.name for effect in solution.model.effects}
        candidates: dict[str, Shapes] = {}
        invisible, untestable = [], {}
        for name in effect_names():
            if name in known:
                continue
            try:
                effects = get_effect(name).candidates(frame.hold, frame.forces, solution.gravity)
                size = max(1, AT_ONCE // residuals.design.size)
                parts = [effects[i : i + size] for i in range(0, len(effects), size)]
                shapes = [shape for part in parts for shape in frame.hypotheses(part)]
            except InputError as error:
                untestable[name] = str(error)
                continue
            seen = [shape for shape in shapes if shape is not None]
            fitting = [shape for shape in seen if shape.dim < residuals.positions.redundancy]
            if fitting:
                candidates[name] = EffectShapes.of(fitting)
            elif seen:
                untestable[name] = (
                    f"its {seen[0].dim} parameters need more than the "
                    f"{residuals.positions.redundancy} redundant conditions there are"
                )
            else:
                invisible.append(name)
        bumped = BumpedPositions.of(residuals)
        if len(bumped):
            candidates[OUTLIER] = bumped
        return candidates, tuple(invisible), untestable

    def hypothesis(self, effect: Effect) -> Hypothesis | None:
        """Return what an effect would leave in the residuals; None if nothing."""
        return self.frame.hypotheses((effect,))[0]

    def alike(self, others: Sequence[Hypothesis]) -> set[str]:
        """Effects of which a shape cannot be told from one of other hypotheses."""
        dims = np.array([other.dim for other in others])
        products = self._ideals.parts(np.concatenate([other.ideal.T for other in others]))
        # The squared cosines sum to the squares of all products, so most need no decomposition.
        squares = np.add.reduceat(products, np.cumsum(dims) - dims, axis=0)
        found: set[str] = set()
        for i, k in np.argwhere(squares > dims[:, None] * ALIKE**2).tolist():
            shape = self._shapes[k]
            if shape.name not in found and same_space(others[i], shape):
                found.add(shape.name)
        return found

    def nearest(self, hypothesis: Hypothesis) -> tuple[tuple[str, float], ...]:
        """Other effects and their largest canonical cosines, nearest first."""
        near: dict[str, float] = {}
        for shape, cosine in zip(self._shapes, self._cosines(hypothesis, 1).tolist(), strict=True):
            if shape.name != hypothesis.name:
                near[shape.name] = max(near.get(shape.name, 0.0), cosine)
        return tuple(sorted(near.items(), key=lambda item: -item[1]))

    def imitators(self, hypothesis: Hypothesis) -> tuple[str, ...]:
        """Other effects that could leave all that a hypothesis does, and perhaps more."""
        smallest = self._cosines(hypothesis, hypothesis.dim)
        names = {self._shapes[k].name for k in np.flatnonzero(smallest >= IMITATES)}
        return tuple(sorted(names - {hypothesis.name}))

    def _cosines(self, hypothesis: Hypothesis, rank: int) -> Array:
        """Canonical cosine of this rank, 1 for the largest, with each shape; 0 if it has fewer."""
        products = hypothesis.ideal.T @ self._ideals.together
        found = np.zeros(len(self._shapes))
        for d in np.unique(self._ideals.dims[self._ideals.dims >= rank]):
            own = np.flatnonzero(self._ideals.dims == d)
            blocks = products[:, self._ideals.ends[own][:, None] + np.arange(d)]
            values = np.linalg.svd(np.swapaxes(blocks, 0, 1), compute_uv=False)[:, rank - 1]
            found[own] = np.minimum(values, 1.0)
        return found

    @cached_property
    def _shapes(self) -> list[Hypothesis]:
        """All shapes of all effects."""
        effects = (one for one in self.candidates.values() if isinstance(one, EffectShapes))
        return [shape for shapes in effects for shape in shapes]

    @cached_property
    def _ideals(self) -> Bases:
        """Their spaces for an ideal sensor."""
        return Bases.beside_each_other([shape.ideal for shape in self._shapes])


def examine(solution: Solution) -> ExaminedFit:
    """Examine a calibrated session."""
    return ExaminedFit(Frame.of(solution))
