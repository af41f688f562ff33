"""Lots: campaigns of sensors of one type, with the same hidden effects in sizes of their own."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import compress
from typing import Any

import numpy as np

from accelstudy.campaign.session import Campaign
from studies.hidden.physics.generate import Case, Truth, drawn, generate, left_of
from studies.hidden.physics.kinds import Cause
from studies.hidden.physics.measuring import Sensor
from studies.hidden.physics.oracle import Verdict, oracle

SCATTER = 0.25  # sd of the logarithm of an effect's size, from sensor to sensor


@dataclass(frozen=True)
class LotCase:
    """One kind of lot.

    Attributes
    ----------
    case : Case, of a sensor with all that the lot has
    shares : tuple of float, how many of the sensors have each effect; 0 for one sensor
    designs, sigmas, roughness : of which each sensor has one at random instead of that of the case:
        designs, whether its sigma is stated, and factors of the noise of a position mean, by long
        holds or short ones
    """

    case: Case
    shares: tuple[float, ...] = ()
    designs: tuple[str, ...] = ()
    sigmas: tuple[bool, ...] = ()
    roughness: tuple[float, ...] = ()


def generate_lot(
    lot: LotCase, sensors: int, seed: np.random.SeedSequence
) -> Iterator[tuple[Campaign, Truth]]:
    """Simulate the campaigns of a lot, one after the other.

    What an effect is, its setting and its typical parameters, belongs to the type, and each
    parameter of a sensor is a factor away from it, exp(N(0, `SCATTER`²)). Sudden events, a jump or
    a slip, come to each sensor when and as they like. What one sensor alone has is of no type.

    Parameters
    ----------
    lot : LotCase
    sensors : int, number of them
    seed : numpy.random.SeedSequence, from which all that is random follows
    """
    type_seed, *seeds = seed.spawn(sensors + 1)
    rng = np.random.default_rng(type_seed)
    usual, of_type = lot.case, _of_type(lot, rng)
    has = np.zeros((sensors, len(lot.shares)), dtype=bool)
    for k, share in enumerate(lot.shares):
        has[rng.permutation(sensors)[: max(round(share * sensors), 1)], k] = True

    def one_of(options: Sequence[Any], usual: Any) -> Any:
        return options[int(rng.integers(len(options)))] if options else usual

    for i, its_seed in enumerate(seeds):
        effect = tuple(compress(usual.effect, has[i]))
        design, known = one_of(lot.designs, usual.design), one_of(lot.sigmas, usual.sigma_known)
        lam = usual.lam[: len(effect)]
        case = replace(usual, effect=effect, lam=lam, design=design, sigma_known=known)
        rough, given = one_of(lot.roughness, 1.0), {}
        for name in case.effect:
            if name in of_type:
                parameters = of_type[name].parameters
                factors = np.exp(SCATTER * rng.standard_normal(parameters.shape))
                given[name] = replace(of_type[name], parameters=parameters * factors)
        campaign, truth = generate(case, its_seed, given, rough)
        yield campaign.with_header(name=f"sensor-{i + 1}"), truth


def lot_oracle(lot: LotCase, made: Sequence[tuple[Campaign, Truth]]) -> Verdict:
    """Say what the oracle says of a lot with one hidden effect in a share of its sensors.

    It knows which sensors have it, and judges their mean, which has all that a size of the type
    shows.

    Parameters
    ----------
    lot : LotCase
    made : campaigns and truths of `generate_lot`
    """
    knowing = oracle(lot.case.design, lot.case.approach)
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
    return knowing.judge(
        np.sum(shown, axis=0) / np.sqrt(len(shown)), (lot.case.lam[0] * len(shown),)
    )


def _of_type(lot: LotCase, rng: np.random.Generator) -> Mapping[str, Cause]:
    """Effects of the type with their typical parameters; sudden events have none."""
    case, knowing = lot.case, oracle(lot.case.design, lot.case.approach)
    known = {
        name: drawn(name, lam, knowing.conditions, knowing, rng)
        for name, lam, share in zip(case.effect, case.lam, lot.shares, strict=True)
        if share > 0
    }
    return {name: one for name, one in known.items() if "t" not in one.settings}
