"""One posterior over everything that could be the case once something is missing.

Fewer explanations are reported than were weighed (`Posterior.reported`). All kinds of wrong noise
count as one, named by the most probable of them. Where one effect is more probable than several, a
set counts for the most probable of its effects, and likewise a set of three for the most probable
of its pairs where two are more probable. "This effect is missing" then leaves open whether a second
one, too small to be seen, is missing as well.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy import special

from accelstudy.adjustment.quality import Solution, column_basis
from accelstudy.campaign.session import Campaign
from accelstudy.diagnosis.decision.problem import Problem, pose
from accelstudy.diagnosis.decision.refits import best_refit
from accelstudy.diagnosis.evidence.bounds import within_bounds
from accelstudy.diagnosis.evidence.candidates import (
    UNKNOWN,
    Cause,
    Singles,
    classes_of,
    equivalents,
    unknown_beside,
    weigh_singles,
)
from accelstudy.diagnosis.evidence.detection import Chance, Detection, detect
from accelstudy.diagnosis.evidence.noise_models import colour_densities
from accelstudy.diagnosis.evidence.noise_tests import (
    AXES,
    COLOUR,
    LEVEL,
    NOISES,
    TAILS,
    most_evidence,
    tail_test,
)
from accelstudy.diagnosis.evidence.sets import set_prior, weigh_sets
from accelstudy.diagnosis.evidence.size import log_mean
from accelstudy.diagnosis.rules import RULES
from accelstudy.diagnosis.space.hypotheses import Hypothesis, cosines
from accelstudy.effects import effect_names


@dataclass(frozen=True)
class Explanation:
    """One thing that could be the case, or several together.

    Attributes
    ----------
    causes : tuple of Cause
    log_weight : float, log of density times prior weight
    posterior : float, probability given that something is missing, among those that are compared
    """

    causes: tuple[Cause, ...]
    log_weight: float = np.nan
    posterior: float = np.nan

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the causes."""
        return tuple(one.name for one in self.causes)

    @property
    def classes(self) -> tuple[tuple[str, ...], ...]:
        """The names that mean the same in this campaign, for each name."""
        return tuple(one.members for one in self.causes)

    @property
    def best(self) -> tuple[Hypothesis, ...]:
        """Shapes that explain most; empty if noise or something unknown is among them."""
        shapes = tuple(one.best for one in self.causes if one.best is not None)
        return shapes if len(shapes) == len(self.causes) else ()

    @property
    def is_effects(self) -> bool:
        """Whether it is of effects alone."""
        return all(members[0] in effect_names() for members in self.classes)

    @property
    def is_noise(self) -> bool:
        """Whether nothing is wrong but the noise."""
        return self.names[0] in NOISES


NOT_LISTED = Cause(UNKNOWN, (UNKNOWN,))
"""Something unknown."""


def rank_explanations(explanations: Iterable[Explanation]) -> tuple[Explanation, ...]:
    """Explanations that exclude each other, with their probabilities, most probable first."""
    order = sorted(explanations, key=lambda one: -one.log_weight)
    p = special.softmax([one.log_weight for one in order]).tolist()
    return tuple(replace(one, posterior=share) for one, share in zip(order, p, strict=True))


def credible_set(explanations: Iterable[Explanation]) -> tuple[Explanation, ...]:
    """Most probable of explanations that exclude each other, until they hold 0.9 together."""
    chosen: list[Explanation] = []
    for explanation in sorted(explanations, key=lambda one: -one.posterior):
        chosen.append(explanation)
        if sum(one.posterior for one in chosen) >= RULES.credible:
            break
    return tuple(chosen)


@dataclass(frozen=True)
class Posterior:
    """Probabilities given that something is missing or wrong.

    Attributes
    ----------
    all : tuple of Explanation, that exclude each other, most probable first
    """

    all: tuple[Explanation, ...]

    @classmethod
    def of(cls, weighed: Sequence[Explanation]) -> Posterior:
        """Gather them; those that mean the same in this campaign become one."""
        merged: dict[tuple[tuple[str, ...], ...], Explanation] = {}
        for one in sorted(weighed, key=lambda one: -one.log_weight):
            key = tuple(sorted(one.classes))
            same = merged.setdefault(key, one)
            if same is not one:
                total = float(np.logaddexp(same.log_weight, one.log_weight))
                merged[key] = replace(same, log_weight=total)
        return cls(rank_explanations(merged.values()))

    @cached_property
    def reported(self) -> tuple[Explanation, ...]:
        """Explanations that are reported, most probable first."""
        noise = next((i for i, one in enumerate(self.all) if one.is_noise), None)
        size, parts = self._size, dict[tuple[tuple[str, ...], ...], int]()
        for i, one in enumerate(self.all):
            if one.best and len(one.names) == size:
                parts[tuple(sorted(one.classes))] = i
        counted = {i: float(one.log_weight) for i, one in enumerate(self.all)}
        for i, one in enumerate(self.all):
            into = None
            if one.is_noise:
                into = noise
            elif len(one.names) > size:
                within = (tuple(sorted(some)) for some in combinations(one.classes, size))
                into = min((parts[some] for some in within if some in parts), default=None)
            if into is not None and into < i:
                counted[into] = float(np.logaddexp(counted[into], counted.pop(i)))
        return rank_explanations(replace(self.all[i], log_weight=log) for i, log in counted.items())

    @property
    def _size(self) -> int:
        """Number of effects: the least that is more probable than all larger ones together."""
        several = [one for one in self.all if one.best or len(one.names) > 1]
        sizes, posteriors = [len(one.names) for one in several], [one.posterior for one in several]
        each = np.bincount(sizes, weights=posteriors, minlength=2)
        return int(np.argmax(each > np.cumsum(each[::-1])[::-1] - each))

    @property
    def credible_set(self) -> tuple[Explanation, ...]:
        """Smallest set of explanations that holds the truth with a probability of 0.9."""
        return credible_set(self.reported)

    @property
    def p_noise(self) -> float:
        """Probability that nothing is wrong but the noise."""
        return sum(one.posterior for one in self.reported if one.is_noise)

    def doubting(self, names: Collection[str]) -> Posterior:
        """Share what has some names with something unknown that they may only imitate."""
        shared: list[Explanation] = []
        for one in self.all:
            others = [cause for cause in one.causes if cause.name != UNKNOWN]
            kept = [cause for cause in others if not {*cause.members} & {*names}]
            if len(kept) == len(others):
                shared.append(one)
                continue
            imitated = one.log_weight + np.log(RULES.prior_imitated)
            real = one.log_weight + np.log(1 - RULES.prior_imitated)
            unknown = Explanation((*kept, NOT_LISTED), float(imitated))
            shared += [replace(one, log_weight=float(real)), unknown]
        return Posterior.of(shared)


# --- what is weighed ----------------------------------------------------------------------------


@dataclass(frozen=True)
class Alternatives:
    """All that a problem may have missing: the evidence for it, weighed once it is needed.

    Attributes
    ----------
    problem : Problem
    """

    problem: Problem

    @cached_property
    def singles(self) -> Singles:
        """Evidence for each candidate by itself."""
        return weigh_singles(self.problem.examined, self.problem.evidence)

    @cached_property
    def members(self) -> Mapping[str, tuple[str, ...]]:
        """Names that mean the same as each candidate."""
        return equivalents(self.problem.examined, self.singles)

    @cached_property
    def classes(self) -> list[Cause]:
        """Candidates with those that mean the same, strongest evidence first."""
        return classes_of(self.singles, self.members)

    @cached_property
    def alone(self) -> list[Explanation]:
        """Explanations by one effect, one outlying position, or something unknown."""
        each, unknown = -np.log(max(len(self.classes), 1)), self.problem.unknown
        densities = self.singles.densities
        alone = [Explanation((one,), densities[one.name] + each) for one in self.classes]
        if unknown is not None:
            z = self.problem.residuals.z
            density = unknown.log_density(self.problem.evidence, unknown.parts(z), z @ z)
            log = float(density + np.log(self.problem.prior_unknown))
            alone.append(Explanation((NOT_LISTED,), log))
        return alone

    @cached_property
    def sets(self) -> list[Explanation]:
        """Explanations by two or three effects or outlying positions."""
        k, weighed, problem = len(self.classes), [], self.problem
        if k < 2:
            return []
        sets = weigh_sets(self.singles.shapes, problem.residuals, problem.evidence)
        logs = [one.log_density + set_prior(len(one.best), k) for one in sets]
        least = max(logs, default=0.0) - RULES.negligible
        called = {name: one.name for one in self.classes for name in one.members}
        strength = self.singles.densities
        for one, log in zip(sets, logs, strict=True):
            if log < least:
                continue
            best = sorted(one.best, key=lambda h: -strength[h.name])
            effects = [self.members[h.name] for h in best if h.effect is not None]
            if len(set(effects)) == len(effects):
                named = (Cause(called.get(h.name, h.name), self.members[h.name], h) for h in best)
                weighed.append(Explanation(tuple(named), log))
        return weighed

    @cached_property
    def with_unknown(self) -> list[Explanation]:
        """Explanations by something unknown beside the strongest effects and pairs of effects."""
        problem, weighed = self.problem, list[Explanation]()
        unknown = problem.unknown
        if len(self.classes) < 2 or unknown is None:
            return weighed
        singles = [one for one in self.alone if one.best]
        least = max(one.log_weight for one in (*self.alone, *self.sets)) - RULES.sets_within
        pairs = [one for one in self.sets if len(one.best) == 2 and one.log_weight > least]
        pairs.sort(key=lambda one: -one.log_weight)
        prior = float(np.log(RULES.prior_two * problem.prior_unknown))
        for one in (*singles[: RULES.unknown_beside], *pairs[: RULES.unknown_beside]):
            basis = column_basis(np.concatenate([h.basis for h in one.best], axis=1))
            log = unknown_beside(basis, unknown, problem.residuals, problem.evidence)
            if log is not None:
                weighed.append(Explanation((*one.causes, NOT_LISTED), one.log_weight + log + prior))
        return weighed

    def refit(self, chosen: Sequence[Cause]) -> tuple[tuple[Cause, ...], Solution] | None:
        """Fit with those that mean the same as causes and fit best; None without a solution."""
        return best_refit(self.problem.examined, self.singles, chosen)

    def cosine(self, name: str, other: str) -> float:
        """Canonical cosine of the best shapes of two candidates; 0 of what is no candidate."""
        one, two = (self.singles.best.get(each) for each in (name, other))
        return 0.0 if one is None or two is None else float(cosines(one.ideal, two.ideal)[0])


@dataclass(frozen=True)
class Case(Alternatives):
    """A campaign and everything that could explain it, the noise among it.

    Attributes
    ----------
    problem : Problem, that it poses
    campaign : Campaign, with a recognised gross error mended
    chance : Chance, residuals without any effect
    """

    campaign: Campaign
    chance: Chance

    @cached_property
    def detection(self) -> Detection:
        """Whether anything is missing, all candidates together."""
        problem = self.problem
        return detect(problem.field, problem.evidence, problem.residuals, self.chance)

    @cached_property
    def posterior(self) -> Posterior:
        """Probabilities of everything that may be missing or wrong."""
        return Posterior.of([*self.alone, *self.sets, *self.with_unknown, *self.noises])

    @cached_property
    def noises(self) -> list[Explanation]:
        """Explanations by wrong noise alone, one of each kind."""
        problem, by_level = self.problem, self.detection.noise
        nothing = float(np.logaddexp.reduce(by_level))
        # Weighted axes need no further evidence that they differ.
        weighted = problem.frame.solution is not problem.base.solution
        unequal = by_level[0] if weighted else nothing + problem.unequal_axes
        tails = most_evidence(tail_test(problem.residuals, self.chance).p_value)
        logs = {
            COLOUR: np.log(RULES.prior_coloured) + log_mean(self._colours),
            AXES: unequal,
            TAILS: nothing + np.log(RULES.prior_tails) + tails,
        }
        if len(by_level) > 1:
            # More noise than within the holds is an offset from hold to hold.
            name = LEVEL if problem.evidence.level.known else COLOUR
            logs[name] = np.logaddexp(logs.get(name, -np.inf), by_level[1])
        return [Explanation((Cause(name, (name,)),), float(log)) for name, log in logs.items()]

    @property
    def slow(self) -> float:
        """Probability that the noise lasts for some holds, by the evidence alone."""
        by_level, weights = self.detection.noise, self.problem.evidence.level.weights
        fast = max((self._colours[0], *(by_level[1:] - np.log(weights[1:]))))
        return float(special.expit(log_mean(self._colours[1:]) - fast))

    @cached_property
    def _colours(self) -> NDArray[np.float64]:
        """Log densities of the residuals with coloured noise, by its length."""
        return colour_densities(self.problem.residuals, self.problem.evidence)


# --- what is large: to first order it leaves so much that anything seems to be beside it --------


def is_large(problem: Problem, single: Explanation) -> bool:
    """Whether an effect is so large that its signature to first order is not enough."""
    z, basis = problem.residuals.z, single.best[0].basis
    return single.best[0].effect is not None and float(np.sum((z @ basis) ** 2)) > RULES.large


def posterior_by_refits(case: Case, single: Explanation, count: int) -> Posterior:
    """Posterior by refits: of an effect alone, with more in what its refit leaves, and of sets.

    Parameters
    ----------
    case : Case
    single : Explanation, the effect
    count : int, sets of candidates that are refitted, the most probable to first order
    """
    tried = [single, *sorted(case.sets, key=lambda one: -one.log_weight)[:count]]
    refitted = [_weigh_by_refit(case, one) for one in tried]
    alone, solution = refitted[0]
    weighed = [one for one, _ in refitted]
    if solution is not None:
        weighed += _pairs_with(case, alone, solution)
    others = [one for one in case.alone if one.names != single.names]
    return Posterior.of([*weighed, *others, *case.noises])


def _weigh_by_refit(case: Case, one: Explanation) -> tuple[Explanation, Solution | None]:
    """Weigh an explanation by its refit instead of by first order."""
    fit = case.refit(one.causes)
    if fit is None:
        return one, None
    refitted, solution = fit
    z, basis = case.problem.residuals.z, np.concatenate([h.basis for h in one.best], axis=1)
    left = z - basis @ np.linalg.lstsq(basis, z, rcond=None)[0]
    gain = max(float(left @ left) - solution.omega, 0.0)
    parts = float(z @ z - left @ left) + np.array([0.0, gain])
    first, refit = case.problem.evidence.spaces_density(parts, [basis.shape[1]] * 2, z @ z)
    weight = one.log_weight + float(refit - first)
    both = zip(one.causes, refitted, strict=True)
    causes = tuple(replace(cause, best=other.best) for cause, other in both)
    return Explanation(causes, weight), solution


def _pairs_with(case: Case, alone: Explanation, solution: Solution) -> list[Explanation]:
    """One effect with another one, or with something unknown, in what its refit leaves."""
    inner = Alternatives(pose(replace(case.problem.base, solution=solution)))
    problem, z, weighed = inner.problem, inner.problem.residuals.z, list[Explanation]()
    odds = problem.field.odds(problem.evidence, problem.field.project(z)) + alone.log_weight
    for name, log in zip(problem.field.names, odds.tolist(), strict=True):
        cause, more = NOT_LISTED, np.log(problem.prior_unknown)
        if name != UNKNOWN:
            other = problem.examined.candidates[name].strongest(z)
            cause = Cause(name, inner.members[name], other)
            more = within_bounds((other,), z, problem.evidence)[0] - np.log(len(case.classes))
        weight = log + float(more + np.log(RULES.prior_two))
        weighed.append(Explanation((*alone.causes, cause), weight))
    return weighed
