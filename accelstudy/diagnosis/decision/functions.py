"""What has no name, but a plain place: a smooth function of one coordinate, added to the model.

It takes the place of the verdict "unknown" where one coordinate and target hold most of the
posterior. Of the shapes of that place the most probable one is fitted.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from scipy import special

from accelstudy.adjustment.quality import Solution
from accelstudy.basics.arrays import Array
from accelstudy.diagnosis.decision.posterior import Posterior
from accelstudy.diagnosis.decision.problem import Problem
from accelstudy.diagnosis.decision.refits import impossible, refit
from accelstudy.diagnosis.decision.statement import Finding
from accelstudy.diagnosis.evidence.candidates import UNKNOWN, Cause
from accelstudy.diagnosis.evidence.size import Evidence
from accelstudy.diagnosis.rules import RULES
from accelstudy.diagnosis.space.frame import SessionFit
from accelstudy.diagnosis.space.hypotheses import Hypothesis, joint_basis
from accelstudy.diagnosis.space.residuals import Residuals
from accelstudy.diagnosis.space.shapes import Place
from accelstudy.effects import get_effect
from accelstudy.effects.learned import ANGLES, LEARNED, OF_EACH, TARGETS, UNITS, LearnedFunction
from accelstudy.effects.smooth import CYCLES, LENGTHS

SIZES = np.geomspace(4.0, 4e6, 61)
"""λ of which the most probable one gives the amplitude."""
MIN_POSTERIOR = 0.01
"""Posterior from which on an explanation counts for a place."""
MIN_EIGENVALUE = 1e-6
"""Share of the trace of a covariance below which a direction counts as nothing."""
POINTS = 121
"""Values of the coordinate in the table of a function."""
LAGS = (0.1, 1.0)
"""Lags by which a rate of temperature is taken, as parts of the time between two holds."""


def learn_function(problem: Problem, posterior: Posterior, finding: Finding) -> Finding | None:
    """Learn a function where nothing has a name, and one coordinate and target have it; else None.

    Beside it is what is certain or, where that leaves a misfit, all of the explanation that has it,
    such as the mean of what it changes.

    Parameters
    ----------
    problem : Problem
    posterior : Posterior, before any effect of it was doubted
    finding : Finding, that it is unknown
    """
    found = most_probable_place(problem, posterior)
    if found is None or found.probability < RULES.sure:
        return None
    certain = [cause for cause in finding.chosen if cause.name not in found.names]
    doubted = [_cause(problem, posterior, name) for name in found.names]
    # What is doubted may be the mean of what the function changes, or a part of the function.
    for beside in (finding.chosen, (*certain, *doubted)):
        fitted = fit_of_place(problem, found.place, [cause.shape for cause in beside])
        if fitted is not None and not problem.misfit(fitted[1]) and not impossible(fitted[1]):
            chosen = (Cause(LEARNED, (LEARNED,), fitted[0], found.probability), *beside)
            return replace(
                finding,
                verdict=LEARNED,
                frame=SessionFit.of(fitted[1]),
                chosen=chosen,
                place=found.place,
            )
    return None


class PlaceFound(NamedTuple):
    """Place of something without a name."""

    place: Place
    probability: float
    names: tuple[str, ...]
    """Effects beside it in the most probable explanation."""


def most_probable_place(problem: Problem, posterior: Posterior) -> PlaceFound | None:
    """Coordinate and target that hold most of a posterior; None if nothing unknown does."""
    totals: dict[Place, float] = defaultdict(float)
    beside: dict[Place, tuple[float, tuple[str, ...]]] = {}
    for one in posterior.all:
        if UNKNOWN in one.names and one.posterior > MIN_POSTERIOR:
            names = tuple(name for name in one.names if name != UNKNOWN)
            for place, share in shares_of_places(problem, one.names).items():
                totals[place] += one.posterior * share
                beside[place] = max(beside.get(place, (0.0, ())), (one.posterior * share, names))
    if not totals:
        return None
    place = max(totals, key=totals.__getitem__)
    return PlaceFound(place, totals[place], beside[place][1])


def _cause(problem: Problem, posterior: Posterior, name: str) -> Cause:
    """Effect that an explanation has beside a function, with its probability."""
    having = [one.posterior for one in posterior.all if name in one.names]
    best = problem.frame.candidates[name].strongest(problem.residuals.z)
    return Cause(name, problem.singles.members[name], best, min(sum(having), 1.0))


def shares_of_places(problem: Problem, names: Sequence[str]) -> dict[Place, float]:
    """Probabilities of the places of something unknown, beside effects with some names."""
    unknown, left = problem.unknown, problem.residuals
    if unknown is None:
        return {}
    for name in names[: names.index(UNKNOWN)]:
        beside = problem.frame.candidates[name].strongest(left.z).basis
        left, unknown = left.orthogonal_to(beside), unknown.orthogonal_to(beside)
    if not unknown.places:
        return {}
    evidence = Evidence(problem.base.level, left.redundancy)
    places = unknown.place_densities(evidence, left.z)
    shares = special.softmax([*places.values()]).tolist()
    return dict(zip(places, shares, strict=True))


# --- the shapes of a place ----------------------------------------------------------------------


def shapes_of(place: Place, frame: SessionFit) -> Iterator[LearnedFunction]:
    """Shapes of a place as effects, with the amplitude 1; none where no effect can stand for it.

    A step to the next hold is no cause, and a way that the robot moved is in no column.
    """
    coordinate, of = place
    lengths = LENGTHS if of == "bias" else LENGTHS[1:]
    for target in (of, "square") if of == "scale" else (of,):
        for words in _coordinates(coordinate, frame):
            within = _range(_shape({**words, "target": target}), frame)
            for length in lengths:
                yield _shape({**words, **within, "target": target, "length": length})
    if place == ("time", "bias"):
        for cycles in CYCLES:
            period = np.ptp(frame.hold.column(frame.course)) / cycles
            yield _shape({"coordinate": f"{frame.course} wave", "target": of, "period": period})


def _coordinates(coordinate: str, frame: SessionFit) -> Iterator[dict[str, str | float]]:
    """Coordinates of effects that stand for one of the session."""
    hold = frame.hold
    if coordinate == "dT/dt":
        between = float(np.median(np.diff(hold.column("time")))) if hold.time is not None else 0.0
        for lag in LAGS if between > 0 else ():
            yield {"coordinate": "temperature rate", "tau": float(f"{lag * between:.4g}")}
    elif coordinate == "time":
        yield {"coordinate": frame.course}
    elif coordinate in (*UNITS, *ANGLES):
        yield {"coordinate": coordinate}


def _range(effect: LearnedFunction, frame: SessionFit) -> dict[str, float]:
    """Range of the coordinate of an effect in a session; none of an angle."""
    if effect.coordinate in ANGLES:
        return {}
    values = coordinate_values(effect, frame)
    return {"low": float(f"{values.min():.6g}"), "high": float(f"{values.max():.6g}")}


def coordinate_values(effect: LearnedFunction, frame: SessionFit) -> Array:
    """Coordinate of each component of the target of an effect in the positions, (n, c)."""
    angles = tuple(frame.angles.T)
    return np.stack(effect.arguments(tuple(frame.sensed.T), angles, frame.hold), axis=1)


def _shape(settings: dict[str, str | float]) -> LearnedFunction:
    """Effect with some settings."""
    texts = (f"{k}={v if isinstance(v, str) else f'{v:.6g}'}" for k, v in settings.items())
    effect = get_effect(f"{LEARNED}({', '.join(texts)})")
    assert isinstance(effect, LearnedFunction)
    return effect


# --- the fit ------------------------------------------------------------------------------------


class PlaceShape(NamedTuple):
    """A shape of a place, of its most probable size λ.

    Attributes
    ----------
    effect : LearnedFunction, with the amplitude 1
    log_density : float, of the residuals, over all sizes
    variance : float, square of the amplitude, in units of the variance of unit weight
    vectors, growth : (m, k) and (k,) arrays, eigenvectors and eigenvalues of λ K
    """

    effect: LearnedFunction
    log_density: float
    variance: float
    vectors: Array
    growth: Array


def weigh_place(
    place: Place, frame: SessionFit, residuals: Residuals, evidence: Evidence
) -> Iterator[PlaceShape]:
    """Shapes of a place that show in residuals of a frame, weighed by them."""
    z = residuals.z
    for effect in shapes_of(place, frame):
        rows = frame.rows(effect) * effect.deviations
        left = residuals.project(rows)
        trace = float(np.sum(left**2))
        if trace > RULES.visible * float(np.sum(rows**2)):
            values, turned = np.linalg.eigh(left.T @ left)
            significant = values > MIN_EIGENVALUE * trace
            vectors = left @ turned[:, significant] / np.sqrt(values[significant])
            along, shares = (z @ vectors) ** 2, values[significant] / trace
            logs = evidence.densities_by_size(along[None], shares, np.array([z @ z]), SIZES)[0]
            size = SIZES[int(np.argmax(logs))]
            log = float(np.logaddexp.reduce(logs))
            yield PlaceShape(effect, log, size / trace, vectors, size * shares)


def fit_of_place(
    problem: Problem, place: Place, beside: Sequence[Hypothesis]
) -> tuple[Hypothesis, Solution] | None:
    """Fit with the most probable shape of a place beside effects; None if it has no solution.

    Where no sigma is given, the prior of the function counts beside the noise that it leaves.
    """
    frame, base, unit = problem.frame, problem.frame.solution, 1.0
    residuals = frame.residuals.orthogonal_to(joint_basis(beside, len(frame.residuals.z)))
    z, evidence = residuals.z, Evidence(problem.base.level, residuals.redundancy)
    shapes = [*weigh_place(place, frame, residuals, evidence)]
    if not shapes:
        return None
    best = max(shapes, key=lambda one: one.log_density)
    if not evidence.level.known:
        taken = np.sum((z @ best.vectors) ** 2 * best.growth / (1 + best.growth))
        unit = evidence.variance(float(z @ z - taken))
        sigma = np.asarray(base.observed.sigma_force) * np.sqrt(unit)
        base = replace(base, observed=replace(base.observed, sigma_force=sigma))
    amplitude = float(f"{np.sqrt(unit * best.variance):.4g}")
    effect = type(best.effect)(**{**best.effect.settings, "amplitude": amplitude})
    seen = best.vectors[:, best.growth > 1]
    hypothesis = Hypothesis(LEARNED, effect, np.eye(len(effect.parameters)), seen, seen)
    solution = refit(base, [*beside, hypothesis])
    return None if solution is None else (hypothesis, solution)


# --- its table ----------------------------------------------------------------------------------


@dataclass(frozen=True)
class LearnedShape:
    """A function h of a coordinate that was learned, without a name in the catalogue.

    Attributes
    ----------
    place : Place, coordinate and target of the session
    effect : LearnedFunction
    axes : tuple of str, those of its c components in which it shows
    grid : (k,) array, the coordinate, SI
    values, sigmas : (k, c) arrays, h and its sigma there, SI
    """

    place: Place
    effect: LearnedFunction
    axes: tuple[str, ...]
    grid: Array
    values: Array
    sigmas: Array

    @property
    def components(self) -> tuple[str, ...]:
        """Components that have a function."""
        return TARGETS[self.effect.target][0]

    @property
    def unit(self) -> str:
        """SI unit of the values."""
        return TARGETS[self.effect.target][1]

    @property
    def function(self) -> dict[str, Any]:
        """The function as a table, SI."""
        return {
            "unit": self.unit,
            "coordinate": self.grid.tolist(),
            "value": dict(zip(self.components, self.values.T.tolist(), strict=True)),
            "sigma": dict(zip(self.components, self.sigmas.T.tolist(), strict=True)),
        }

    @property
    def extents(self) -> dict[str, float]:
        """How far the function goes up and down in the session, by the axes in which it shows."""
        extents = zip(self.components, np.ptp(self.values, axis=0).tolist(), strict=True)
        return {name: extent for name, extent in extents if name in self.axes}


def shape_of(finding: Finding, variance: float) -> LearnedShape:
    """Tabulate the function that was learned.

    Parameters
    ----------
    finding : Finding, whose first choice is the function
    variance : float, of unit weight
    """
    effect, frame, solution = finding.chosen[0].shape.effect, finding.frame, finding.frame.solution
    assert isinstance(effect, LearnedFunction)
    assert finding.place is not None
    at = coordinate_values(effect, frame)
    if effect.coordinate not in (*OF_EACH, "angle"):
        at = at[:, :1]
    grid = np.linspace(at.min(), at.max(), POINTS)
    names = list(solution.model.parameter_names)
    own = [names.index(parameter.name) for parameter in effect.parameters]
    parameters, cofactors = solution.parameters[own], solution.cofactors[np.ix_(own, own)]
    values, sigmas = effect.function(grid, parameters, variance * cofactors)
    most = np.max(np.abs(values) / sigmas, axis=0)
    shown = most >= min(RULES.z_component, most.max())
    axes = np.array(TARGETS[effect.target][0])[shown].tolist()
    return LearnedShape(finding.place, effect, tuple(axes), grid, values, sigmas)
