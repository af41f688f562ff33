"""Where a disagreement lives: the share of the excess χ² that each group of regressors takes up."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from accelstudy.diagnosis.evidence.chance import Chance
from accelstudy.diagnosis.space.groups import LACK_OF_FIT
from accelstudy.diagnosis.space.residuals import Residuals
from accelstudy.diagnosis.space.spaces import Spaces

Array = NDArray[np.float64]


def locate(
    found: Mapping[str, Spaces],
    bumped: Spaces | None,
    residuals: Residuals,
    chance: Chance,
    variance: float,
) -> dict[str, float]:
    """Share of the excess χ² in the space of each group, in [0, 1].

    Parameters
    ----------
    found : what `groups` returned
    bumped : hypotheses of single positions, if there are any
    residuals : Residuals
    chance : Chance, residuals without any effect
    variance : float, of unit weight, of the noise
    """
    z = residuals.z
    names = [name for name in found if name != LACK_OF_FIT]
    excess = float(z @ z) / variance - residuals.redundancy
    if excess <= 0:
        return {name: 0.0 for name in (*names, "single_position")}

    def share(part: float, expected: float) -> float:
        return float(np.clip((part / variance - expected) / excess, 0.0, 1.0))

    shares = {n: share(float(found[n].parts(z)[0]), float(found[n].dims[0])) for n in names}
    if bumped is not None:
        usual = chance.statistic(residuals, lambda errors: bumped.parts(errors).max(axis=-1))
        shares["single_position"] = share(float(bumped.parts(z).max()), float(np.mean(usual)))
    return shares
