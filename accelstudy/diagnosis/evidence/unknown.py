"""Something in a group of regressors that is none of the effects."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from accelstudy.diagnosis.evidence.size import Evidence, log_mean
from accelstudy.diagnosis.space.hypotheses import Hypothesis
from accelstudy.diagnosis.space.residuals import Residuals
from accelstudy.diagnosis.space.spaces import ABSORBED, Bases, Spaces


def unknown_beside(
    hypothesis: Hypothesis, groups: Mapping[str, Spaces], residuals: Residuals, evidence: Evidence
) -> float | None:
    """Log evidence of something unknown beside a hypothesis, against the hypothesis alone.

    None where no group has a direction of its own beside it.
    """
    q = hypothesis.basis
    left = residuals.z - q @ (q.T @ residuals.z)
    rest = Evidence(evidence.level, residuals.redundancy - hypothesis.dim)
    alone = np.logaddexp.reduce(rest.of_noise(left @ left))
    parts: list[float] = []
    dims: list[int] = []
    for space in groups.values():
        if not isinstance(space, Bases):
            continue
        # The squares of what is left of each direction beside the hypothesis.
        common = q.T @ space.together
        squares, directions = np.linalg.eigh(np.eye(common.shape[1]) - common.T @ common)
        seen = squares > ABSORBED
        if 0 < np.count_nonzero(seen) < rest.redundancy:
            along = left @ space.together @ directions[:, seen]
            parts.append(float(np.sum(along**2 / squares[seen])))
            dims.append(int(np.count_nonzero(seen)))
    if not parts:
        return None
    logs = rest.of_spaces(np.array(parts), dims, left @ left) - alone
    return float(log_mean(logs))
