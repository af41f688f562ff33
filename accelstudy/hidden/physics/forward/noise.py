"""Noise of the position means and of the samples behind them, right and wrong."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from accelstudy.hidden.physics.forward.session import Session

Array = NDArray[np.float64]

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
        if kind is None:
            return cls()
        if kind == "level":
            below = rng.random() < 0.4
            factor = rng.uniform(0.6, 0.8) if below else rng.uniform(1.25, 2.0)
            # What disturbs the means may show within the holds, or not.
            return cls(kind, {"factor": factor, "within": float(rng.random() < 0.5)})
        if kind == "axes":
            factors = np.ones(3)
            factors[rng.integers(3)] = rng.choice([1 / rng.uniform(1.5, 2.5), rng.uniform(1.5, 3)])
            return cls(kind, dict(zip(("x", "y", "z"), factors.tolist(), strict=True)))
        if kind == "tails":
            return cls(kind, {"freedom": 4.0})
        if kind == "autoregressive":
            return cls(kind, {"correlation": rng.uniform(0.3, 0.9)})
        if kind == "offsets":
            return cls(kind, {"ratio": rng.uniform(0.7, 2.0)})
        if kind == "coarse":
            return cls(kind, {"step": session.sigma * rng.uniform(4.0, 12.0)})
        raise ValueError(f"there is no kind of noise {kind!r}; there are {', '.join(NOISES)}")

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
        found = np.sqrt(rng.chisquare(freedom, (session.n, 3)) / freedom)
        sds = self.samples_sd(session) * found
        if self.kind == "coarse":
            sds = np.hypot(sds, self.settings["step"] / np.sqrt(12))
        return np.asarray(sds)
