"""The session of a fit, in which the signatures of effects are evaluated."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import takewhile

import numpy as np
from numpy.typing import NDArray

from accelstudy.adjustment.quality import Solution
from accelstudy.basics.errors import InputError
from accelstudy.diagnosis.space.hypotheses import Hypothesis
from accelstudy.diagnosis.space.residuals import Residuals, ideal_residuals
from accelstudy.diagnosis.space.signatures import Moments, Signature, signatures
from accelstudy.diagnosis.space.slopes import Slopes
from accelstudy.diagnosis.space.spaces import VISIBLE, spans
from accelstudy.effects import Effect, HoldConditions, effect_names, get_effect
from accelstudy.leveling.angles import angles_of

Array = NDArray[np.float64]

ROUNDING = 1e-9
"""Share of a signature that rounding errors may leave where nothing is left."""


@dataclass(frozen=True)
class Frame:
    """One calibrated session, in which effects are evaluated.

    Attributes
    ----------
    solution : Solution
    residuals : Residuals
    ideal : Residuals, of an ideal sensor in the same positions
    forces : (n, 3) array, m/s², of the ideal sensor
    sensed : (n, 3) array, m/s², the same along the sensitive axes as the base fit finds them
    angles : (n, 2) array, rad, attitude as the robot reads it, else as the forces show it
    moments : Moments, of the holds, completed with what is implied
    """

    solution: Solution
    residuals: Residuals
    ideal: Residuals
    forces: Array
    sensed: Array
    angles: Array
    moments: Moments

    @property
    def hold(self) -> HoldConditions:
        """The holds, completed with what is implied."""
        return self.moments.hold

    @classmethod
    def of(cls, solution: Solution) -> Frame:
        """Frame of a calibration at its solution."""
        ideal, forces = ideal_residuals(solution)
        observed, model = solution.observed, solution.model
        if observed.angles is not None and solution.approach.uses_angles:
            angles = np.asarray(observed.angles[0])
        else:
            angles = angles_of(forces)
        t = model.axes_matrix(solution.parameters[: model.n_parameters])
        frame = cls(
            solution=solution,
            residuals=Residuals.of(solution),
            ideal=ideal,
            forces=forces,
            sensed=np.asarray(np.linalg.solve(t, forces.T).T),
            angles=angles,
            moments=Moments(implied_hold(solution, angles), rates=observed.slope is not None),
        )
        return frame.with_slopes()

    def signature(self, effect: Effect) -> Signature:
        """Signature of an effect of the sensor."""
        return self.signatures((effect,))

    def signatures(self, shapes: Sequence[Effect], ideal: bool = False) -> Signature:
        """Signatures of shapes of an effect of the sensor, or of an ideal one, side by side."""
        forces = self.forces if ideal else self.sensed
        return signatures(shapes, forces, self.angles, self.solution.gravity, self.moments)

    def with_slopes(self) -> Frame:
        """Add the slopes within the holds where they tell more than the means."""
        without = replace(self, moments=Moments(self.hold, rates=False))
        slopes = Slopes.of(self.solution.observed, self.forces)
        if slopes is None:
            return without
        own = [self.signature(effect) for effect in self.solution.model.effects]
        rows = slopes.beside(self.residuals, self.solution.parameters, own, self.of_time())
        if rows is None:
            return without
        return replace(
            self,
            residuals=self.residuals.with_slopes(rows),
            ideal=self.ideal.with_slopes(replace(rows, errors=0 * rows.errors)),
        )

    def of_time(self) -> Iterator[Signature]:
        """Signatures of the effects beside the model that change the output within a hold."""
        known = {effect.name for effect in self.solution.model.effects}
        for name in effect_names():
            if name in known:
                continue
            try:
                shapes = get_effect(name).candidates(self.hold, self.forces, self.solution.gravity)
                shown = self.signatures(shapes).split(len(shapes)) if shapes else []
            except InputError:  # a column is absent
                continue
            yield from takewhile(lambda one: bool(one.rate.any()), shown)

    def hypotheses(self, shapes: Sequence[Effect]) -> list[Hypothesis | None]:
        """Return what shapes of an effect would leave in the residuals; None for nothing."""

        def of_each(columns: Array) -> Array:
            """Columns (m, s k) of all shapes as those of each, (s, m, k)."""
            return np.moveaxis(columns.reshape(len(columns), len(shapes), -1), 1, 0)

        shown = self.signatures(shapes, ideal=True)
        # A fit is made to the means, so they have to show the effect.
        means = self.ideal.positions
        projected = of_each(means.project(means.whitened(shown)))
        sizes = means.size(shown, self.solution.gravity).reshape(len(shapes), -1)
        directions, ideal, seen = spans(projected, sizes, VISIBLE)
        if self.ideal.slopes:
            projected = of_each(self.ideal.project(self.ideal.whitened(shown)))
            ideal = spans(projected @ directions, None, ROUNDING)[1]
        columns = of_each(self.residuals.project(self.residuals.whitened(self.signatures(shapes))))
        # A force that passes a knee at the ideal sensor may not do so along the real axes.
        sizes = np.linalg.norm(projected @ directions, axis=1)
        also, basis, rank = spans(columns @ directions, sizes, ROUNDING)
        for i in np.flatnonzero(rank < seen):
            directions[i] = directions[i] @ also[i]
            ideal[i] = spans((projected[i] @ directions[i])[None], None, ROUNDING)[1][0]
        return [
            Hypothesis(
                name=effect.name,
                effect=effect,
                directions=directions[i, :, : rank[i]],
                basis=basis[i, :, : rank[i]],
                ideal=ideal[i, :, : rank[i]],
            )
            if rank[i]
            else None
            for i, effect in enumerate(shapes)
        ]


def implied_hold(solution: Solution, angles: Array) -> HoldConditions:
    """Complete the holds with what is implied: the attitude, and yaw 0 where none is given."""
    hold = solution.observed.hold or HoldConditions()
    yaw = np.zeros(len(angles)) if hold.yaw is None else hold.yaw
    return replace(hold, roll=angles[:, 0], pitch=angles[:, 1], yaw=yaw)
