"""What the model of a lot lacks: whether anything, what, in how many sensors, and which are odd."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeAlias

import numpy as np

from accelstudy.basics.errors import InputError
from accelstudy.diagnosis.decision.problem import BaseFit
from accelstudy.lots.evidence import Sensor, SensorEvidence
from accelstudy.lots.file_format import Alternative, OddSensor, SensorState
from accelstudy.lots.noise import NoisePrior, noises_of_lot
from accelstudy.lots.passes import LEVEL, MIN_HAVING, LotEffect, Pass, find_odd
from accelstudy.lots.processes import processes
from accelstudy.sensors.models import get_model
from accelstudy.sensors.sensor import SensorModel

Weighing: TypeAlias = Callable[[Sequence[LotEffect]], Pass]
"""Weighs all sensors with some effects in their models."""

LEVEL_OF_REST = 0.01
"""Level of the test whether the model of a lot lacks more than what was found."""
ODD = "odd"
"""Name of an effect that one sensor has, and neither the model nor the other sensors."""
MAX_EFFECTS = 3
"""Largest number of effects that are added to the model, one after the other."""


@dataclass(frozen=True, eq=False)
class LotDiagnosis:
    """What the model of a lot lacks.

    Attributes
    ----------
    passes : tuple of Pass: by what each campaign says of its noise; then, by the noise of the lot,
        with the model and all that was found before, until nothing new is found
    model : SensorModel, with `effects`
    effects : tuple of LotEffect, in the order in which they were found
    close : tuple of names, which come closest to what has no name
    explained : bool; if false, the sensors have something in common that no names explain
    """

    passes: tuple[Pass, ...]
    model: SensorModel
    effects: tuple[LotEffect, ...] = ()
    close: tuple[tuple[str, ...], ...] = ()
    explained: bool = True

    @property
    def last(self) -> Pass:
        """Sensors with all that was found in their models, and their noise by that of the lot."""
        return self.passes[-1]

    @property
    def evidence(self) -> tuple[SensorEvidence, ...]:
        """Evidence of each campaign by itself."""
        return self.passes[0].evidence

    @property
    def p_value(self) -> float:
        """Probability that sensors without anything missing would show as much evidence."""
        same = self.passes[:1] if self.passes[0].found else self.passes[:2]
        return min(2 * min(one.p_value for one in same), 1.0)

    @property
    def p_value_of_usual(self) -> float:
        """P-value of the sensors that are not odd, beside what was found."""
        return min(2 * self.last.p_value_of_usual, 1.0)

    @property
    def missing(self) -> bool:
        """Whether anything is missing, at one level for the whole lot."""
        return self.p_value < LEVEL

    @property
    def only_odd(self) -> bool:
        """Whether odd sensors alone show that anything is missing."""
        return bool(self.odd) and not self.effects and self.p_value_of_usual >= LEVEL

    @property
    def alternatives(self) -> list[Alternative]:
        """The most probable classes of what has no sure name, with their posterior."""
        return next((one for one in self.passes if one.missing), self.passes[-1]).alternatives

    @cached_property
    def odd(self) -> dict[int, OddSensor]:
        """Odd sensors by their numbers, the surest first.

        They are odd by what the others lack, or by the size of an effect.
        """
        by_size = {
            i: OddSensor(
                campaign=self.evidence[i].campaign,
                posterior=one.other_size[i],
                names=[*one.names],
                by_size=True,
            )
            for one in self.effects
            for i in find_odd(one.other_size)
        }
        every = {**by_size, **self.last.odd}
        return dict(sorted(every.items(), key=lambda item: -round(item[1].posterior, 3)))

    @cached_property
    def each(self) -> list[SensorState]:
        """Names of what the model lacks for each sensor, and their posterior."""
        having = {one.names[0]: one.having for one in self.effects}
        states = list[SensorState]()
        usual = np.prod(
            [1 - self.last.posterior_odd, *(1 - one.other_size for one in self.effects)], 0
        )
        for i, (one, p_usual) in enumerate(zip(self.evidence, usual.tolist(), strict=True)):
            names = [name for name, p in having.items() if p[i] > MIN_HAVING]
            sure = math.prod(max(p[i], 1 - p[i]) for p in having.values())
            if i in self.odd:
                names, p_usual = [*names, ODD], 1 - p_usual
            states.append(SensorState(campaign=one.campaign, names=names, posterior=sure * p_usual))
        return states


def weigh_lot(sensors: Sequence[Sensor], cores: int = 1) -> LotDiagnosis:
    """Say what the model of sensors of one type lacks, by all of them together.

    Parameters
    ----------
    sensors : two or more, of one model
    cores : int, processes that work at once; results do not depend on it

    Raises
    ------
    InputError
        If a process is killed.
    """
    model = sensors[0].model
    with processes(cores, len(sensors)) as mapped:
        passes, effects = [Pass.of(sensors, mapped)], list[LotEffect]()

        def weigh_with(effects: Sequence[LotEffect]) -> Pass:
            """Weigh all sensors with some effects, and with the noise that they tell together."""
            return Pass.of(with_noise_of_lot(sensors_with(effects, sensors)), mapped)

        while True:
            found = passes[-1].found
            new = [] if found is None or found.is_one_of(effects) else [found]
            # The first pass is by what each campaign says of its noise, all others by the lot.
            if len(passes) > 1 and (not new or len(effects) == MAX_EFFECTS):
                break
            chosen = _settle([*effects, *new], weigh_with)
            after = weigh_with(chosen)
            if not after.determined:
                break
            passes, effects = [*passes, after], chosen
        nameless = any(one.spec is None and not one.is_noise for one in effects)
        explained = not nameless and _explained(passes[-1], effects, weigh_with)
    if explained:
        whole = extended(model, [one.spec for one in effects if one.spec])
        return LotDiagnosis(tuple(passes), whole, tuple(effects))
    close = tuple(one.names for one in effects if one.spec)
    return LotDiagnosis(tuple(passes), model, close=close, explained=False)


def _settle(effects: Sequence[LotEffect], weigh_with: Weighing) -> list[LotEffect]:
    """Effects, each as it is found beside the others, as the last one was.

    One effect may imitate the sum of two: beside the second one the first one shows what it is.
    """
    settled, changed = list(effects), False
    for k, before in enumerate(effects):
        others = [*settled[:k], *settled[k + 1 :]]
        if k < len(effects) - 1 or changed:
            found = weigh_with(others).found
            if found is not None and not found.is_one_of(others):
                settled[k] = found
                changed |= found.names[0] not in before.names
    return settled


def _explained(now: Pass, effects: Sequence[LotEffect], weigh_with: Weighing) -> bool:
    """Whether what was found explains the lot, with the most probable of what is not sure."""
    effects = list(effects)
    while now.determined and now.p_value_of_usual < LEVEL_OF_REST:
        best = now.best
        if best.is_noise or best.is_one_of(effects):
            return True
        if best.spec is None or len(effects) >= MAX_EFFECTS:
            return False
        effects.append(best)
        now = weigh_with(effects)
    return now.determined


def with_noise_of_lot(sensors: Sequence[Sensor]) -> list[Sensor]:
    """Sensors with the noise that they tell together."""

    def fit(i: int, sigma: float | None) -> BaseFit | None:
        noise = None if sigma is None else NoisePrior(sigma)
        with suppress(InputError):
            return replace(sensors[i], noise=noise).fit()
        return None

    noises = noises_of_lot(len(sensors), fit)
    return [replace(sensor, noise=noise) for sensor, noise in zip(sensors, noises, strict=True)]


def sensors_with(effects: Sequence[LotEffect], sensors: Sequence[Sensor]) -> list[Sensor]:
    """Sensors with some effects in their models, each with its own times of what is sudden."""
    return [
        replace(sensor, model=extended(sensor.model, [one.specs[i] for one in effects if one.spec]))
        for i, sensor in enumerate(sensors)
    ]


def extended(model: SensorModel, specs: Iterable[str]) -> SensorModel:
    """Model with further effects."""
    return get_model("+".join((*(effect.spec for effect in model.effects), *specs)))
