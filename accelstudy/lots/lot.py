"""What the model of a lot lacks: whether anything, what, in how many sensors, and which are odd."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from functools import partial
from multiprocessing import get_context
from threading import Thread
from typing import Any

import numpy as np
from numpy.typing import NDArray

from accelstudy.approaches import Approach
from accelstudy.basics.errors import InputError
from accelstudy.basics.progress import track
from accelstudy.campaign.calibration.fit import usual_approach
from accelstudy.campaign.session import Campaign
from accelstudy.diagnosis.decision.problem import BaseFit, fit_base
from accelstudy.lots.evidence import (
    AnythingOdds,
    SensorEvidence,
    is_noise,
    mean_sensor,
    sensor_evidence,
    together,
)
from accelstudy.lots.mixture import Anything
from accelstudy.lots.noise import SensorNoise, noises_of_lot
from accelstudy.lots.passes import LEVEL, ODD, Found, Odd, Pass
from accelstudy.lots.sizes import TypeSizes, told
from accelstudy.sensors.models import compose, composition_name
from accelstudy.sensors.sensor import SensorModel

Array = NDArray[np.float64]

LEVEL_OF_REST = 0.01
"""Level of the test whether the model of a lot lacks more than what was found."""
MAX_PASSES = 3
"""Most times that what was found is added to the model."""


@dataclass(frozen=True, eq=False)
class Lot:
    """What the model of a lot lacks.

    Attributes
    ----------
    passes : tuple of Pass: by what each campaign says of its noise; then, by the noise of the lot,
        with the model and all that was found before, until nothing new is found
    model : SensorModel, with `effects`
    effects : tuple of (Found, spec or None), in the order in which they were found
    close : tuple of names, which come closest to what has no name
    explained : bool; if false, the sensors have something in common that no names explain
    """

    passes: tuple[Pass, ...]
    model: SensorModel
    effects: tuple[tuple[Found, str | None], ...] = ()
    close: tuple[tuple[str, ...], ...] = ()
    explained: bool = True

    @property
    def sensors(self) -> tuple[SensorEvidence, ...]:
        """Evidence of each campaign by itself."""
        return self.passes[0].sensors

    @property
    def noises(self) -> dict[str, SensorNoise | None]:
        """Noise of each campaign by that of the lot; None where it speaks for itself."""
        last = self.passes[-1]
        noises = last.noises or [None] * len(last.sensors)
        names = [sensor.campaign for sensor in last.sensors]
        return dict(zip(names, noises, strict=True))

    def model_of(self, i: int) -> SensorModel:
        """Model of the type for a sensor, with its own times of what is sudden."""
        return _own(self.model, self.passes, i)

    @property
    def p_value(self) -> float:
        """Probability that sensors without anything missing would show as much evidence."""
        same = self.passes[:1] if self.passes[0].found else self.passes[:2]
        return min(2 * min(one.p_value for one in same), 1.0)

    @property
    def missing(self) -> bool:
        """Whether anything is missing, at one level for the whole lot."""
        return self.p_value < LEVEL

    @property
    def state(self) -> str:
        """State in a word, as the badge of the page has it."""
        return "no_effect" if not self.missing else "named" if self.effects else "unknown"

    @property
    def alternatives(self) -> list[tuple[tuple[str, ...], float]]:
        """The most probable classes of what has no sure name, with their posterior."""
        return next((one for one in self.passes if one.missing), self.passes[-1]).alternatives

    @property
    def odd(self) -> list[Odd]:
        """Odd sensors, with all that was found in the model; the surest first."""
        return self.passes[-1].odd

    @property
    def usual(self) -> list[int]:
        """Numbers of the sensors that are not odd."""
        return self.passes[-1].usual

    def each(self) -> list[tuple[str, tuple[str, ...], float]]:
        """Campaign, names of what the model lacks for it, and their posterior, for each sensor."""
        told = {found.names[0] for found, _ in self.effects}
        rows = []
        for i, sensor in enumerate(self.sensors):
            names, probability = tuple[str, ...](), 1.0
            for k, one in enumerate(self.passes, start=1):
                of_pass, posterior = one.each[i]
                kept = {*told, ODD} if k == len(self.passes) else told
                names += tuple(name for name in of_pass if name in kept)
                probability *= posterior
            rows.append((sensor.campaign, names, probability))
        return rows


def weigh_lot(
    campaigns: Sequence[Campaign],
    model: SensorModel,
    approach: Approach | None = None,
    seed: int = 1,
    cores: int = 1,
) -> Lot:
    """Say what the model of sensors of one type lacks, by all of them together.

    Parameters
    ----------
    campaigns : of the sensors, two or more
    model : SensorModel
    approach : Approach; by default robot-aided where a campaign has the robot's angles
    seed : int, of the draws
    cores : int, processes that work at once; results do not depend on it

    Raises
    ------
    InputError
        If a campaign does not determine the model, or leaves no redundancy.
    """
    with _processes(cores, len(campaigns)) as mapped:
        sensors = _Sensors(campaigns, approach, seed, mapped)
        n = len(campaigns)
        passes, whole = [sensors.weighed([model] * n, model, [None] * n)], model
        effects: list[tuple[Found, str | None]] = []
        new = _new(passes[-1], whole, effects)
        for _ in range(MAX_PASSES):
            specs = passes[-1].specs(k for k, _ in new)
            effects += [(one, specs.get(k)) for k, one in new]
            whole = extended(whole, specs.values())
            if (after := sensors.again(whole, passes)) is None:
                break
            passes.append(after)
            if not (new := _new(after, whole, effects)):
                break
        nameless = any(spec is None and not is_noise(f.names[0]) for f, spec in effects)
        if not nameless and _explained(sensors, passes, whole, len(effects)):
            return Lot(tuple(passes), whole, tuple(effects))
    close = tuple(found.names for found, spec in effects if spec is not None)
    return Lot(tuple(passes), model, close=close, explained=False)


@dataclass(frozen=True, eq=False)
class _Sensors:
    """The campaigns of a lot, and how they are weighed: an approach, the draws, the processes."""

    campaigns: Sequence[Campaign]
    approach: Approach | None
    seed: int
    mapped: Callable[..., Iterator[Any]]

    def again(self, whole: SensorModel, passes: Sequence[Pass]) -> Pass | None:
        """Weigh all sensors with what was found, and with the noise that they tell together.

        Parameters
        ----------
        whole : SensorModel, with what was found
        passes : that found it, of which each sensor has its own times of what is sudden
        """
        own = [_own(whole, passes, i) for i in range(len(self.campaigns))]

        def fitted(i: int, sigma: float | None = None) -> BaseFit | None:
            campaign = self.campaigns[i]
            if sigma is not None:
                campaign = replace(campaign, sigma_force=sigma, sigma_dof=None)
            with suppress(InputError):
                return fit_base(campaign, own[i], self.approach or usual_approach(campaign))
            return None

        fits = [fitted(i) for i in range(len(own))]
        # A campaign that does not determine the model says nothing of what else is missing.
        models = [None if fit is None else fit.solution.model for fit in fits]
        return self.weighed(models, whole, noises_of_lot(fits, fitted)) if any(models) else None

    def weighed(
        self,
        models: Sequence[SensorModel | None],
        whole: SensorModel,
        noises: Sequence[SensorNoise | None],
    ) -> Pass:
        """Weigh everything that the models of all sensors may lack.

        Parameters
        ----------
        models : of the sensors; None for one that its campaign does not determine
        whole : SensorModel, of their mean
        noises : of the sensors; None for one that speaks for itself
        """
        campaigns, n = self.campaigns, len(self.campaigns)
        approaches, seeds = [self.approach] * n, range(self.seed, self.seed + n)
        each = self.mapped(sensor_evidence, campaigns, models, approaches, seeds, noises)
        sensors, anything = [], Anything()
        # What noise alone would say is most of what a sensor gives, and is not kept.
        for sensor, of_test in track(each, "evidence of the sensors", n):
            sensors.append(replace(sensor, pair_specs={}))
            anything.add(of_test.names, of_test.odds)

        def retested(i: int) -> AnythingOdds:
            return sensor_evidence(campaigns[i], models[i], self.approach, seeds[i], noises[i])[1]

        now = Pass(tuple(sensors), anything, retested, noises=tuple(noises))
        usual = [k for k in now.usual if models[k]]
        mean = None
        # What happens to each sensor at a time of its own has no mean.
        if not any(effect.sudden for effect in whole.effects):
            of_mean = mean_sensor(
                [campaigns[k] for k in usual],
                [sensors[k] for k in usual],
                [noises[k] for k in usual],
            )
            if of_mean is not None:
                of_its_own = self.seed - 1 if self.seed else n
                with suppress(InputError):  # the positions do not determine the model
                    measured, noise = of_mean
                    mean, _ = sensor_evidence(measured, whole, self.approach, of_its_own, noise)
        # What is gathered now is not kept of each sensor, so that memory hardly follows the lot.
        now = replace(
            now,
            sensors=tuple(replace(sensor, shown={}) for sensor in sensors),
            mean=mean,
            together=together([sensors[k] for k in usual]),
        )
        if len(usual) < 2 or not (shapes := now.strongest()):
            return now
        specs = tuple(dict.fromkeys(spec for of_set in shapes.values() for spec in of_set.values()))
        each = self.mapped(told, campaigns, models, approaches, noises, [specs] * n)
        return replace(now, sizes=TypeSizes.of(list(each), specs, usual), shapes=shapes)


def _own(whole: SensorModel, passes: Sequence[Pass], i: int) -> SensorModel:
    """Model of a sensor: what is sudden happened when the last pass that looked for it says."""
    specs: dict[str, str] = {}
    for one in passes:
        specs |= one.sensors[i].specs
    effects = [specs.get(e.name, e.spec) if e.sudden else e.spec for e in whole.effects]
    return compose(whole.name, tuple(effects))


def _new(
    now: Pass, whole: SensorModel, effects: Sequence[tuple[Found, str | None]]
) -> list[tuple[int, Found]]:
    """What a pass found that neither the model nor an earlier pass has."""
    known = {name for found, _ in effects for name in found.names}
    return [
        (k, one) for k, one in now.found if not _has(whole, one.names) and not known & {*one.names}
    ]


def _has(model: SensorModel, names: Sequence[str]) -> bool:
    """Whether a model has one of some effects."""
    return any(effect.name in names for effect in model.effects)


def _explained(sensors: _Sensors, passes: Sequence[Pass], whole: SensorModel, known: int) -> bool:
    """Whether what was found explains the lot, with the most probable of what is not sure."""
    now = passes[-1]
    while (rest := now.without_odd()).p_value < LEVEL_OF_REST:
        best = int(np.argmax(rest.given))
        spec = rest.specs([best])
        if is_noise(rest.classes[best][0]) or _has(whole, rest.classes[best]):
            return True
        if not spec or known >= MAX_PASSES:
            return False
        whole, known = extended(whole, spec.values()), known + 1
        if (after := sensors.again(whole, passes)) is None:
            return False
        now = after
    return True


def extended(model: SensorModel, specs: Iterable[str]) -> SensorModel:
    """Model with further effects."""
    effects = (*(effect.spec for effect in model.effects), *specs)
    return compose(composition_name(compose("type", effects).effects), effects)


@contextmanager
def _processes(cores: int, n: int) -> Iterator[Callable[..., Iterator[Any]]]:
    """What maps a function over n campaigns, in as many processes as there are cores.

    Elsewhere than on Linux processes start anew, with all imports; there is one.
    """
    cores = min(cores, n)
    if cores == 1 or sys.platform != "linux":
        yield map
        return
    # Workers read from a pipe to which nobody writes. It ends with this process, however that ends,
    # and so do they; otherwise they would go on, and hold what they share with it.
    reads, writes = os.pipe()
    pool = ProcessPoolExecutor(
        cores, mp_context=get_context("fork"), initializer=_work, initargs=(reads, writes)
    )
    try:
        yield partial(pool.map, chunksize=min(4, -(-n // cores)))
        pool.shutdown()
    finally:
        os.close(writes)
        pool.shutdown(cancel_futures=True)
        os.close(reads)


def _work(reads: int, writes: int) -> None:
    """Let a worker end with the process that it works for, which alone answers to Ctrl-C."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.close(writes)

    def wait() -> None:
        os.read(reads, 1)
        os._exit(1)

    Thread(target=wait, daemon=True).start()
