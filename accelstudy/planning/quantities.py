"""The quantities of a plan: the options of `accelstudy plan`, and keys of its configuration."""

from __future__ import annotations

from accelstudy.basics.units import GON, MGON, Given

DAY = 86400.0

EQUIPMENT = ("gravity", "robot", "both")
MOST_POSITIONS = (4, 400)
REPLICATES = (20, 1_000_000)
"""From how many to how many positions may be the most, and candidates may be simulated."""

QUANTITIES = {
    "tilt_accuracy": Given(
        "rad",
        "",
        "Accuracy wanted of roll and of pitch, as 10mgon or 0.01deg.",
        1e-4 * MGON,
        100 * GON,
    ),
    "tilt_range": Given(
        "rad", "30gon", "Largest tilt at which the sensor is used.", 0.1 * GON, 90 * GON
    ),
    "sigma": Given(
        "m/s^2",
        "",
        "Noise of the mean of a position, as 2mm/s2, if no more is known of the sensor.",
        1e-9,
        10.0,
    ),
    "hold": Given(
        "s",
        "",
        "Duration of a position, as 10s; may be repeated.  [default: 1 s to 120 s; 10 s for "
        "--sigma]",
        0.01,
        DAY,
    ),
    "max_time": Given("s", "", "Longest time in the field, as 20min.", 0.01, DAY),
    "moving_time": Given("s", "20s", "Time from position to position by hand.", most=3600.0),
    "robot_moving_time": Given(
        "s", "10s", "Time from position to position with the robot.", most=3600.0
    ),
    "robot_setup_time": Given("s", "30min", "Time to mount the sensor on the robot.", most=DAY),
    "robot_accuracy": Given(
        "rad",
        "3.2mgon",
        "Standard deviation of the robot's roll and pitch.",
        1e-6 * MGON,
        10 * GON,
    ),
}
