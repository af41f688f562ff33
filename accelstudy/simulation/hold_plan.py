"""The conditions of the holds of a simulated session: time, temperature, vibration, yaw."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from accelstudy.basics import bounds
from accelstudy.basics.arrays import Array
from accelstudy.basics.errors import InputError, check_name
from accelstudy.effects import Effect, HoldConditions
from accelstudy.leveling.angles import roll_pitch
from accelstudy.sensors.models import compose
from accelstudy.sensors.sensor import SensorModel

CHOICES = {"temperature_order": ("linear", "ABBA", "random"), "yaw": ("none", "random")}
RANGES = {"temperature": bounds.TEMPERATURE, "vibration": bounds.VIBRATION}
PROVIDES = {"time": "interval", "temperature": "temperature", "vibration": "vibration"}
"""Column of the holds -> part of the plan without which the holds lack it."""

_STREAM = 1000
"""Number of a stream of its own, so that nothing else draws the same numbers from a seed."""


@dataclass(frozen=True)
class HoldPlan:
    """Conditions of the holds.

    Parameters
    ----------
    interval : float, s between holds; None leaves out the time
    temperature : (float, float), °C, from and to, optional
    temperature_order : "linear", "ABBA" (in quarters of the session) or "random"
    vibration : (float, float), m/s² rms, range from which that of each hold is drawn, optional
    yaw : "none" (zero) or "random"
    seed : int, of the random numbers
    """

    interval: float | None = None
    temperature: tuple[float, float] | None = None
    temperature_order: str = "linear"
    vibration: tuple[float, float] | None = None
    yaw: str = "none"
    seed: int = 1

    def __post_init__(self) -> None:
        for key, choices in CHOICES.items():
            check_name(key, getattr(self, key), choices)
        if self.interval is not None:
            bounds.INTERVAL.check_key("interval", self.interval)
        for key, allowed in RANGES.items():
            for value in getattr(self, key) or ():
                allowed.check_key(key, value)

    def missing(self, effect: Effect) -> str | None:
        """Column that an effect needs and the plan does not provide; None if it provides all."""
        needed = compose(effect.spec, (effect.spec,)).hold_columns
        return next(
            (c for c, key in PROVIDES.items() if c in needed and getattr(self, key) is None), None
        )

    def hold(self, n: int) -> HoldConditions:
        """Return the conditions of n holds, without columns that follow from their attitudes."""
        course = {
            "linear": np.linspace(0, 1, n),
            "ABBA": np.array([0.0, 1.0, 1.0, 0.0])[4 * np.arange(n) // n],
            "random": self._rng(0).uniform(0, 1, n),
        }
        return HoldConditions(
            time=None if self.interval is None else self.interval * np.arange(float(n)),
            temperature=_between(self.temperature, course[self.temperature_order]),
            vibration=_between(self.vibration, self._rng(1).uniform(0, 1, n)),
            yaw=self._rng(2).uniform(-np.pi, np.pi, n) if self.yaw == "random" else np.zeros(n),
        )

    def use(self, forces: Array, n: int) -> HoldConditions:
        """Return the conditions in which a sensor is used after a calibration in n positions.

        Parameters
        ----------
        forces : (k, 3) array, m/s², of the attitudes in which it is used
        n : int

        Returns
        -------
        HoldConditions
            Conditions vary as widely as during the calibration, and the attitudes are taken in
            random order.
        """
        rng = self._rng(3)
        k = len(forces)
        session = None if self.interval is None else (0.0, self.interval * (n - 1))
        roll, pitch = roll_pitch(tuple(forces.T))
        time, temperature, vibration = (
            _between(ends, rng.uniform(0, 1, k))
            for ends in (session, self.temperature, self.vibration)
        )
        order = rng.permutation(k)
        steps = HoldConditions().with_steps(forces[order])
        back = np.argsort(order)
        return replace(
            steps.take(back),
            time=time,
            temperature=temperature,
            vibration=vibration,
            roll=roll,
            pitch=pitch,
            yaw=np.zeros(k),
            order=steps.column("order")[back] if time is None else time,
        )

    def _rng(self, stream: int) -> np.random.Generator:
        return np.random.default_rng(np.random.SeedSequence(self.seed, spawn_key=(_STREAM, stream)))


def check_needs_no_plan(model: SensorModel) -> None:
    """Raise `InputError` if a model needs more of its positions than a scheme tells."""
    for effect in model.effects:
        if column := HoldPlan().missing(effect):
            raise InputError(
                f"the effect {effect.name!r} of the model needs the {column} of each position, "
                "which a scheme does not give; use a measured campaign"
            )


def _between(ends: tuple[float, float] | None, part: Array) -> Array | None:
    """Values between two ends; None without them."""
    return None if ends is None else ends[0] + (ends[1] - ends[0]) * part
