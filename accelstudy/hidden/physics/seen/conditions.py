"""What a calibration can see: misclosures of unit weight, less what its parameters absorb."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from accelstudy.hidden.physics.forward.measuring import Sensor, level_force, observe
from accelstudy.hidden.physics.forward.session import GRAVITY, Session

Array = NDArray[np.float64]

STEP = 1e-5
"""rad, of numerical derivatives by the angles."""
TRIANGLE = tuple((i, j) for i in range(3) for j in range(i, 3))


@dataclass(frozen=True)
class Conditions:
    """Misclosures of a session that is calibrated with the true parameters of a sensor.

    Attributes
    ----------
    sensor : Sensor
    robot : bool, whether the readings of the encoders are used; else the norm of gravity is
    root : (n, c, c) array, inverse of a lower root of the covariance matrix of the misclosures
    directions : (n, 3) array, unit vectors along the specific force
    absorbed : (m, 9) array, orthonormal, what the nine parameters of a calibration absorb
    """

    sensor: Sensor
    robot: bool
    root: Array
    directions: Array
    absorbed: Array

    @classmethod
    def of(cls, session: Session, approach: str, sensor: Sensor) -> Conditions:
        """Conditions of a session without any effect, at the truth."""
        robot = approach == "robot"
        output, joints = (part[0] for part in observe(session, sensor, ()))
        correction = sensor.correction
        calibrated = (output - sensor.bias) @ correction.T
        directions = calibrated / GRAVITY
        noise = session.sigma**2 * correction @ correction.T
        if robot:
            turned = np.stack([STEP * np.eye(2), -STEP * np.eye(2)])
            ahead, back = level_force(joints[:, None, :] + turned[:, None])
            by_angles = (ahead - back) / (2 * STEP)
            angles = session.sigma_angle**2 * np.swapaxes(by_angles, 1, 2) @ by_angles
            root = np.linalg.inv(np.linalg.cholesky(noise + angles))
        else:
            variance = np.sum((directions @ noise) * directions, axis=1)
            root = 1 / np.sqrt(variance)[:, None, None]
        # A calibrated force is an upper triangular matrix times the output less its bias.
        columns = np.zeros((len(output), 3, 9))
        for column, (i, j) in enumerate(TRIANGLE):
            columns[:, i, column] = output[:, j] - sensor.bias[j]
        columns[:, :, 6:] = correction
        at_truth = cls(sensor, robot, root, directions, np.zeros((0, 9)))
        rows = at_truth._white(columns.transpose(2, 0, 1)).T
        return cls(sensor, robot, root, directions, np.linalg.qr(rows)[0])

    def misclosures(self, output: Array, reading: Array) -> Array:
        """Misclosures (B, m) of unit weight of outputs (B, n, 3) and readings (B, n, 2)."""
        calibrated = (output - self.sensor.bias) @ self.sensor.correction.T
        if self.robot:
            return self._white(calibrated - level_force(reading))
        norms = np.sqrt(np.sum(calibrated**2, axis=-1)) - GRAVITY
        return np.asarray(norms * self.root[:, 0, 0])

    def changed(self, forces: Array) -> Array:
        """Misclosures (B, m) that small changes (B, n, 3) of the outputs make."""
        return self._white(forces @ self.sensor.correction.T)

    def seen(self, output: Array, reading: Array) -> Array:
        """Misclosures (B, m) less what the parameters absorb."""
        return self.left(self.misclosures(output, reading))

    def left(self, misclosures: Array) -> Array:
        """What the parameters leave of misclosures (B, m)."""
        return np.asarray(misclosures - (misclosures @ self.absorbed) @ self.absorbed.T)

    def _white(self, forces: Array) -> Array:
        """Conditions (B, m) of unit weight of changes of forces (B, n, 3)."""
        if not self.robot:
            return np.asarray(np.sum(forces * self.directions, axis=-1) * self.root[:, 0, 0])
        white = np.matmul(self.root, forces[..., None])[..., 0]
        return np.asarray(white.reshape(len(forces), -1))
