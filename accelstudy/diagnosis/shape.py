"""A learned function as people see it: its table, the residuals upon it, and what it may be."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.wording import comma_list
from accelstudy.diagnosis.coordinates import TARGETS, coordinate_of
from accelstudy.diagnosis.decision.functions import coordinate_values, space_of
from accelstudy.diagnosis.decision.problem import Problem
from accelstudy.diagnosis.decision.verdict import Finding
from accelstudy.diagnosis.formulas import Formula, rank_formulas
from accelstudy.diagnosis.rules import RULES
from accelstudy.diagnosis.space.frame import SessionFit
from accelstudy.diagnosis.space.shapes import function_rows
from accelstudy.effects.learned import OF_EACH, Learned

Array = NDArray[np.float64]

POINTS = 121
"""Values of the coordinate in the table of a function."""
MAX_PLACES, MIN_PLACE_DISTANCE = 3, 0.15
"""Places where a function is known least, and how far apart they are, in parts of the range."""
MIN_SIGMA_SHARE = 0.8
"""Part of the largest sigma from which on a function is known least."""


@dataclass(frozen=True)
class LearnedShape:
    """A function h of a coordinate that was learned, without a name in the catalogue.

    Attributes
    ----------
    coordinate, target : str
    effect : Learned
    subject : str, what depends on what: "the bias of x and y depends on the yaw"
    formulas : tuple of Formula, which it may be, most probable first
    components : tuple of str, c components that have a function
    axes : tuple of str, those in which it shows
    grid : (k,) array, the coordinate, SI
    values, sigmas : (k, c) arrays, h and its sigma there, SI
    where : (n, c) array, the coordinate of each component in the positions, SI
    residuals, spreads : (n, c) arrays, h and what the final fit leaves of it in each position, as
        far as the position shows it, and the noise of that, SI; NaN where it does not act
    least_known : tuple of float, values of the coordinate where positions would show most of it
    """

    coordinate: str
    target: str
    effect: Learned
    subject: str
    formulas: tuple[Formula, ...]
    components: tuple[str, ...]
    axes: tuple[str, ...]
    grid: Array
    values: Array
    sigmas: Array
    where: Array
    residuals: Array
    spreads: Array
    least_known: tuple[float, ...]

    @property
    def extents(self) -> dict[str, float]:
        """How far the function goes up and down in the session, by the axes in which it shows."""
        extents = zip(self.components, np.ptp(self.values, axis=0).tolist(), strict=True)
        return {name: extent for name, extent in extents if name in self.axes}


def shape_of(problem: Problem, finding: Finding, variance: float) -> LearnedShape | None:
    """Describe the function that was learned; None if none was.

    Parameters
    ----------
    problem : Problem
    finding : Finding, whose first choice is the function
    variance : float, of unit weight
    """
    if finding.place is None:
        return None
    learned, *others = (cause.shape for cause in finding.chosen)
    effect, frame, solution = learned.effect, finding.frame, finding.frame.solution
    assert isinstance(effect, Learned)
    at = coordinate_values(effect, frame)
    if effect.coordinate not in (*OF_EACH, "angle"):
        at = at[:, :1]
    grid = np.linspace(at.min(), at.max(), POINTS)
    names = list(solution.model.parameter_names)
    own = [names.index(parameter.name) for parameter in effect.parameters]
    parameters, cofactors = solution.parameters[own], solution.cofactors[np.ix_(own, own)]
    values, sigmas = effect.function(grid, parameters, variance * cofactors)
    here = [effect.function(at[:, min(i, at.shape[1] - 1)], parameters, cofactors)[0][:, i]
            for i in range(values.shape[1])]  # fmt: skip
    left, spreads = _residual_function(frame, effect, variance)
    if effect.coordinate == "previous":
        # It acts where something moved: not in the first position.
        steps = np.column_stack([frame.hold.column(f"step_{axis}") for axis in "xyz"])
        spreads[~steps.any(axis=1)] = np.nan
    target, most = TARGETS[effect.target], np.max(np.abs(values) / sigmas, axis=0)
    shown = most >= min(RULES.z_component, most.max())
    axes = tuple(name for name, seen in zip(target.components, shown, strict=True) if seen)
    which = "all axes" if len(axes) == len("xyz") else comma_list(axes)
    beside = space_of(others, len(problem.residuals.z))
    return LearnedShape(
        *finding.place,
        effect,
        f"{target.words.format(which)} depends on {coordinate_of(effect.coordinate).words}",
        rank_formulas(problem.frame, problem.evidence, effect, finding.place, at, beside),
        target.components,
        axes,
        grid,
        values,
        sigmas,
        np.broadcast_to(at, left.shape),
        np.where(np.isnan(spreads), np.nan, np.stack(here, axis=1) + left),
        spreads,
        _least_known(grid, np.sqrt(np.mean(sigmas[:, shown] ** 2, axis=1))),
    )


def _residual_function(frame: SessionFit, effect: Learned, variance: float) -> tuple[Array, Array]:
    """What each position leaves of h by its residuals, and the noise of that, (n, c) each."""
    n, conditions = frame.residuals.whitening.shape[:2]
    rows = function_rows(frame, effect.target, np.ones((n, 1, 1)))
    seen = rows[: n * conditions].reshape(n, conditions, -1)
    errors = frame.residuals.errors[: n * conditions].reshape(n, conditions, 1)
    square = np.maximum(np.sum(seen**2, axis=1), np.finfo(float).tiny)
    return np.sum(seen * errors, axis=1) / square, np.sqrt(variance / square)


def _least_known(grid: Array, sigma: Array) -> tuple[float, ...]:
    """Places where a function is known least, in order."""
    places: list[float] = []
    far = MIN_PLACE_DISTANCE * (grid[-1] - grid[0])
    for i in np.argsort(-sigma, kind="stable"):
        if len(places) == MAX_PLACES or sigma[i] < MIN_SIGMA_SHARE * sigma.max():
            break
        if all(abs(grid[i] - other) > far for other in places):
            places.append(float(grid[i]))
    return tuple(sorted(places))
