"""The quantities that the keywords of a plan are, with their limits."""

from __future__ import annotations

from accelstudy.basics.units import GON, MGON, InputQuantity

DAY = 86400.0

MOST_POSITIONS = (4, 400)
REPLICATES = (20, 1_000_000)
"""From how many to how many positions may be the most, and candidates may be simulated."""

QUANTITIES = {
    "tilt_accuracy": InputQuantity("rad", 1e-4 * MGON, 100 * GON),
    "tilt_range": InputQuantity("rad", 0.1 * GON, 90 * GON),
    "sigma": InputQuantity("m/s^2", 1e-9, 10.0),
    "hold": InputQuantity("s", 0.01, DAY),
    "max_time": InputQuantity("s", 0.01, DAY),
    "moving_time": InputQuantity("s", most=3600.0),
    "robot_moving_time": InputQuantity("s", most=3600.0),
    "robot_setup_time": InputQuantity("s", most=DAY),
    "robot_sigma": InputQuantity("rad", 1e-6 * MGON, 10 * GON),
}
