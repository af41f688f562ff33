"""What a calibration can see of a session, and what an effect leaves in it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from studies.hidden.physics.designs import Session
from studies.hidden.physics.geometry import GRAVITY, Array, level_force
from studies.hidden.physics.kinds import Kind
from studies.hidden.physics.measuring import Sensor, observe

STEP = 1e-5  # rad, of numerical derivatives by the angles


class Conditions:
    """Misclosures of a session, without any effect, that is calibrated by the true sensor.

    Attributes
    ----------
    session : Session; sensor : Sensor
    robot : bool, whether the readings of the encoders are used; else the norm of gravity is
    directions : (n, 3) array, unit vectors along the specific force
    absorbed : (m, 9) array, orthonormal, what the nine parameters of a calibration absorb
    """

    def __init__(self, session: Session, approach: str, sensor: Sensor) -> None:
        self.session, self.sensor, self.robot = session, sensor, approach == "robot"
        output, joints = (part[0] for part in observe(session, sensor, ()))
        correction = sensor.correction
        self.directions = (output - sensor.bias) @ correction.T / GRAVITY
        noise = session.sigma**2 * correction @ correction.T
        if self.robot:
            turned = np.stack([STEP * np.eye(2), -STEP * np.eye(2)])
            ahead, back = level_force(joints[:, None, :] + turned[:, None])
            by_angles = (ahead - back) / (2 * STEP)
            angles = session.sigma_angle**2 * np.swapaxes(by_angles, 1, 2) @ by_angles
            self._root = np.linalg.inv(np.linalg.cholesky(noise + angles))
        else:
            variance = np.sum((self.directions @ noise) * self.directions, axis=1)
            self._root = 1 / np.sqrt(variance)[:, None, None]
        # A calibrated force is an upper triangular matrix times the output less its bias.
        columns = np.zeros((len(output), 3, 9))
        i, j = np.triu_indices(3)
        columns[:, i, np.arange(6)] = (output - sensor.bias)[:, j]
        columns[:, :, 6:] = correction
        self.absorbed = np.linalg.qr(self._white(columns.transpose(2, 0, 1)).T)[0]

    def absorb(self, basis: Array) -> None:
        """Let a calibration absorb what lies in a basis (m, d), too."""
        self.absorbed = np.linalg.qr(np.concatenate([self.absorbed, basis], axis=1))[0]

    def misclosures(self, output: Array, reading: Array) -> Array:
        """Misclosures (B, m) of unit weight of outputs (B, n, 3) and readings (B, n, 2)."""
        calibrated = (output - self.sensor.bias) @ self.sensor.correction.T
        if self.robot:
            return self._white(calibrated - level_force(reading))
        norms = np.sqrt(np.sum(calibrated**2, axis=-1)) - GRAVITY
        return np.asarray(norms * self._root[:, 0, 0])

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
            return np.asarray(np.sum(forces * self.directions, axis=-1) * self._root[:, 0, 0])
        white = np.matmul(self._root, forces[..., None])[..., 0]
        return np.asarray(white.reshape(len(forces), -1))


VISIBLE = 3e-3  # share of an effect that must be left, or it cannot be seen


@dataclass(frozen=True)
class Shape:
    """What an effect with its settings leaves in the misclosures of an ideal sensor.

    Attributes
    ----------
    effect : Kind
    settings : dict of str to float
    directions : (k, d) array, orthonormal combinations of its parameters that can be seen
    basis : (m, d) array, orthonormal
    """

    effect: Kind
    settings: dict[str, float]
    directions: Array
    basis: Array

    @classmethod
    def of(cls, kind: Kind, settings: dict[str, float], left: Array, size: float) -> Shape | None:
        """Shape of what each parameter leaves (k, m); None if that is too little of its size."""
        u, values, vt = np.linalg.svd(left.T, full_matrices=False)
        rank = int(np.sum(values > VISIBLE * size))
        return cls(kind, settings, vt[:rank].T, u[:, :rank]) if rank else None

    def drawn(self, rng: np.random.Generator) -> Array:
        """Parameters (k,) at random, without what cannot be seen and so has no size."""
        parameters = rng.standard_normal(self.effect.k)
        if self.effect.target == "clipping":  # which only takes away
            parameters = abs(parameters)
        return np.asarray(self.directions @ (self.directions.T @ parameters))

    @property
    def dim(self) -> int:
        """Number of dimensions in which it can be seen."""
        return self.basis.shape[1]
