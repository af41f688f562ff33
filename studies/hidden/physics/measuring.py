"""What is read of a session: one pass through rig and sensor, and the noise of what comes out."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from studies.hidden.physics.designs import Session
from studies.hidden.physics.geometry import GRAVITY, Array, flange_force, rotated, tilted
from studies.hidden.physics.kinds import OUTPUTS, RIG, Cause


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
    def drawn(cls, rng: Random) -> Sensor:
        """A sensor as consumers buy it: some are good, some are not."""
        grade = np.exp(rng.uniform(np.log(0.1), 0.0))
        bias, scale, lean = rng.standard_normal((3, 3))
        return cls(0.2 * grade * bias, 0.015 * grade * scale, 0.01 * grade * lean)


def observe(session: Session, sensor: Sensor, causes: Sequence[Cause]) -> tuple[Array, Array]:
    """Mean outputs (B, n, 3), m/s², and encoder readings (B, n, 2), rad, without noise."""
    rig = dict(RIG)
    for cause in causes:
        if cause.kind.target in rig:
            rig[cause.kind.target] = rig[cause.kind.target] + cause.change(None, session)
    batch = max((len(cause.parameters) for cause in causes), default=1)
    down = np.broadcast_to([0.0, 0.0, -1.0], (batch, 1, 3))
    base = rotated((GRAVITY + rig["gravity"]) * down, tilted(np.asarray(rig["tilt"])))
    force = flange_force(session.joints + rig["deflection"], session.yaw, base, rig["skew"])
    along = rotated(force, np.asarray(rig["mounting"])) @ sensor.axes.T
    output = (1 + sensor.scale) * along + sensor.bias
    # What clips, clips what all else has made of the force.
    of_output = (cause for cause in causes if cause.kind.target in OUTPUTS)
    for cause in sorted(of_output, key=lambda cause: cause.kind.target == "clipping"):
        force = output if cause.kind.target == "clipping" else along
        output = output + cause.change(force, session)
    return output, session.joints + rig["reading"] + np.zeros((len(output), 1, 1))


COARSE_SAMPLES = 64  # samples that are drawn for the mean of a hold with coarse readings
Random = np.random.Generator


def _axis_factors(sigma: float, rng: Random) -> dict[str, Any]:
    other = float(rng.choice([1 / rng.uniform(1.5, 2.5), rng.uniform(1.5, 3)]))
    axis = rng.integers(3)
    return {"axes": tuple(other if i == axis else 1.0 for i in range(3))}


NOISES: Mapping[str, tuple[str, Callable[[float, Random], dict[str, Any]]]] = {
    # What disturbs the means may show within the holds, or not.
    "level": ("noise_level", lambda sigma, rng: {
        "factor": rng.uniform(0.6, 0.8) if rng.random() < 0.4 else rng.uniform(1.25, 2.0),
        "within": rng.random() < 0.5}),
    "axes": ("axis_noise", _axis_factors),
    "tails": ("heavy_tails", lambda sigma, rng: {"freedom": 4.0}),
    "autoregressive": ("coloured_noise", lambda sigma, rng: {"correlation": rng.uniform(0.3, 0.9)}),
    "offsets": ("coloured_noise", lambda sigma, rng: {"ratio": rng.uniform(0.7, 2.0)}),
    "coarse": ("quantisation", lambda sigma, rng: {"step": sigma * rng.uniform(4.0, 12.0)}),
}  # fmt: skip
"""Kind of wrong noise -> its name in the catalogue, and a draw of its settings, by the sigma of a
position mean."""


@dataclass(frozen=True)
class Noise:
    """The noise of a session; where nothing is given, it is as stated.

    Attributes
    ----------
    kind : str, of `NOISES`; None where it is as stated
    factor : float, of the sds of position means
    within : bool, whether the samples within the holds show this factor
    axes : tuple of float, factors of the sds of the axes
    freedom : float, degrees of freedom of a t distribution; None where it is normal
    correlation : float, of the errors of neighbouring positions
    ratio : float, sd of an offset of each hold over that of its mean
    step : float, m/s², of coarse readings; 0 where they are fine
    """

    kind: str | None = None
    factor: float = 1.0
    within: bool = False
    axes: tuple[float, ...] = (1.0, 1.0, 1.0)
    freedom: float | None = None
    correlation: float = 0.0
    ratio: float = 0.0
    step: float = 0.0

    @classmethod
    def drawn(cls, kind: str | None, session: Session, rng: Random) -> Noise:
        """Draw the settings of a kind of noise."""
        return cls(kind, **NOISES[kind][1](session.sigma, rng)) if kind else cls()

    def read(self, output: Array, session: Session, rng: Random) -> Array:
        """Means of the holds (n, 3) of true outputs, as they are read."""
        shape, sigma, rho = output.shape, session.sigma, self.correlation
        if self.step:
            # Too little noise to carry the means from step to step.
            noise = self.samples_sd(session)[0] * rng.standard_normal((COARSE_SAMPLES, *shape))
            read = np.round((output + noise) / self.step)
            return np.asarray(np.mean(read, axis=0) * self.step)
        if self.freedom is not None:
            sd = np.sqrt(self.freedom / (self.freedom - 2))
            return np.asarray(output + sigma * rng.standard_t(self.freedom, shape) / sd)
        errors = rng.standard_normal(shape)
        for i in range(1, len(errors)):
            errors[i] = rho * errors[i - 1] + np.sqrt(1 - rho**2) * errors[i]
        errors = sigma * self.factor * np.array(self.axes) * errors
        if self.ratio:
            errors += sigma * self.ratio * rng.standard_normal(shape)
        return np.asarray(output + errors)

    def samples_sd(self, session: Session) -> Array:
        """True sds of the samples within the holds, (3,), m/s²."""
        if self.step:
            return np.full(3, 0.15 * self.step)
        within = self.factor if self.within else 1.0
        return session.sigma * np.sqrt(session.n_samples) * within * np.array(self.axes)

    def sds(self, session: Session, rng: Random) -> Array:
        """Sds of the samples within the holds, as they are found, (n, 3), m/s²."""
        freedom = session.n_samples - 1
        ratio = np.sqrt(rng.chisquare(freedom, (session.n, 3)) / freedom)
        sds = self.samples_sd(session) * ratio
        return np.asarray(np.hypot(sds, self.step / np.sqrt(12)) if self.step else sds)
