"""What is certain, whatever else is open: it is added to the model even where a part has no name.

Explanations that share an effect may leave no doubt of it, while none of them is probable enough to
be the answer, or all of them leave a misfit. But where more is missing than the catalogue explains,
an effect of it may only imitate what has no name. That is hardly ever so well done that the effect
explains nearly all there is; what explains less is doubted.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from accelstudy.adjustment.quality import Solution
from accelstudy.diagnosis.decision.posterior import Case, Posterior
from accelstudy.diagnosis.decision.statement import Part, Statement, statement
from accelstudy.diagnosis.decision.verdict import Finding, Reason
from accelstudy.diagnosis.evidence.field import UNKNOWN
from accelstudy.diagnosis.evidence.singles import Cause
from accelstudy.diagnosis.prediction import HeldOutGap
from accelstudy.diagnosis.rules import RULES
from accelstudy.diagnosis.space.frame import Frame
from accelstudy.diagnosis.space.hypotheses import Hypothesis
from accelstudy.effects import effect_names


def add_certain_effects(case: Case, finding: Finding) -> Finding:
    """Say what is certain, and add it to the fit whatever else is missing."""
    posterior = finding.posterior
    assert posterior is not None
    if finding.verdict != "unknown":
        return replace(finding, says=statement(finding.credible_set, case.cosine))
    beyond = sum(one.posterior for one in posterior.all if UNKNOWN in one.names)
    if finding.code == "misfit" or beyond > 1 - RULES.credible:
        posterior = posterior.doubting(_perhaps_imitations(case, posterior))
    says = statement(posterior.all, case.cosine)
    finding = replace(finding, posterior=posterior, says=says)
    chosen = [cause for _, cause in _certain_effects(case, posterior, says)]
    if not chosen:
        return finding
    fit = _fit_of(case, chosen)
    if fit is None:
        return replace(finding, says=Statement((), ()))
    added = tuple(
        Cause(best.name, one.members, best, one.posterior)
        for one, best in zip(chosen, fit[0], strict=True)
    )
    return replace(finding, frame=Frame.of(fit[1]), chosen=added)


def _certain_effects(case: Case, posterior: Posterior, says: Statement) -> list[tuple[Part, Cause]]:
    """Components that are certain and effects, each with its most probable name."""
    chosen = []
    for part in says.certain:
        if (name := part.names[0]).name in effect_names():
            shapes = (h for one in posterior.all for h in one.best if h.name == name.name)
            best = next(shapes, case.singles.best[name.name])
            chosen.append((part, replace(name, best=best, posterior=part.posterior)))
    return chosen


def _perhaps_imitations(case: Case, posterior: Posterior) -> set[str]:
    """Names of what seems certain, and yet does not explain nearly all that is left without it.

    More is missing than the catalogue explains. An effect of it may imitate what is in none, though
    hardly ever nearly all of that.
    """
    seeming = _certain_effects(case, posterior, statement(posterior.all, case.cosine))
    chosen, names = [cause for _, cause in seeming], set[str]()
    after = _disagreement(case, chosen)
    for i, (part, _) in enumerate(seeming):
        without = _disagreement(case, [*chosen[:i], *chosen[i + 1 :]])
        if after > (1 - RULES.nearly_all) * without:
            names |= {name.name for name in part.names}
    return names


def _fit_of(case: Case, chosen: Sequence[Cause]) -> tuple[list[Hypothesis], Solution] | None:
    """Fit with what was chosen, the base fit if that is nothing; None if it has no solution."""
    if not chosen:
        return [], case.problem.frame.solution
    return case.refit(chosen)


def _disagreement(case: Case, chosen: Sequence[Cause]) -> float:
    """Ω that a fit leaves beyond the given noise, all if none is given; ∞ without a solution."""
    fit = _fit_of(case, chosen)
    if fit is None:
        return np.inf
    noise = fit[1].redundancy * float(case.problem.evidence.level.known)
    return max(fit[1].omega - noise, 1e-9)


def withdraw_refuted(case: Case, finding: Finding, held: HeldOutGap) -> Finding:
    """What is said where the held-out positions refute what was chosen: nothing of it is certain.

    Parameters
    ----------
    case : Case
    finding : Finding
    held : HeldOutGap
    """
    reason = finding.reason
    if finding.verdict != "unknown":
        names = [cause.name for cause in finding.chosen]
        reason = Reason.of("refuted", names=names, before=held.before, after=held.after)
    assert finding.posterior is not None
    doubted = [name for cause in finding.chosen for name in cause.members]
    posterior = finding.posterior.doubting(doubted)
    says = Statement((), statement(posterior.all, case.cosine).open)
    return Finding("unknown", case.problem.frame, reason, posterior=posterior, says=says)
