"""The verdict: which explanation of the posterior is given."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import special

from accelstudy.adjustment.quality import Solution
from accelstudy.basics.levels import REFUTED
from accelstudy.basics.wording import comma_list, words
from accelstudy.diagnosis.decision import priors
from accelstudy.diagnosis.decision.explanations import Explanation
from accelstudy.diagnosis.decision.posterior import Posterior, Weighed, of_effects
from accelstudy.diagnosis.decision.search import Search
from accelstudy.diagnosis.evidence.field import UNKNOWN
from accelstudy.diagnosis.evidence.noise.kinds import LEVEL, NOISES
from accelstudy.diagnosis.space.examined import ExaminedFit, examine
from accelstudy.diagnosis.space.groups import LACK_OF_FIT
from accelstudy.diagnosis.space.hypotheses import Hypothesis
from accelstudy.diagnosis.space.repeats import clusters
from accelstudy.diagnosis.space.residuals import Residuals
from accelstudy.diagnosis.space.spaces import LackOfFit, Spaces

LARGE = 300.0
"""Noncentrality beyond which first order is not enough, and a refit judges an effect."""


@dataclass(frozen=True)
class Choice:
    """A hypothesis that was chosen.

    Attributes
    ----------
    best : Hypothesis
    members : tuple of str, names that mean the same in this campaign
    probability : float, posterior
    """

    best: Hypothesis
    members: tuple[str, ...]
    probability: float


@dataclass(frozen=True)
class Finding:
    """What a search found.

    Attributes
    ----------
    verdict : str, "no_effect", "named", "narrowed", "gross_error", "noise_model" or "unknown"
    examined : ExaminedFit, of the fit with what was chosen, or of the base fit
    reason : str
    chosen : tuple of Choice
    posterior : Posterior or None, where something is missing
    says_the_level : bool, whether the reason says how large the residuals are
    """

    verdict: str
    examined: ExaminedFit
    reason: str = ""
    chosen: tuple[Choice, ...] = ()
    posterior: Posterior | None = None
    says_the_level: bool = False

    @property
    def credible_set(self) -> tuple[Explanation, ...]:
        """Smallest set of explanations that holds what is missing."""
        return () if self.posterior is None else self.posterior.credible_set


def find(search: Search) -> Finding:
    """Say what is missing, given that something is."""
    posterior = search.posterior
    strongest = next((one for one in posterior.all if len(one.best) == 1), None)
    if strongest is not None and _is_large(search, strongest):
        posterior = _judged_by_refits(search, strongest)
    top = posterior.top
    if not top.best:
        return _without_a_fit(search, posterior)
    fit = search.refits.best(list(zip(top.best, top.classes, strict=True)))
    if fit is None:
        reason = f"{_explained(top.names)} most of it, but a model with it has no solution"
        return Finding("unknown", search.examined, reason, posterior=posterior)
    best, solution = fit
    left = _misfit(search, solution)
    if left:
        said = comma_list([words(name) for name in top.names])
        reason = f"with {said} added, the residuals are still {left}"
        return Finding("unknown", search.examined, reason, posterior=posterior)
    return _with_a_fit(search, posterior, best, solution)


def _with_a_fit(
    search: Search, posterior: Posterior, best: Sequence[Hypothesis], solution: Solution
) -> Finding:
    """Judge the most probable explanation, which has a fit."""
    top, probability = posterior.top, posterior.explanations[0].posterior
    chosen = tuple(
        sorted(
            (Choice(h, m, probability) for h, m in zip(best, top.classes, strict=True)),
            key=lambda choice: choice.best.effect is not None,
        )
    )
    credible = posterior.credible_set
    if probability >= priors.SURE:
        verdict = "gross_error" if chosen[0].best.effect is None else "named"
    elif len(credible) <= priors.MANY and _of_effects(credible) >= priors.SURE:
        verdict = "narrowed"
    else:
        return _without_a_fit(search, posterior)
    return Finding(verdict, examine(solution), "", chosen, posterior)


def _of_effects(credible: Sequence[Explanation]) -> float:
    """Probability of the explanations by effects alone."""
    return sum(one.posterior for one in credible if of_effects(one))


def _without_a_fit(search: Search, posterior: Posterior) -> Finding:
    """Judge where no effect or set of effects is probable enough."""
    first = posterior.explanations[0]
    if first.names[0] in NOISES and first.posterior >= priors.SURE:
        return Finding(
            "noise_model",
            search.examined,
            NOISES[first.names[0]],
            posterior=posterior,
            says_the_level=first.names[0] == LEVEL,
        )
    if UNKNOWN in first.names:
        reason = "no effect or pair of effects of the catalogue explains it"
    else:
        second = comma_list([words(name) for name in posterior.explanations[1].names])
        reason = (
            f"{_explained(first.names)} it with a probability of {first.posterior:.2f} only, and "
            f"{second} with {posterior.explanations[1].posterior:.2f}"
        )
    return Finding("unknown", search.examined, reason, posterior=posterior)


def _explained(names: Sequence[str]) -> str:
    """One or two names with the verb that belongs to them."""
    return f"{comma_list([words(name) for name in names])} explain{'s' if len(names) == 1 else ''}"


def _is_large(search: Search, top: Weighed) -> bool:
    """Whether an effect is so large that its signature to first order is not enough."""
    z, basis = search.residuals.z, top.best[0].basis
    return top.best[0].effect is not None and float(np.sum((z @ basis) ** 2)) > LARGE


def _judged_by_refits(search: Search, single: Weighed) -> Posterior:
    """Posterior where an effect is large: it alone, or with another one in what its refit leaves.

    To first order a large effect leaves so much that anything would seem to be beside it.
    """
    pairs = [one for one in search.pairs if len(one.best) == 2]
    refitted = [_refitted(search, one) for one in (single, *sorted(pairs, key=_weight)[-1:])]
    found = [one for one, _ in refitted]
    alone, solution = refitted[0]
    if solution is not None:
        found += _beside(search, alone, solution)
    others = [one for one in search.singles if one.best and one.names != single.names]
    return Posterior.of([*found, *others, *search.noises])


def _weight(one: Weighed) -> float:
    return one.log_weight


def _refitted(search: Search, one: Weighed) -> tuple[Weighed, Solution | None]:
    """Weigh an explanation by its refit instead of by first order."""
    fit = search.refits.best(list(zip(one.best, one.classes, strict=True)))
    if fit is None:
        return one, None
    best, solution = fit
    z, basis = search.residuals.z, np.concatenate([h.basis for h in one.best], axis=1)
    left = z - basis @ np.linalg.lstsq(basis, z, rcond=None)[0]
    # The refit is one of the means; of slopes it takes up what first order does.
    means = left[: len(search.residuals.positions.design)]
    gain = max(float(means @ means) - solution.omega, 0.0)
    parts = float(z @ z - left @ left) + np.array([0.0, gain])
    first, refit = search.evidence.of_spaces(parts, [basis.shape[1]] * 2, z @ z)
    weight = one.log_weight + float(refit - first)
    return replace(one, log_weight=weight, best=tuple(best)), solution


def _beside(search: Search, alone: Weighed, solution: Solution) -> list[Weighed]:
    """One effect with another one, or with something unknown, in what its refit leaves."""
    inner = Search(solution, search.seed, search.level, search.within)
    z, field = inner.residuals.z, inner.field
    nothing = float(np.logaddexp.reduce(inner.evidence.of_noise(z @ z)))
    logs = field.densities(inner.evidence, z) - nothing + alone.log_weight
    k = max(len(search.classes), 1)
    found = []
    for name, log in zip(field.names, logs.tolist(), strict=True):
        if name == UNKNOWN:
            weight = log + float(np.log(priors.TWO * priors.UNKNOWN))
            names, classes = (*alone.names, UNKNOWN), (*alone.classes, (UNKNOWN,))
            found.append(Weighed(names, classes, weight))
            continue
        other = inner.first_shape(name)
        both = (*alone.classes, inner.members(other))
        weight = log + float(np.log(priors.TWO / k))
        found.append(Weighed((*alone.names, name), both, weight, (*alone.best, other)))
    return found


def _misfit(search: Search, solution: Solution) -> str:
    """Say how much larger than the noise the residuals still are; empty if they are not.

    The noise is the given sigma. Where none is given, or where repeated positions refute it even
    after the refit, it is the difference of repeated positions.
    """
    known = search.level.known
    if known and 2 * float(special.chdtrc(solution.redundancy, solution.omega)) >= REFUTED:
        return ""
    ratio = float(np.sqrt(solution.omega / solution.redundancy))
    than_stated = f"{ratio:.2g} times the stated noise" if known else ""
    left = Residuals.of(solution)
    labels = clusters(search.examined.frame.forces)
    if len(labels) != len(solution.misclosures) or len(np.unique(labels)) == len(labels):
        return than_stated
    square, freedom = _of_repeats(left, LackOfFit.of(left, labels))
    if not freedom or (known and special.chdtrc(freedom, square) >= REFUTED / 2):
        return than_stated
    if _of_fit(left, square, freedom) >= REFUTED:
        return ""
    ratio = float(np.sqrt(solution.omega / solution.redundancy / (square / freedom)))
    return than_stated or f"{ratio:.2g} times what repeated positions differ by"


def lack_of_fit(search: Search) -> float:
    """p-value of the test whether repeats agree better with each other than with the model."""
    if LACK_OF_FIT not in search.groups:
        return 1.0
    return _of_fit(search.residuals, *_of_repeats(search.residuals, search.groups[LACK_OF_FIT]))


def _of_fit(residuals: Residuals, square: float, freedom: int) -> float:
    """F test of all but the differences of repeats against these differences."""
    rest = residuals.redundancy - freedom
    if not freedom or not rest:
        return 1.0
    ratio = (float(residuals.z @ residuals.z) - square) / rest / (square / freedom)
    return float(special.fdtrc(rest, freedom, ratio))


def _of_repeats(residuals: Residuals, same: Spaces) -> tuple[float, int]:
    """Square of the differences of repeated positions, and its degrees of freedom."""
    square = float(residuals.z @ residuals.z) - float(same.parts(residuals.z)[0])
    return max(square, 0.0), residuals.redundancy - int(same.dims[0])
