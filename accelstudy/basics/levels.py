"""How calibrations are judged in every command and on every page: the level, and the states.

Apart from all code that calculates, so that a change there does not make an overview anew.
"""

REFUTATION_LEVEL = 0.01
"""Level at which residuals refute a stated sigma."""

ACCEPTED, REJECTED = "accepted", "rejected"
UNCHECKED, IMPLAUSIBLE = "cannot tell", "implausible"
"""The four states of a calibration."""

BLIND = (
    "Gravity alone cannot see a rotation of the sensor in its housing: tilts are relative to the "
    "sensor's own axes."
)
"""What holds for every calibration without a robot."""
