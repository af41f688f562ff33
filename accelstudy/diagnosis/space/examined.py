"""All that may be missing from the model of a calibrated session."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from accelstudy.adjustment.quality import Solution
from accelstudy.basics.errors import InputError
from accelstudy.diagnosis.rules import RULES
from accelstudy.diagnosis.space.frame import SessionFit
from accelstudy.diagnosis.space.hypotheses import (
    OUTLIER,
    BumpedPositions,
    EffectShapes,
    Hypotheses,
    Hypothesis,
    same_space,
)
from accelstudy.effects import Effect, effect_names, get_effect
from accelstudy.sensors.models import compose

Array = NDArray[np.float64]

AT_ONCE = 10_000_000
"""Numbers in one block of work, about."""


@dataclass(frozen=True)
class ExaminedFit:
    """A calibrated session with the hypotheses about it.

    Attributes
    ----------
    frame : SessionFit
    candidates : dict of name to shapes, what may be missing
    invisible : tuple of str, effects of rank 0
    untestable : dict of effect to the reason why it cannot be tested
    """

    frame: SessionFit
    candidates: Mapping[str, Hypotheses]
    invisible: tuple[str, ...]
    untestable: Mapping[str, str]

    @classmethod
    def of(cls, frame: SessionFit) -> ExaminedFit:
        """Evaluate the effects that are not in the model, and bumped positions."""
        residuals, solution = frame.residuals, frame.solution
        modelled = {effect.name for effect in solution.model.effects}
        candidates: dict[str, Hypotheses] = {}
        invisible, untestable = [], {}
        for name in effect_names():
            if name in modelled:
                continue
            if solution.observed.angle_errors is not None and _of_robot(get_effect(name)):
                untestable[name] = "a calibrated sensor told the angles, and no robot"
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
            fitting = [shape for shape in seen if shape.dim < residuals.redundancy]
            if fitting:
                candidates[name] = EffectShapes.of(fitting)
            elif seen:
                untestable[name] = (
                    f"its {seen[0].dim} parameters need more than the "
                    f"{residuals.redundancy} redundant conditions there are"
                )
            else:
                invisible.append(name)
        bumped = BumpedPositions.of(residuals)
        if len(bumped):
            candidates[OUTLIER] = bumped
        return cls(frame, candidates, tuple(invisible), untestable)

    def hypothesis(self, effect: Effect) -> Hypothesis | None:
        """Return what an effect would leave in the residuals; None if nothing."""
        return self.frame.hypotheses((effect,))[0]

    def indistinguishable(self, others: Sequence[Hypothesis]) -> set[str]:
        """Effects indistinguishable from any of the given hypotheses, in one of their shapes."""
        ideals, ends = self._ideals
        same: set[str] = set()
        for other in others:
            # The squared cosines sum to the squares of all products: most need no decomposition.
            squares = np.sum((other.ideal.T @ ideals) ** 2, axis=0)
            near = np.add.reduceat(squares, ends[:-1]) > other.dim * RULES.alike**2
            shapes = (self._shapes[k] for k in np.flatnonzero(near))
            same |= {one.name for one in shapes if one.name not in same and same_space(other, one)}
        return same

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
        names = {self._shapes[k].name for k in np.flatnonzero(smallest >= RULES.imitates)}
        return tuple(sorted(names - {hypothesis.name}))

    def _cosines(self, hypothesis: Hypothesis, rank: int) -> Array:
        """Canonical cosine of this rank, 1 for the largest, with each shape; 0 if it has fewer."""
        ideals, ends = self._ideals
        products, dims = hypothesis.ideal.T @ ideals, np.diff(ends)
        cosines = np.zeros(len(self._shapes))
        for d in np.unique(dims[dims >= rank]):
            alike = np.flatnonzero(dims == d)
            blocks = products[:, ends[alike][:, None] + np.arange(d)]
            values = np.linalg.svd(np.swapaxes(blocks, 0, 1), compute_uv=False)[:, rank - 1]
            cosines[alike] = np.minimum(values, 1.0)
        return cosines

    @cached_property
    def _shapes(self) -> list[Hypothesis]:
        """All shapes of all effects."""
        effects = (one for one in self.candidates.values() if isinstance(one, EffectShapes))
        return [shape for shapes in effects for shape in shapes]

    @cached_property
    def _ideals(self) -> tuple[Array, NDArray[np.int_]]:
        """Bases of their spaces for an ideal sensor, side by side, and where each begins."""
        bases = [shape.ideal for shape in self._shapes]
        return np.concatenate(bases, axis=1), np.cumsum([0, *(basis.shape[1] for basis in bases)])


def examine(solution: Solution) -> ExaminedFit:
    """Examine a calibrated session."""
    return ExaminedFit.of(SessionFit.of(solution))


def _of_robot(effect: Effect) -> bool:
    """Whether only a robot has an effect: it is in its readings, or turns with its axes."""
    if type(effect).reading is not Effect.reading:
        return True
    columns = compose(effect.spec, (effect.spec,)).hold_columns
    return effect.part == "rig" and bool({"roll", "pitch", "yaw"} & {*columns})
