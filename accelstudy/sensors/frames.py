"""The axes of a sensor by three letters, and the angles that people measure in them.

The letters say where x, y and z point: f or b forward or back, r or l right or left, d or u down
or up. The package computes in ``frd`` (forward, right, down); ``flu`` is that of
ROS (REP 103), ``rfu`` that of phones.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from accelstudy.basics.arrays import Array
from accelstudy.basics.errors import InputError

WAYS = {"f": "forward", "b": "back", "r": "right", "l": "left", "d": "down", "u": "up"}
"""Where an axis points, by the letter of a frame; ways along the axes of frd come first."""


@dataclass(frozen=True)
class Frame:
    """Axes of a sensor.

    Attributes
    ----------
    name : str, three letters
    """

    name: str

    @cached_property
    def matrix(self) -> Array:
        """R with f_frd = R f, (3, 3)."""
        along, against = list(WAYS)[::2], list(WAYS)[1::2]
        letters = np.array(list(self.name))
        return 1.0 * np.equal.outer(along, letters) - np.equal.outer(against, letters)

    @property
    def order(self) -> NDArray[np.int_]:
        """For each axis of frd the axis of the frame that lies along it, (3,)."""
        return np.argmax(np.abs(self.matrix), axis=1)

    @property
    def signs(self) -> Array:
        """For each axis of frd 1 if that axis of the frame points the same way, else −1, (3,).

        These are the signs of roll, pitch and yaw too. In the frame's own convention roll turns
        about its axis forward or back, pitch about the one to the right or left, yaw about the one
        down or up; the sequence of the turns is the same.
        """
        return np.sum(self.matrix, axis=1)

    @property
    def description(self) -> str:
        """Name of the frame, and where its axes point."""
        ways = zip("xyz", self.name, strict=True)
        return f"{self.name}: {', '.join(f'{axis} {WAYS[letter]}' for axis, letter in ways)}"

    def to_frd(self, vectors: ArrayLike) -> Array:
        """Components in frd of vectors (..., 3) in this frame."""
        return self.to_frd_order(np.asarray(vectors, dtype=float)) * self.signs

    def from_frd(self, vectors: ArrayLike) -> Array:
        """Components in this frame of vectors (..., 3) in frd."""
        values = np.asarray(vectors, dtype=float) * self.signs
        return values[..., np.argsort(self.order)]

    def to_frd_order(self, values: NDArray[Any]) -> NDArray[Any]:
        """Put values of the axes, such as their sds, (..., 3), in the order of frd."""
        return values[..., self.order]


def parse_frame(name: str) -> Frame:
    """Frame of three letters.

    Raises
    ------
    InputError
        If the letters do not name each direction once, or make a left-handed frame.
    """
    frame = Frame(name.strip().lower())
    # Not square, or singular, unless three letters name each direction once.
    handed = round(np.linalg.det(frame.matrix)) if len(frame.name) == 3 else 0
    if handed == 0:
        raise InputError(
            f"frame {name!r}: expected three letters that say where x, y and z point: f or b "
            "(forward, back), r or l (right, left), d or u (down, up), as frd or flu"
        )
    if handed < 0:
        other = dict(zip("fbrldu", "bflrud", strict=True))[frame.name[2]]
        raise InputError(
            f"frame {name!r}: is left-handed; with x and y like this z must point the other way: "
            f"{frame.name[:2]}{other}"
        )
    return frame


FRD = parse_frame("frd")


def axes_note(log: str | None) -> str:
    """Say in which axes parameters are, and how those of the log lie in them.

    Parameters
    ----------
    log : str, name of the frame of the log; None without a log
    """
    if log in (None, FRD.name):
        return f"Parameters are in the axes{' of the log,' if log else ''} {FRD.description}."
    frame = parse_frame(str(log))
    signs = frame.from_frd(np.ones(3))
    axes = frame.from_frd(frame.signs * np.arange(3)).astype(int)
    x, y, z = (("−" if s < 0 else "") + "xyz"[i] for s, i in zip(signs, axes, strict=True))
    return (
        f"Parameters are in the axes {FRD.description}. Those of the log are {frame.description}; "
        f"its x, y and z are {x}, {y} and {z} here."
    )
