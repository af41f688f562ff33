"""What calibrations leave of roll and pitch, of their estimates."""

from typing import NamedTuple

import numpy as np

from accelstudy.leveling.error import tilt_error


class LevelingError(NamedTuple):
    """Rms over attitudes of roll and of pitch: of each calibration (R, 2), and of all (2,)."""

    per_replicate: np.ndarray
    rms: np.ndarray


def leveling_error(simulated, truth, estimated, estimates, f_b, *more, **keywords):
    """Propagate the errors of R calibrations, `estimates` (R, u), about their mean."""
    mean = estimates.mean(axis=0)
    each = tilt_error(simulated, truth, estimated, mean, f_b, *more, **keywords).rms(estimates)
    return LevelingError(each, np.sqrt(np.mean(each**2, axis=0)))
