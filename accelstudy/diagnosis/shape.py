"""A learned function as people see it: its table, the residuals upon it, and what it may be."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from accelstudy.diagnosis.evidence.size import Evidence
from accelstudy.diagnosis.formulas import TARGETS, Ranking, argument, of_each, ranked
from accelstudy.diagnosis.space.examined import Frame
from accelstudy.diagnosis.space.shapes import function_rows
from accelstudy.diagnosis.space.signatures import Moment

Array = NDArray[np.float64]

POINTS = 121
"""Values of the coordinate in the table of a function."""
FEW, APART = 3, 0.15
"""Places where a function is known least, and how far apart they are, in parts of the range."""
KNOWN = 0.8
"""Part of the largest sigma from which on a function is known least."""


@dataclass(frozen=True)
class LearnedShape:
    """A function h of a coordinate that was learned, without a name in the catalogue.

    Attributes
    ----------
    coordinate, target : str
    kind : (str, str), the same more closely, as formulas have them
    ranking : Ranking, what depends on what, and which formulas it may be
    components : tuple of str, c components that have a function
    grid : (k,) array, the coordinate, SI
    values, sigmas : (k, c) arrays, h and its sigma there, SI
    at : (n, c) array, the coordinate of each component in the positions, SI
    residuals, spreads : (n, c) arrays, h and what the final fit leaves of it in each position, as
        far as the position shows it, and the noise of that, SI
    least_known : tuple of float, values of the coordinate where positions would show most of it
    """

    coordinate: str
    target: str
    kind: tuple[str, str]
    ranking: Ranking
    components: tuple[str, ...]
    grid: Array
    values: Array
    sigmas: Array
    at: Array
    residuals: Array
    spreads: Array
    least_known: tuple[float, ...]

    def title(self, component: str) -> str:
        """Name a component of the target: bias of x."""
        words = TARGETS[self.kind[1]].words.removeprefix("the ")
        if self.kind[0] != "others":
            return words.format(component)
        return f"{words.format(component[0])} by the force along {component[1]}"


def shape_of(
    base: Frame,
    final: Frame,
    evidence: Evidence,
    place: tuple[str, str],
    kind: tuple[str, str],
    function: Callable[[Array], tuple[Array, Array]],
    variance: float,
) -> LearnedShape:
    """Describe a learned function.

    Parameters
    ----------
    base, final : Frame, of the fits without and with it
    evidence : Evidence, of the first
    place : (str, str), coordinate and target
    kind : (str, str), the same as the function has them
    function : callable, h and sigma of values of the coordinate (k,), (k, c) each, SI
    variance : float, of unit weight
    """
    ranking = ranked(base, evidence, kind)
    now = Moment(final.hold)
    at = argument(final, kind[0])(now)
    grid = np.linspace(at.min(), at.max(), POINTS)
    values, sigmas = function(grid)
    at = of_each(kind[0], at, values.shape[1])
    left, spreads = _left(final, kind, values.shape[1], variance)
    here = np.stack([np.interp(at[:, i], grid, h) for i, h in enumerate(values.T)], axis=1)
    taking = [ranking.components.index(axis) for axis in ranking.axes]
    return LearnedShape(
        *place,
        kind,
        ranking,
        ranking.components,
        grid,
        values,
        sigmas,
        at,
        here + left,
        spreads,
        _least_known(grid, np.sqrt(np.mean(sigmas[:, taking] ** 2, axis=1))),
    )


def _left(frame: Frame, kind: tuple[str, str], count: int, variance: float) -> tuple[Array, Array]:
    """What each position leaves of h by its residuals, and the noise of that, (n, c) each."""
    n = len(frame.forces)
    one = np.ones((n, 1 if kind[0] != "others" else 3, 1))
    target = "bias of the others" if kind[0] == "others" else kind[1]
    rows = function_rows(frame, target, lambda now: one, rates=False)
    conditions = frame.residuals.whitening.shape[1]
    seen = rows[: n * conditions].reshape(n, conditions, count)
    errors = frame.residuals.errors[: n * conditions].reshape(n, conditions, 1)
    square = np.sum(seen**2, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.sum(seen * errors, axis=1) / square, np.sqrt(variance / square)


def _least_known(grid: Array, sigma: Array) -> tuple[float, ...]:
    """Places where a function is known least, in order."""
    places: list[float] = []
    far = APART * (grid[-1] - grid[0])
    for i in np.argsort(-sigma, kind="stable"):
        if len(places) == FEW or sigma[i] < KNOWN * sigma.max():
            break
        if all(abs(grid[i] - other) > far for other in places):
            places.append(float(grid[i]))
    return tuple(sorted(places))
