"""A cause that nobody recorded: residuals that change slowly, where a column is absent.

A temperature that wanders moves the biases. Without a thermometer no effect of the catalogue can
stand for it, so that slow noise does, and drifts that look like it. Neither shows that the sensor
model is adequate.
"""

from __future__ import annotations

from dataclasses import replace

from accelstudy.basics.wording import comma_list
from accelstudy.diagnosis.decision import priors
from accelstudy.diagnosis.decision.posterior import Posterior, Weighing
from accelstudy.diagnosis.decision.problem import Problem
from accelstudy.diagnosis.decision.verdict import Finding
from accelstudy.diagnosis.evidence.field import UNKNOWN
from accelstudy.diagnosis.evidence.noise_tests import COLOUR
from accelstudy.effects import effect_names, get_effect

ASKED = {"temperature": "the temperature at the sensor", "time": "the time of each hold"}
"""What to record, by the column that is absent."""


def with_unrecorded(problem: Problem, weighing: Weighing, finding: Finding) -> Finding:
    """Say it where noise, or nothing with a name, may be an effect of what was not recorded.

    Parameters
    ----------
    problem : Problem
    weighing : Weighing, of the same
    finding : Finding
    """
    posterior, absent = finding.posterior, problem.absent
    if finding.verdict not in ("noise_model", "unknown") or not absent or posterior is None:
        return finding
    shares = zip(posterior.all, posterior.probabilities, strict=True)
    coloured = sum(p for one, p in shares if one.names == (COLOUR,))
    slow, finding = weighing.slow * coloured, replace(finding, coloured=coloured)
    if finding.verdict == "noise_model":
        enough = coloured >= posterior.of_noise / 2
    else:
        enough = slow + _of_courses(problem, posterior) >= priors.SURE
    if not enough:
        return finding
    of = "temperature or time" if "temperature" in absent else "time"
    asked = [ASKED[name] for name in absent]
    if not problem.repeated:
        asked.append("repeats of one attitude in between")
    if finding.verdict == "unknown" or weighing.slow >= priors.SURE:
        noise = "slow noise"
    elif weighing.slow <= 1 - priors.SURE:
        noise = "noise that differs from hold to hold"
    else:
        noise = "noise that is slow or differs from hold to hold"
    clauses = (
        f"{noise}, or an effect of {of} that these columns cannot tell",
        finding.reason,
        f"{comma_list(asked)} would show which",
    )
    return replace(finding, reason="; ".join(clauses), unrecorded=True)


def _of_courses(problem: Problem, posterior: Posterior) -> float:
    """Probability of effects of time or temperature, and of something unknown like them."""
    courses = {name for name in effect_names() if get_effect(name).is_course}
    unknown = problem.field.unknown
    if unknown is not None:
        places = unknown.by_place(problem.evidence, problem.residuals.z)
        if max(places, key=places.__getitem__)[0] in ("time", "temperature"):
            courses.add(UNKNOWN)
    told = posterior.explanations
    return sum(one.posterior for one in told if courses.issuperset(one.names))
