"""One posterior over everything that could be the case once something is missing.

Fewer explanations are told than were weighed (`Posterior.told`). All kinds of wrong noise count as
one, named by the most probable of them. Where one effect is more probable than two, a pair counts
for the more probable of its two effects. "This effect is missing" then leaves open whether a second
one, too small to be seen, is missing as well.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy import special

from accelstudy.campaign.session import Campaign
from accelstudy.diagnosis.decision.problem import Problem
from accelstudy.diagnosis.evidence.detection import Chance, Detection, detect
from accelstudy.diagnosis.evidence.field import UNKNOWN
from accelstudy.diagnosis.evidence.hypotheses import (
    Class,
    Singles,
    Together,
    all_pairs,
    classes_of,
    equivalents,
    unknown_beside,
    weigh_singles,
)
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
from accelstudy.diagnosis.evidence.size import log_mean
from accelstudy.diagnosis.rules import RULES
from accelstudy.diagnosis.space.hypotheses import Hypothesis
from accelstudy.diagnosis.space.shapes import LearnedShapes
from accelstudy.effects import effect_names

SLOW = (("time", "bias"), ("time", "scale"))
"""Places of what follows something that was not recorded, and that slow noise may be, too."""


@dataclass(frozen=True)
class Explanation:
    """One thing that could be the case, or several together.

    Attributes
    ----------
    names : tuple of str: effects, or a noise effect, "outlier_position" or "unknown"
    classes : tuple of tuple of str, the names that mean the same in this campaign, for each name
    log_weight : float, log of density times prior weight
    best : tuple of Hypothesis, shapes that explain most; empty for noise and for the unknown
    posterior : float, probability given that something is missing, among those that are compared
    """

    names: tuple[str, ...]
    classes: tuple[tuple[str, ...], ...]
    log_weight: float = np.nan
    best: tuple[Hypothesis, ...] = ()
    posterior: float = np.nan

    @property
    def of_effects(self) -> bool:
        """Whether it is of effects alone."""
        return all(members[0] in effect_names() for members in self.classes)

    @property
    def of_noise(self) -> bool:
        """Whether nothing is wrong but the noise."""
        return self.names[0] in NOISES


def ranked(explanations: Iterable[Explanation]) -> tuple[Explanation, ...]:
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
        return cls(ranked(merged.values()))

    @cached_property
    def told(self) -> tuple[Explanation, ...]:
        """Those that are told, most probable first."""
        noise = next((i for i, one in enumerate(self.all) if one.of_noise), None)
        single = {
            one.classes[0]: i for i, one in enumerate(self.all) if len(one.names) == 1 and one.best
        }
        more = sum(one.posterior for one in self.all if len(one.names) > 1)
        alone = sum(self.all[i].posterior for i in single.values()) > more
        counted = {i: float(one.log_weight) for i, one in enumerate(self.all)}
        for i, one in enumerate(self.all):
            into = None
            if one.of_noise:
                into = noise
            elif len(one.names) > 1 and alone:
                into = min((single[c] for c in one.classes if c in single), default=None)
            if into is not None and into < i:
                counted[into] = float(np.logaddexp(counted[into], counted.pop(i)))
        return ranked(replace(self.all[i], log_weight=log) for i, log in counted.items())

    @property
    def credible_set(self) -> tuple[Explanation, ...]:
        """Smallest set of explanations that holds the truth with a probability of 0.9."""
        return credible_set(self.told)

    @property
    def of_noise(self) -> float:
        """Probability that nothing is wrong but the noise."""
        return sum(one.posterior for one in self.told if one.of_noise)

    def doubting(self, names: Collection[str]) -> Posterior:
        """Share what has some names with something unknown that they may only imitate."""
        shared: list[Explanation] = []
        for one in self.all:
            others = [members for members in one.classes if members != (UNKNOWN,)]
            kept = [members for members in others if not {*members} & {*names}]
            if len(kept) == len(others):
                shared.append(one)
                continue
            imitated = one.log_weight + np.log(RULES.prior_imitated)
            real = one.log_weight + np.log(1 - RULES.prior_imitated)
            named = tuple(n for n, c in zip(one.names, one.classes, strict=True) if c in kept)
            unknown = Explanation((*named, UNKNOWN), (*kept, (UNKNOWN,)), float(imitated))
            shared += [replace(one, log_weight=float(real)), unknown]
        return Posterior.of(shared)


# --- what is weighed ----------------------------------------------------------------------------


@dataclass(frozen=True)
class Weighing:
    """Everything that could be the case, given that something is wrong.

    Attributes
    ----------
    singles : Singles, the evidence for each candidate by itself
    members : dict of candidate to the names that mean the same
    classes : list of Class, candidates that mean the same together, strongest evidence first
    together : list of Together, the evidence for all pairs of candidates
    alone : list of Explanation, one effect, one bumped position, or something unknown
    pairs : list of Explanation, two of them, or one of them beside something unknown
    noises : list of Explanation, only the noise is wrong, in one of its kinds
    slow : float, probability that the noise lasts for some holds, by the evidence alone
    posterior : Posterior, of all of these
    """

    singles: Singles
    members: Mapping[str, tuple[str, ...]]
    classes: list[Class]
    together: list[Together]
    alone: list[Explanation]
    pairs: list[Explanation]
    noises: list[Explanation]
    slow: float
    posterior: Posterior


@dataclass(frozen=True)
class Case:
    """A campaign and what it has to explain; the evidence for that is weighed once it is needed.

    Attributes
    ----------
    campaign : Campaign, with a recognised gross error mended
    problem : Problem, that it poses
    chance : Chance, residuals without any effect
    """

    campaign: Campaign
    problem: Problem
    chance: Chance

    @cached_property
    def detection(self) -> Detection:
        """Whether anything is missing, all candidates together."""
        problem = self.problem
        return detect(problem.field, problem.evidence, problem.residuals, self.chance)

    @cached_property
    def weighing(self) -> Weighing:
        """Everything that could be the case, weighed."""
        return weigh(self.problem, self.detection, self.chance)


def weigh(problem: Problem, detection: Detection, chance: Chance) -> Weighing:
    """Weigh everything that could be the case.

    Parameters
    ----------
    problem : Problem
    detection : Detection, of the same
    chance : Chance, residuals without any effect
    """
    singles = weigh_singles(problem.examined, problem.field, problem.evidence)
    members = equivalents(problem.examined, singles)
    classes = classes_of(singles, members)
    each = -np.log(max(len(classes), 1))
    alone = [
        Explanation((best.name,), (names,), singles.densities[best.name] + each, (best,))
        for best, names in classes
    ]
    unknown = detection.densities.get(UNKNOWN)
    if unknown is not None:
        alone.append(Explanation((UNKNOWN,), ((UNKNOWN,),), unknown + np.log(RULES.prior_unknown)))
    together = all_pairs(singles.shapes, problem.residuals, problem.evidence)
    pairs = weigh_pairs(together, singles, members, classes)
    pairs += weigh_beside(problem, singles, classes)
    noises, slow = _noises(problem, detection, chance)
    posterior = Posterior.of([*alone, *pairs, *noises])
    return Weighing(singles, members, classes, together, alone, pairs, noises, slow, posterior)


def weigh_pairs(
    together: Iterable[Together],
    singles: Singles,
    members: Mapping[str, tuple[str, ...]],
    classes: Sequence[Class],
) -> list[Explanation]:
    """Weigh candidates together.

    Parameters
    ----------
    together, singles, members, classes : as in `Weighing`
    """
    k = len(classes)
    if k < 2:
        return []
    each = np.log(RULES.prior_two) - np.log(k * (k + 1) / 2)
    called = {name: best.name for best, names in classes for name in names}
    weighed = []
    for one in together:
        best = tuple(sorted(one.best, key=lambda h: -singles.densities[h.name]))
        alike = tuple(members[h.name] for h in best)
        if alike[0] != alike[1] or best[0].effect is None:
            names = tuple(called.get(h.name, h.name) for h in best)
            weighed.append(Explanation(names, alike, one.log_density + each, best))
    return weighed


def weigh_beside(problem: Problem, singles: Singles, classes: Sequence[Class]) -> list[Explanation]:
    """Weigh each of the strongest candidates beside something unknown.

    Parameters
    ----------
    problem : Problem
    singles, classes : as in `Weighing`
    """
    k, unknown, weighed = len(classes), problem.field.unknown, []
    if unknown is None or k < 2:
        return []
    for first, same in classes[: RULES.unknown_beside]:
        beside = unknown_beside(first, unknown, problem.residuals, problem.evidence)
        if beside is not None:
            total = singles.densities[first.name] + beside - np.log(k)
            prior = np.log(RULES.prior_two * RULES.prior_unknown)
            weighed.append(Explanation((first.name, UNKNOWN), (same, (UNKNOWN,)), total + prior))
    return weighed


def _noises(
    problem: Problem, detection: Detection, chance: Chance
) -> tuple[list[Explanation], float]:
    """Weigh each kind of wrong noise, with nothing else missing; and how slow coloured noise is."""
    residuals, evidence, by_level = problem.residuals, problem.evidence, detection.noise
    nothing = float(np.logaddexp.reduce(by_level))
    assert problem.axes is not None
    # Weighted axes need no further evidence that they differ.
    unequal = nothing + np.log(RULES.prior_axes) + problem.axes.log_evidence
    if problem.frame.solution is not problem.base.solution:
        unequal = float(by_level[0])
    tails = tail_test(residuals, chance)
    processes, course = colour_densities(residuals, evidence), -np.inf
    coloured = np.log(RULES.prior_coloured) + log_mean(processes)
    if problem.absent:
        unknown = problem.field.unknown
        courses = LearnedShapes.of(problem.frame, SLOW) if unknown is None else unknown.at(SLOW)
        if courses.places:
            z = residuals.z
            course = float(courses.log_density(evidence, courses.parts(z), z @ z))
        coloured = np.logaddexp(coloured, np.log(RULES.prior_unrecorded) + course)
    logs = {
        COLOUR: coloured,
        AXES: unequal,
        TAILS: nothing + np.log(RULES.prior_tails) + most_evidence(tails.p_value),
    }
    lasting, fast = log_mean(np.array([*processes[1:], course])), processes[0]
    if len(by_level) > 1:
        # More noise than within the holds is an offset from hold to hold.
        name = LEVEL if evidence.level.known else COLOUR
        logs[name] = np.logaddexp(logs.get(name, -np.inf), by_level[1])
        fast = max(fast, by_level[1] - np.log(evidence.level.weights[1]))
    slow = float(special.expit(lasting - fast))
    weighed = [Explanation((name,), ((name,),), float(log)) for name, log in logs.items()]
    return weighed, slow
