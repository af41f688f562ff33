"""Attitudes in words, for a person who puts the sensor there."""

from __future__ import annotations

import numpy as np

from accelstudy.basics.arrays import Array
from accelstudy.basics.units import attitude_unit, to_attitude
from accelstudy.leveling.angles import roll_pitch
from accelstudy.sensors.frames import FRD, Frame

LEVEL = np.radians(0.5)
"""An axis within this of the horizon is level, one within this of the vertical straight up or
down."""


def attitude(direction: Array, frame: Frame = FRD) -> str:
    """Describe an attitude by roll and pitch, and by the directions of its axes.

    Parameters
    ----------
    direction : (3,) array, of gravity in frd
    frame : Frame, of the axes that a person knows
    """
    roll, pitch = frame.signs[:2] * np.array(roll_pitch(tuple(-direction)))
    if roll < -np.pi + LEVEL:  # −π and π are the same roll: show the positive one
        roll += 2 * np.pi
    upright = np.hypot(direction[1], direction[2]) < np.sin(LEVEL)
    angles = [] if upright else [f"roll {_angle(roll)}"]
    angles.append(f"pitch {_angle(pitch)}")
    return f"{', '.join(angles)} ({axes_in_words(direction, frame)})"


def axes_in_words(direction: Array, frame: Frame = FRD) -> str:
    """Describe an attitude by the directions of its axes; parameters as of `attitude`."""
    down = frame.from_frd(direction)
    straight = [i for i in range(3) if abs(down[i]) > np.cos(LEVEL)]
    return ", ".join(_axis("xyz"[i], down[i]) for i in (straight or range(3)))


def _axis(name: str, down: float) -> str:
    angle = np.arcsin(np.clip(down, -1, 1))
    if abs(angle) < LEVEL:
        return f"{name} axis level"
    way = "down" if angle > 0 else "up"
    if abs(abs(angle) - np.pi / 2) < LEVEL:
        return f"{name} axis straight {way}"
    return f"{name} axis {_angle(abs(angle))} {way}"


def _angle(angle: float) -> str:
    value = round(float(to_attitude(angle)), 1) + 0.0
    return f"{value:g} {attitude_unit()}"
