"""One pass through rig and sensor: what an ideal reading of a real sensor would be."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from accelstudy.hidden.physics.forward.effects import Effect, Rig
from accelstudy.hidden.physics.forward.rotations import in_turned_frame, rotated
from accelstudy.hidden.physics.forward.session import GRAVITY, Session

Array = NDArray[np.float64]


def flange_force(
    joints: Array, yaw: Array | float, force: Array, skew: Array | float = 0.0
) -> Array:
    """Specific force in the frame of the flange, (..., 3), of one in the frame of the base.

    Parameters
    ----------
    joints : (..., 2) array, rad, roll and pitch
    yaw : (...) array, rad
    force : (..., 3) array, m/s²
    skew : (...) array, rad, by which the roll axis is turned about z against the pitch axis
    """
    turned = in_turned_frame(in_turned_frame(force, 2, yaw), 1, joints[..., 1])
    return in_turned_frame(in_turned_frame(turned, 2, skew), 0, joints[..., 0])


def level_force(joints: Array, gravity: Array | float = GRAVITY) -> Array:
    """Specific force in a flange at roll and pitch (..., 2) on a level base, (..., 3)."""
    return flange_force(joints, 0.0, gravity * np.array([0.0, 0.0, -1.0]))


@dataclass(frozen=True)
class Sensor:
    """A linear sensor.

    Attributes
    ----------
    bias : (3,) array, m/s²
    scale : (3,) array, errors of the scale factors
    lean : (3,) array, rad: of the x axis towards y and z, of the y axis towards z
    """

    bias: Array = field(default_factory=lambda: np.zeros(3))
    scale: Array = field(default_factory=lambda: np.zeros(3))
    lean: Array = field(default_factory=lambda: np.zeros(3))

    @property
    def axes(self) -> Array:
        """Unit vectors along the sensitive axes, as rows, (3, 3)."""
        xy, xz, yz = np.sin(self.lean)
        rows = np.array([[0, xy, xz], [0, 0, yz], [0, 0, 0]])
        return np.asarray(rows + np.diag(np.sqrt(1 - np.sum(rows**2, axis=1))))

    @property
    def correction(self) -> Array:
        """Upper triangular matrix that turns outputs without bias into specific forces, (3, 3)."""
        return np.asarray(np.linalg.inv((1 + self.scale)[:, None] * self.axes), dtype=float)

    @classmethod
    def drawn(cls, rng: np.random.Generator) -> Sensor:
        """A sensor as consumers buy it: some are good, some are not."""
        grade = np.exp(rng.uniform(np.log(0.1), 0.0))
        bias, scale, lean = rng.standard_normal((3, 3))
        return cls(0.2 * grade * bias, 0.015 * grade * scale, 0.01 * grade * lean)


@dataclass(frozen=True)
class Cause:
    """An effect with its settings and a batch of its parameters (B, k)."""

    effect: Effect
    settings: dict[str, float]
    parameters: Array


def observe(session: Session, sensor: Sensor, causes: Sequence[Cause]) -> tuple[Array, Array]:
    """Mean outputs (B, n, 3), m/s², and encoder readings (B, n, 2), rad, without noise."""
    rig = Rig()
    for cause in causes:
        if cause.effect.rig is not None:
            cause.effect.rig(rig, cause.parameters[:, None, :], cause.settings, session)
    batch = max((len(cause.parameters) for cause in causes), default=1)
    down = np.broadcast_to([0.0, 0.0, -1.0], (batch, 1, 3))
    base = rotated((GRAVITY + rig.gravity) * down, rig.tilt)
    force = flange_force(session.joints + rig.deflection, session.yaw, base, rig.skew)
    along = rotated(force, rig.mounting) @ sensor.axes.T
    output = (1 + sensor.scale) * along + sensor.bias
    for cause in causes:
        if cause.effect.sensor is not None:
            output = output + cause.effect.sensor(
                along, cause.parameters[:, None, :], cause.settings, session
            )
    return output, session.joints + rig.reading + np.zeros((len(output), 1, 1))
