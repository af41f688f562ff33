"""A cause that nobody recorded: residuals that change slowly, where a column is absent.

A temperature that wanders moves the biases. Without a thermometer no effect of the catalogue can
stand for it, so that slow noise does, and drifts that look like it. Neither shows that the sensor
model is adequate.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from accelstudy.basics.wording import comma_list
from accelstudy.diagnosis.decision import priors
from accelstudy.diagnosis.decision.posterior import Weighing
from accelstudy.diagnosis.decision.problem import Problem
from accelstudy.diagnosis.decision.verdict import Finding, Named
from accelstudy.diagnosis.evidence.noise_tests import COLOUR
from accelstudy.diagnosis.space.groups import COURSES, REPEAT
from accelstudy.effects import effect_names, get_effect

ASKED = {"temperature": "the temperature at the sensor", "time": "the time of each hold"}
"""What to record, by the column that is absent."""
WORTH = 0.1
"""Probability from which on slow noise is worth a word beside drifts."""


def with_unrecorded(
    problem: Problem, weighing: Weighing, finding: Finding, named: Sequence[Named]
) -> Finding:
    """Say it where noise, or nothing with a name, may be an effect of what was not recorded.

    Parameters
    ----------
    problem : Problem
    weighing : Weighing, of the same
    finding : Finding
    named : what was found, as it is described
    """
    if not problem.absent or not _is_slow(weighing, finding, named):
        return finding
    of = "temperature or time" if "temperature" in problem.absent else "time"
    asked = [ASKED[name] for name in problem.absent]
    if REPEAT not in problem.groups:
        asked.append("repeats of one attitude in between")
    clauses = (
        f"slow noise, or an effect of {of} that these columns cannot tell",
        finding.reason,
        f"{comma_list(asked)} would show which",
    )
    return replace(finding, reason="; ".join(clauses), unrecorded=problem.absent)


def _is_slow(weighing: Weighing, finding: Finding, named: Sequence[Named]) -> bool:
    """Whether what is found changes slowly over the session, and slow noise may be all of it."""
    if finding.verdict == "noise_model":
        return named[0].name == COLOUR and weighing.slow >= priors.MORE_PROBABLE
    if finding.verdict != "unknown" or finding.posterior is None:
        return False
    slow = {COLOUR, *(n for n in effect_names() if get_effect(n).group in COURSES)}
    told = [one for one in finding.posterior.explanations if slow.issuperset(one.names)]
    noise = weighing.slow * sum(one.posterior for one in told if COLOUR in one.names)
    return noise >= WORTH and sum(one.posterior for one in told) >= priors.SURE
