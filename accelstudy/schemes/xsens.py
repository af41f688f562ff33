"""The positions of a real hand-held calibration."""

from accelstudy.schemes.registry import register

DIRECTIONS = (
    (0.01447, 0.00767, -0.99987),
    (0.99991, 0.00631, 0.01194),
    (-0.00235, 0.99978, 0.02100),
    (0.01015, 0.01787, -0.99979),
    (-0.00904, -0.99975, 0.02051),
    (0.99882, 0.00949, 0.04767),
    (0.02253, -0.20247, 0.97903),
    (-0.01080, 0.99752, 0.06951),
    (0.58498, 0.81095, 0.01257),
    (0.61869, -0.78562, 0.00458),
    (0.95414, -0.29925, -0.00852),
    (-0.03291, 0.91728, -0.39688),
    (0.01111, -0.81939, -0.57312),
    (0.92516, 0.33433, -0.17974),
    (-0.95672, 0.19781, -0.21344),
    (0.53580, -0.84404, 0.02277),
    (0.01640, 0.01472, -0.99976),
    (-0.03256, 0.99808, 0.05271),
    (0.00507, -0.99999, 0.00037),
    (0.00196, -0.20939, 0.97783),
    (0.00783, 0.01606, -0.99984),
    (0.00197, 0.99892, -0.04648),
    (-0.00206, 0.88984, 0.45627),
    (0.02101, 0.01379, -0.99968),
    (0.03084, -0.83870, -0.54372),
    (0.99727, -0.06648, 0.03216),
    (-0.67227, -0.70287, 0.23243),
    (0.99981, 0.00868, 0.01748),
    (0.01947, 0.00697, -0.99979),
    (0.00534, -0.99972, 0.02292),
    (0.01262, 0.00765, -0.99989),
    (0.99961, 0.00982, 0.02619),
    (0.01976, -0.21203, 0.97706),
    (-0.02419, 0.99814, 0.05590),
    (0.99899, 0.01232, 0.04321),
    (-0.01013, 0.87772, -0.47908),
    (0.01175, -0.21024, 0.97758),
    (0.59651, -0.80259, 0.00427),
)


@register(
    "xsens-38",
    title="Xsens log",
    status="exact",
    source="log of an Xsens MTi published with imu_tk, Tedaldi et al. (2014), ICRA, 3042-3049",
)
def xsens() -> tuple[tuple[float, float, float], ...]:
    """The 38 static holds of the log, all of them, in their order.

    Directions of g in the log's own axes: its z axis points up, so that g is along -z when the
    sensor is level, as in the first hold. They are the negative of the specific force of the
    holds' mean counts, calibrated by a least-squares fit of the nine parameters to the norm of
    gravity, and good to 1e-3 rad. Attitudes are repeated in the log, some faces up to seven times.
    """
    return DIRECTIONS
