"""Under what conditions the holds of a simulated session are made."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics import bounds
from accelstudy.basics.errors import InputError, UnknownNameError
from accelstudy.effects import Effect, HoldConditions
from accelstudy.leveling.angles import roll_pitch
from accelstudy.sensors.models import compose
from accelstudy.sensors.sensor import SensorModel

Array = NDArray[np.float64]

CHOICES = {"temperature_order": ("linear", "ABBA", "random"), "yaw": ("none", "random")}
RANGES = {"temperature": bounds.TEMPERATURE, "vibration": bounds.VIBRATION}
PROVIDES = {"time": "interval", "temperature": "temperature", "vibration": "vibration"}
"""Columns of the holds that are there only if the plan says so, and what of it does."""

_STREAM = 1000
"""Sets what is drawn here apart from all else that is drawn from the same seed."""


@dataclass(frozen=True)
class HoldPlan:
    """Conditions of the holds.

    Parameters
    ----------
    interval : float, s between holds; None leaves out the time
    temperature : (float, float), °C, from and to, optional
    temperature_order : "linear", "ABBA" (in quarters of the session) or "random"
    vibration : (float, float), m/s² rms, between which it is drawn for each hold, optional
    yaw : "none" (zero) or "random"
    seed : int, of what is drawn
    """

    interval: float | None = None
    temperature: tuple[float, float] | None = None
    temperature_order: str = "linear"
    vibration: tuple[float, float] | None = None
    yaw: str = "none"
    seed: int = 1

    def __post_init__(self) -> None:
        for key, known in CHOICES.items():
            if getattr(self, key) not in known:
                raise UnknownNameError(key, getattr(self, key), known)
        if self.interval is not None:
            bounds.INTERVAL.check_key("interval", self.interval)
        for key, allowed in RANGES.items():
            for value in getattr(self, key) or ():
                allowed.check_key(key, value)

    def missing(self, effect: Effect) -> str | None:
        """Column that an effect needs and the plan does not provide; None if there is all."""
        needed = compose(effect.spec, (effect.spec,)).hold_columns
        return next(
            (c for c, key in PROVIDES.items() if c in needed and getattr(self, key) is None), None
        )

    def hold(self, n: int) -> HoldConditions:
        """Return the holds of a session of n positions, without what follows from attitudes."""
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

    def moved(self, hold: HoldConditions, dt: float) -> HoldConditions:
        """Return conditions a moment later within each hold of a session, s.

        A temperature that rises steadily does so within the holds, too; one that is set is kept.
        """
        assert hold.time is not None
        temperature = hold.temperature
        if temperature is not None and self.temperature_order == "linear":
            span = max(float(np.ptp(hold.time)), dt)
            temperature = temperature + dt / span * (temperature[-1] - temperature[0])
        same = hold.take(np.arange(len(hold.time)))  # with the course of the whole session
        return replace(same, time=hold.time + dt, temperature=temperature)

    def use(self, forces: Array, n: int) -> HoldConditions:
        """Return conditions in which a sensor is used that was calibrated in n positions.

        Parameters
        ----------
        forces : (k, 3) array, m/s², of the attitudes in which it is used
        n : int

        Returns
        -------
        HoldConditions
            The ranges of conditions are those of the calibration, and the attitudes are taken in
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
    """Raise `InputError` if positions alone, those of a scheme, do not feed a model."""
    for effect in model.effects:
        if column := HoldPlan().missing(effect):
            raise InputError(
                f"the effect {effect.name!r} of the model needs the {column} of each position, "
                "which a scheme does not tell; take a campaign"
            )


def _between(ends: tuple[float, float] | None, part: Array) -> Array | None:
    """Values between two ends; None without them."""
    return None if ends is None else ends[0] + (ends[1] - ends[0]) * part
