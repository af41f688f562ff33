"""What most tests calculate with: models, approaches and the sensor of the paper, and gravity."""

import numpy as np
import pytest

from accelstudy.approaches import get_approach
from accelstudy.basics.units import MGON, STANDARD_GRAVITY
from accelstudy.planning import candidates
from accelstudy.sensors.models import get_model

G = STANDARD_GRAVITY
NINE = get_model("bias-scale-nonorthogonality")
TWELVE = get_model("bias-scale-nonorthogonality-crossaxis")
# Thalmann & Neuner (2018), section 4.
PAPER_TRUTH = {
    **{"b_x": 0.05, "b_y": 0.01, "b_z": 0.03, "s_x": 200e-6, "s_y": 200e-6, "s_z": 200e-6},
    **{"alpha_yz": 12 * MGON, "alpha_zy": 12 * MGON, "alpha_zx": 44 * MGON},
}
PAPER = NINE.vector(PAPER_TRUTH)
GRAVITY, ROBOT = get_approach("gravity"), get_approach("robot")
BOTH = pytest.mark.parametrize("approach", [GRAVITY, ROBOT], ids=lambda approach: approach.name)
FEW_SIZES = (9, 12, 20, 30, 40, 80, 120)
FEW_MODELS = ("bias-scale", NINE.name, f"{NINE.name}-quadratic-cubic")
STANDARD_ERRORS = 4.5
"""Within which simulated numbers are to lie."""


def compare_few(patch):
    """Let plans compare schemes of a few sizes and a few models, among which the best ones are."""
    patch.setattr(candidates, "SIZES", FEW_SIZES)
    patch.setattr(candidates, "PLANNED_MODELS", FEW_MODELS)


def share_tolerance(share, n):
    """How far a simulated share of n cases may be off: 3.3 of its standard errors."""
    return 3.3 * np.sqrt(share * (1 - share) / n)
