"""How calibrations are judged in every command and on every page: level, tilts and states.

Apart from all code that calculates, so that a change there does not make an overview anew.
"""

REFUTATION_LEVEL = 0.01
"""Level at which residuals refute a stated sigma."""

MAX_TILT_GON = 50.0
"""Tilt up to which errors of roll and pitch are averaged, unless another is given."""

ACCEPTED, REJECTED = "accepted", "rejected"
UNCHECKED, IMPLAUSIBLE = "cannot tell", "implausible"
"""The four states of a calibration."""

BLIND = (
    "Gravity alone cannot see a rotation of the sensor in its housing: tilts are relative to the "
    "sensor's own axes."
)
"""What holds for every calibration without a robot."""
