"""What is read of a session: one pass through rig and sensor, and the noise of what comes out."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

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
    def drawn(cls, rng: np.random.Generator) -> Sensor:
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


NOISES = {
    "level": "noise_level",
    "axes": "axis_noise",
    "tails": "heavy_tails",
    "autoregressive": "coloured_noise",
    "offsets": "coloured_noise",
    "coarse": "quantisation",
}
"""Kind of wrong noise -> its name in the catalogue."""
COARSE_SAMPLES = 64
"""Samples that are drawn for the mean of a hold with coarse readings."""


def _axis_factors(sigma: float, rng: np.random.Generator) -> dict[str, float]:
    other = float(rng.choice([1 / rng.uniform(1.5, 2.5), rng.uniform(1.5, 3)]))
    axis = rng.integers(3)
    return {name: other if i == axis else 1.0 for i, name in enumerate("xyz")}


_SETTINGS: Mapping[str, Callable[[float, np.random.Generator], dict[str, float]]] = {
    # What disturbs the means may show within the holds, or not.
    "level": lambda sigma, rng: {
        "factor": rng.uniform(0.6, 0.8) if rng.random() < 0.4 else rng.uniform(1.25, 2.0),
        "within": float(rng.random() < 0.5),
    },
    "axes": _axis_factors,
    "tails": lambda sigma, rng: {"freedom": 4.0},
    "autoregressive": lambda sigma, rng: {"correlation": rng.uniform(0.3, 0.9)},
    "offsets": lambda sigma, rng: {"ratio": rng.uniform(0.7, 2.0)},
    "coarse": lambda sigma, rng: {"step": sigma * rng.uniform(4.0, 12.0)},
}
"""Kind of wrong noise -> a draw of its settings, by the sigma of a position mean."""


@dataclass(frozen=True)
class Noise:
    """The noise of a session.

    Attributes
    ----------
    kind : str, of `NOISES`; None where it is as stated
    settings : dict of str to float
    """

    kind: str | None = None
    settings: dict[str, float] = field(default_factory=dict)

    @classmethod
    def drawn(cls, kind: str | None, session: Session, rng: np.random.Generator) -> Noise:
        """Draw the settings of a kind of noise."""
        return cls(kind, _SETTINGS[kind](session.sigma, rng)) if kind else cls()

    @property
    def axes(self) -> Array:
        """Factors of the sds of the axes, (3,)."""
        return np.array([self.settings.get(axis, 1.0) for axis in ("x", "y", "z")])

    def of_means(self, session: Session, rng: np.random.Generator) -> Array:
        """Errors of the position means, (n, 3), m/s²."""
        shape, sigma = (session.n, 3), session.sigma
        if self.kind == "tails":
            freedom = self.settings["freedom"]
            return np.asarray(
                sigma * rng.standard_t(freedom, shape) / np.sqrt(freedom / (freedom - 2))
            )
        white = rng.standard_normal(shape)
        if self.kind == "autoregressive":
            rho = self.settings["correlation"]
            errors = white.copy()
            for i in range(1, session.n):
                errors[i] = rho * errors[i - 1] + np.sqrt(1 - rho**2) * white[i]
            return sigma * errors
        errors = sigma * self.settings.get("factor", 1.0) * self.axes * white
        if self.kind == "offsets":
            errors += sigma * self.settings["ratio"] * rng.standard_normal(shape)
        return errors

    def read(self, output: Array, session: Session, rng: np.random.Generator) -> Array:
        """Means of the holds (n, 3) of true outputs, as they are read."""
        if self.kind != "coarse":
            return output + self.of_means(session, rng)
        step = self.settings["step"]
        shape = (COARSE_SAMPLES, *output.shape)
        # Too little noise to carry the means from step to step.
        samples = output + self.samples_sd(session)[0] * rng.standard_normal(shape)
        return np.asarray(np.mean(np.round(samples / step), axis=0) * step)

    def samples_sd(self, session: Session) -> Array:
        """True sds of the samples within the holds, (3,), m/s²."""
        if self.kind == "coarse":
            return np.full(3, 0.15 * self.settings["step"])
        within = self.settings.get("factor", 1.0) if self.settings.get("within") else 1.0
        return np.asarray(session.sigma * np.sqrt(session.n_samples) * within * self.axes)

    def sds(self, session: Session, rng: np.random.Generator) -> Array:
        """Sds of the samples within the holds, as they are found, (n, 3), m/s²."""
        freedom = session.n_samples - 1
        ratio = np.sqrt(rng.chisquare(freedom, (session.n, 3)) / freedom)
        sds = self.samples_sd(session) * ratio
        if self.kind == "coarse":
            sds = np.hypot(sds, self.settings["step"] / np.sqrt(12))
        return np.asarray(sds)
