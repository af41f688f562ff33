"""The four states of a calibration, and what holds for every calibration without a robot.

Apart from all code that calculates, so that a change there does not make an overview anew.
"""

ACCEPTED, REJECTED = "accepted", "rejected"
UNCHECKED, IMPLAUSIBLE = "cannot tell", "implausible"

BLIND = (
    "Gravity alone cannot see a rotation of the sensor in its housing: tilts are relative to the "
    "sensor's own axes."
)
