"""The four states of a calibration, and what holds for every calibration without a robot."""

ACCEPTED, REJECTED = "accepted", "rejected"
UNCHECKED, IMPLAUSIBLE = "cannot tell", "implausible"

BLIND = (
    "Gravity alone cannot see a rotation of the sensor in its housing: tilts are relative to the "
    "sensor's own axes."
)
