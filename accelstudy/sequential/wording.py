"""Advice in plain words; the sentences stand in `wording.txt.j2`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from accelstudy import pages
from accelstudy.basics.units import attitude_unit, to_attitude
from accelstudy.leveling.angles import roll_pitch
from accelstudy.sensors.frames import FRD, Frame
from accelstudy.sequential.promise import LEAST_REDUNDANCY

if TYPE_CHECKING:
    from accelstudy.sequential.advice import Advice

Array = NDArray[np.float64]

SENTENCES = "sequential/wording.txt.j2"
LEVEL = np.radians(0.5)
"""An axis within this of the horizon is level, one within this of the vertical straight up or
down."""


def advice_lines(advice: Advice) -> list[str]:
    """Write the advice, most important last."""
    log = advice.session.header.log
    return pages.render_lines(
        SENTENCES,
        "lines",
        advice,
        attitude(advice.next, FRD if log is None else log.axes),
        LEAST_REDUNDANCY,
    )


def heading(advice: Advice) -> str:
    """Heading of the advice."""
    (line,) = pages.render_lines(SENTENCES, "heading", advice)
    return line


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
    down = frame.from_frd(direction)
    straight = [i for i in range(3) if abs(down[i]) > np.cos(LEVEL)]
    axes = [_axis("xyz"[i], down[i]) for i in (straight or range(3))]
    return f"{', '.join(angles)} ({', '.join(axes)})"


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
