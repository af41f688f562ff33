"""Quality of a calibration: tests, redundancy, reliability, held-out errors, components."""

from accelstudy.adjustment.quality.components import VarianceComponents, variance_components
from accelstudy.adjustment.quality.prediction import HeldOut, held_out
from accelstudy.adjustment.quality.redundancy import (
    POWER,
    Redundancy,
    Reliability,
    noncentrality,
    redundancy_numbers,
    reliability,
)
from accelstudy.adjustment.quality.solution import (
    Solution,
    column_basis,
    diagonal_blocks,
    root_of,
    solve,
    whitening_of,
)
from accelstudy.adjustment.quality.tests import (
    GlobalTest,
    PositionTests,
    Suspect,
    global_test,
    holm,
    pooled_variance,
    position_tests,
    suspects,
)

__all__ = [
    "POWER",
    "GlobalTest",
    "HeldOut",
    "PositionTests",
    "Redundancy",
    "Reliability",
    "Solution",
    "Suspect",
    "VarianceComponents",
    "column_basis",
    "diagonal_blocks",
    "global_test",
    "held_out",
    "holm",
    "noncentrality",
    "pooled_variance",
    "position_tests",
    "redundancy_numbers",
    "reliability",
    "root_of",
    "solve",
    "suspects",
    "variance_components",
    "whitening_of",
]
