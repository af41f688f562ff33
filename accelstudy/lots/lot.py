"""What the model of a lot lacks: whether anything, what, in how many sensors, and which are odd."""

from __future__ import annotations

import ctypes
import math
import signal
import sys
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from functools import partial
from multiprocessing import active_children, get_context

from accelstudy.approaches import Approach
from accelstudy.basics.errors import InputError
from accelstudy.campaign.calibration.fit import usual_approach
from accelstudy.campaign.session import Campaign
from accelstudy.diagnosis.decision.problem import BaseFit
from accelstudy.diagnosis.evidence.noise_tests import NOISES
from accelstudy.diagnosis.rules import RULES
from accelstudy.effects import get_effect
from accelstudy.lots.evidence import Sensor, SensorEvidence
from accelstudy.lots.noise import NoisePrior, noises_of_lot
from accelstudy.lots.passes import LEVEL, ODD, Alternative, LotEffect, Mapped, Pass, SensorState
from accelstudy.lots.sizes import Names
from accelstudy.sensors.models import compose, composition_name
from accelstudy.sensors.sensor import SensorModel

LEVEL_OF_REST = 0.01
"""Level of the test whether the model of a lot lacks more than what was found."""
END_WITH_PARENT = 1
"""Option of prctl(2) by which a process gets a signal when its parent ends, PR_SET_PDEATHSIG."""
MAX_PASSES = 3
"""Largest number of passes that add effects to the model."""


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
    close: tuple[Names, ...] = ()
    explained: bool = True

    @property
    def last(self) -> Pass:
        """Sensors with all that was found in their models, and their noise by that of the lot."""
        return self.passes[-1]

    @property
    def evidence(self) -> tuple[SensorEvidence, ...]:
        """Evidence of each campaign by itself."""
        return self.passes[0].evidence

    def model_of(self, i: int) -> SensorModel:
        """Model of the type for a sensor, with its own times of what is sudden."""
        return self.last.sensors[i].model or self.model

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
    def alternatives(self) -> list[Alternative]:
        """The most probable classes of what has no sure name, with their posterior."""
        return next((one for one in self.passes if one.missing), self.passes[-1]).alternatives

    @property
    def each(self) -> list[SensorState]:
        """Names of what the model lacks for each sensor, and their posterior."""
        told = {found.names[0] for found in self.effects}
        rows = []
        for states in zip(*(one.each for one in self.passes), strict=True):
            names = [name for state in states for name in state.names if name in told]
            names += [name for name in states[-1].names if name == ODD]
            probability = math.prod(state.posterior for state in states)
            rows.append(SensorState(states[0].campaign, tuple(names), probability))
        return rows


def weigh_lot(
    campaigns: Sequence[Campaign],
    model: SensorModel,
    approach: Approach | None = None,
    seed: int = 1,
    cores: int = 1,
) -> LotDiagnosis:
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
    sensors = [
        Sensor(campaign, model, approach or usual_approach(campaign), seed + i)
        for i, campaign in enumerate(campaigns)
    ]
    with _processes(cores, len(sensors)) as mapped:
        passes, whole = [Pass.of(sensors, mapped)], model
        effects: list[LotEffect] = []
        for _ in range(MAX_PASSES):
            known = {effect.name for effect in whole.effects}
            known |= {name for found in effects for name in found.names}
            new = [found for found in passes[-1].found if not known & {*found.names}]
            if not new and len(passes) > 1:
                break
            specs = [found.spec for found in new if found.spec]
            if (after := _again(passes[-1], specs, mapped)) is None:
                break
            passes.append(after)
            whole, effects = extended(whole, specs), [*effects, *new]
        nameless = any(f.spec is None and f.names[0] not in NOISES for f in effects)
        if not nameless and _explained(passes[-1], whole, len(effects), mapped):
            return LotDiagnosis(tuple(passes), whole, tuple(effects))
    close = tuple(found.names for found in effects if found.spec is not None)
    return LotDiagnosis(tuple(passes), model, close=close, explained=False)


def _again(before: Pass, specs: Sequence[str], mapped: Mapped) -> Pass | None:
    """Weigh all sensors with further effects, and with the noise that they tell together.

    None if no campaign determines the model.

    Parameters
    ----------
    before : Pass, that found the effects
    specs : the effects
    mapped : maps a function over the sensors
    """
    sensors, effects = list[Sensor](), [get_effect(spec) for spec in specs]
    for sensor, said in zip(before.sensors, before.evidence, strict=True):
        # What is sudden happened to each sensor at a time of its own.
        own = [said.specs.get(e.name, e.spec) if e.sudden else e.spec for e in effects]
        model = None if sensor.model is None else extended(sensor.model, own)
        sensors.append(replace(sensor, model=model, noise=None))

    def fitted(i: int, noise: NoisePrior | None = None) -> BaseFit | None:
        with suppress(InputError):
            return replace(sensors[i], noise=noise).fit()
        return None

    fits = [fitted(i) for i in range(len(sensors))]
    noises = noises_of_lot(fits, lambda i, sigma: fitted(i, NoisePrior(sigma, RULES.freedom_given)))
    for i, noise in enumerate(noises):
        fit = fits[i] if noise is None else fitted(i, noise)
        # A campaign that does not determine the model says nothing of what else is missing.
        known = None if fit is None else fit.solution.model
        sensors[i] = replace(sensors[i], model=known, noise=noise)
    return Pass.of(sensors, mapped) if any(one.model for one in sensors) else None


def _explained(now: Pass, whole: SensorModel, known: int, mapped: Mapped) -> bool:
    """Whether what was found explains the lot, with the most probable of what is not sure."""
    while now.p_value_of_usual < LEVEL_OF_REST:
        best = next(iter(now.given))
        if best in NOISES or {effect.name for effect in whole.effects} & {*now.classes[best]}:
            return True
        spec = now.spec(best)
        if spec is None or known >= MAX_PASSES:
            return False
        whole, known = extended(whole, [spec]), known + 1
        if (after := _again(now, [spec], mapped)) is None:
            return False
        now = after
    return True


def extended(model: SensorModel, specs: Iterable[str]) -> SensorModel:
    """Model with further effects."""
    effects = (*(effect.spec for effect in model.effects), *specs)
    return compose(composition_name(compose("type", effects).effects), effects)


@contextmanager
def _processes(cores: int, n: int) -> Iterator[Mapped]:
    """What maps a function over n campaigns, in as many processes as there are cores.

    Elsewhere than on Linux processes start anew, with all imports; there is one.
    """
    cores = min(cores, n)
    if cores == 1 or sys.platform != "linux":
        yield map
        return
    others = {*active_children()}
    with ProcessPoolExecutor(cores, get_context("fork"), _work) as pool:
        try:
            yield partial(pool.map, chunksize=min(4, -(-n // cores)))
        except BrokenProcessPool:
            raise InputError(
                "a process of the lot was killed, most likely because memory ran out; "
                "use fewer `cores`"
            ) from None
        except BaseException:
            for worker in {*active_children()} - others:
                worker.kill()
            raise


def _work() -> None:
    """Let a worker end with the process that it works for, which alone answers to Ctrl-C.

    Handlers that the program has for SIGTERM are no matter of a worker: it would outlive the signal
    by which the pool ends it.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    ctypes.CDLL(None).prctl(END_WITH_PARENT, signal.SIGKILL)
