"""Fits of the model with effects added and bumped positions left out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from accelstudy.adjustment.quality import Solution, solve
from accelstudy.basics.errors import InputError
from accelstudy.diagnosis.space.examined import ExaminedFit
from accelstudy.diagnosis.space.hypotheses import Hypothesis, Shapes
from accelstudy.diagnosis.space.refinement import shaped as reshaped
from accelstudy.diagnosis.space.refinement import strongest
from accelstudy.sensors.models import composition_name
from accelstudy.sensors.sensor import SensorModel

SAME = 0.5
"""Difference of Ω within which two fits are equally good."""
BEYOND = 1.6
"""Factor by which a setting may lie beyond the first and the last that are tried."""


@dataclass(frozen=True)
class Refits:
    """Rigorous fits of a session with hypotheses about it.

    Attributes
    ----------
    examined : ExaminedFit, of the base fit
    shapes : dict of name to shapes, refined
    """

    examined: ExaminedFit
    shapes: Mapping[str, Shapes]

    @property
    def base(self) -> Solution:
        """The base fit."""
        return self.examined.frame.solution

    def extended_model(self, chosen: Sequence[Hypothesis]) -> SensorModel:
        """The base model with the effects of hypotheses added."""
        effects = [h.shown for h in chosen if h.shown is not None]
        if not effects:
            return self.base.model
        together = (*self.base.model.effects, *effects)
        return SensorModel(composition_name(together), together)

    def refit(self, chosen: Sequence[Hypothesis]) -> Solution | None:
        """Fit with effects added and bumped positions left out; None if it has no solution."""
        base = self.base
        try:
            model = self.extended_model(chosen)
        except InputError:  # two effects whose parameters have the same names
            return None
        # Started from an ideal sensor, the iterations may not reach a large effect.
        start = dict(zip(base.model.parameter_names, base.parameters, strict=False))
        observed = replace(base.observed, initial=model.vector(start))
        bumped = [h.place for h in chosen if h.place is not None]
        if bumped:
            observed = observed.take(np.setdiff1d(np.arange(len(base.misclosures)), bumped))
        try:
            solution = solve(model, base.approach, observed)
        except (InputError, np.linalg.LinAlgError):
            return None
        if not base.approach.uses_angles:
            # Without a force that belongs to them, readings have no attitude.
            p = solution.parameters[: model.n_parameters]
            f_b = model.correct(observed.forces[0], p, solution.gravity, observed.hold)
            if np.isnan(f_b).any():
                return None
        return solution if solution.redundancy > 0 else None

    def sharpened(self, chosen: Sequence[Hypothesis]) -> list[Hypothesis]:
        """Search the settings of smooth effects by refits: a large effect is not of first order."""
        sharp = list(chosen)
        for k, start in enumerate(chosen):
            if start.smooth is None:
                continue
            from scipy.optimize import minimize_scalar  # slow to import, and seldom needed

            values = [h.value for h in self.examined.candidates[start.name]]
            low = max((v for v in values if v < start.value), default=start.value / BEYOND)
            high = min((v for v in values if v > start.value), default=start.value * BEYOND)

            def omega(log: float, k: int = k, start: Hypothesis = start) -> float:
                shaped = reshaped(self.examined, start, float(np.exp(log)))
                if shaped is None:
                    return self.base.omega
                trial = self.refit([*sharp[:k], shaped, *sharp[k + 1 :]])
                return self.base.omega if trial is None else trial.omega

            found = minimize_scalar(
                omega, bounds=np.log([low, high]), method="bounded", options={"xatol": 1e-4}
            )
            shaped = reshaped(self.examined, start, float(np.exp(found.x)))
            if shaped is not None and found.fun < omega(float(np.log(start.value))):
                sharp[k] = shaped
        return sharp

    def best(
        self, chosen: Sequence[tuple[Hypothesis, tuple[str, ...]]]
    ) -> tuple[list[Hypothesis], Solution] | None:
        """Fit with the members of classes that fit best; None if none has a solution.

        To first order the members of a class are the same. Large effects are not of first order.

        Parameters
        ----------
        chosen : hypotheses, each with the names of its class
        """
        z = self.examined.frame.residuals.z
        alternatives = [
            [
                best if name == best.name else strongest(self.shapes[name], z)
                for name in members
                if name in self.shapes
            ]
            for best, members in chosen
        ]
        sharp = [self.sharpened(one) for one in product(*alternatives)]
        solved = [(one, fit) for one in sharp if (fit := self.refit(one)) is not None]
        if not solved:
            return None
        least = min(fit.omega for _, fit in solved)
        # Fits that differ by less count as equal: rounding errors must not choose the name.
        return next(item for item in solved if item[1].omega <= least + SAME)
