"""Lots: campaigns of sensors of one type, with the same hidden effects in sizes of their own."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from accelstudy.campaign.session import Campaign
from studies.hidden.physics.atlas import Conditions
from studies.hidden.physics.generate import Case, Known, Truth, drawn, generate, left_of
from studies.hidden.physics.measuring import Sensor
from studies.hidden.physics.oracle import Verdict, oracle

SCATTER = 0.25
"""Sd of the logarithm of an effect's size, from sensor to sensor."""


@dataclass(frozen=True)
class LotCase:
    """One kind of lot.

    Attributes
    ----------
    set : str, name of the kind
    design : str
    approach : str, "gravity" or "robot"
    sigma_known : bool, whether the campaigns state their sigma; None where half of them do
    effects : tuple of str, what is missing
    shares : tuple of float, how many of the sensors have each; 0 for one sensor
    lam : float, noncentrality of each effect in a typical sensor
    noise : str, kind of wrong noise of all sensors; None where it is right
    roughness : tuple of float, factors of the noise of a position mean; each sensor has one of them
        at random, by long holds or short ones
    designs : tuple of str, of which each sensor has one at random; none where all have `design`
    """

    set: str
    design: str
    approach: str
    sigma_known: bool | None
    effects: tuple[str, ...] = ()
    shares: tuple[float, ...] = ()
    lam: float = 0.0
    noise: str | None = None
    roughness: tuple[float, ...] = (1.0,)
    designs: tuple[str, ...] = ()


def generate_lot(
    case: LotCase, sensors: int, seed: np.random.SeedSequence
) -> Iterator[tuple[Campaign, Truth]]:
    """Simulate the campaigns of a lot, one after the other.

    What an effect is, its setting and its typical parameters, belongs to the type, and each
    parameter of a sensor is a factor away from it, exp(N(0, `SCATTER`²)). Sudden events, a jump or
    a slip, come to each sensor when and as they like. What one sensor alone has is of no type.

    Parameters
    ----------
    case : LotCase
    sensors : int, number of them
    seed : numpy.random.SeedSequence, from which all that is random follows
    """
    type_seed, *seeds = seed.spawn(sensors + 1)
    rng = np.random.default_rng(type_seed)
    of_type = _of_type(case, rng)
    has = np.zeros((sensors, len(case.effects)), dtype=bool)
    for k, share in enumerate(case.shares):
        has[rng.permutation(sensors)[: max(round(share * sensors), 1)], k] = True
    for i, its_seed in enumerate(seeds):
        names = tuple(name for name, there in zip(case.effects, has[i], strict=True) if there)
        design = str(rng.choice(case.designs)) if case.designs else case.design
        known = bool(rng.integers(2)) if case.sigma_known is None else case.sigma_known
        one = Case("lot", design, case.approach, known, names, (case.lam,) * len(names), case.noise)
        rough = float(rng.choice(case.roughness)) if len(case.roughness) > 1 else case.roughness[0]
        given = {}
        for name in names:
            if (shared := of_type.get(name)) is not None:
                cause, same = shared
                factors = np.exp(SCATTER * rng.standard_normal(cause.parameters.shape))
                given[name] = replace(cause, parameters=cause.parameters * factors), same
        campaign, truth = generate(one, its_seed, given, rough)
        yield replace(campaign, name=f"sensor-{i + 1}"), truth


def lot_oracle(case: LotCase, made: Sequence[tuple[Campaign, Truth]]) -> Verdict:
    """Say what the oracle says of a lot with one hidden effect in a share of its sensors.

    It knows which sensors have it, and judges their mean, which has all that a size of the type
    shows.

    Parameters
    ----------
    case : LotCase
    made : campaigns and truths of `generate_lot`
    """
    knowing = oracle(case.design, case.approach)
    shown = [
        left_of(
            knowing,
            Sensor(**{name: np.array(values) for name, values in (truth.sensor or {}).items()}),
            campaign.forces,
            np.zeros((len(campaign.forces), 2)) if campaign.angles is None else campaign.angles,
        )
        for campaign, truth in made
        if truth.effects
    ]
    return knowing.judge(np.sum(shown, axis=0) / np.sqrt(len(shown)), (case.lam * len(shown),))


def _of_type(case: LotCase, rng: np.random.Generator) -> Mapping[str, Known]:
    """Effects of the type with their typical parameters; sudden events have none."""
    knowing = oracle(case.design, case.approach)
    conditions = Conditions(knowing.session, case.approach, Sensor())
    known = {
        name: drawn(name, case.lam, conditions, knowing, rng)
        for name, share in zip(case.effects, case.shares, strict=True)
        if share > 0
    }
    return {name: one for name, one in known.items() if "t" not in one[0].settings}
