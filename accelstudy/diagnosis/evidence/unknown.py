"""Something in a group of regressors that is none of the effects."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from accelstudy.diagnosis.evidence.size import Evidence, log_mean
from accelstudy.diagnosis.space.hypotheses import Hypothesis
from accelstudy.diagnosis.space.residuals import Residuals
from accelstudy.diagnosis.space.spaces import ABSORBED, Bases, Spaces, span


def unknown_beside(
    hypothesis: Hypothesis, groups: Mapping[str, Spaces], residuals: Residuals, evidence: Evidence
) -> float | None:
    """Log evidence of something unknown beside a hypothesis, against the hypothesis alone.

    None where no group has anything beside it.
    """
    q = hypothesis.basis
    left = residuals.z - q @ (q.T @ residuals.z)
    rest = Evidence(evidence.level, residuals.redundancy - hypothesis.dim)
    alone = np.logaddexp.reduce(rest.of_noise(left @ left))
    logs = []
    for space in groups.values():
        if not isinstance(space, Bases):
            continue
        beside = space.together - q @ (q.T @ space.together)
        basis = span(beside, np.ones(beside.shape[1]), ABSORBED**0.5)[1]
        if 0 < basis.shape[1] < rest.redundancy:
            part = np.array([np.sum((left @ basis) ** 2)])
            logs.append(float(rest.of_spaces(part, [basis.shape[1]], left @ left)[0] - alone))
    return float(log_mean(np.array(logs))) if logs else None
