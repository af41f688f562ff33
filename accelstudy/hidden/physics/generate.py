"""Campaigns with hidden effects, and the truth about them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from accelstudy.campaign.session import Campaign
from accelstudy.hidden.physics.case import Case, HiddenEffect, Truth, plain
from accelstudy.hidden.physics.drawing import drawn
from accelstudy.hidden.physics.forward.measuring import Cause, Sensor, observe
from accelstudy.hidden.physics.forward.noise import NOISES, Noise
from accelstudy.hidden.physics.forward.session import GRAVITY, Session
from accelstudy.hidden.physics.gross import GROSS
from accelstudy.hidden.physics.seen.atlas import Atlas
from accelstudy.hidden.physics.seen.conditions import Conditions
from accelstudy.hidden.physics.seen.oracle import oracle

Array = NDArray[np.float64]


ARRIVAL = 5e-4
"""rad, sd of the joints about the attitudes of the design."""


def generate(case: Case, seed: np.random.SeedSequence) -> tuple[Campaign, Truth]:
    """Simulate a campaign.

    Parameters
    ----------
    case : Case
    seed : numpy.random.SeedSequence, from which all that is random follows

    Raises
    ------
    InputError
        If the design cannot see an effect that shall have a size.
    """
    rng = np.random.default_rng(seed)
    knowing = oracle(case.design, case.approach)
    own = knowing.atlas
    # No joint comes to rest exactly where it was sent.
    arrived = own.session.joints + ARRIVAL * rng.standard_normal(own.session.joints.shape)
    session = replace(own.session, joints=arrived)
    sensor = Sensor.drawn(rng)
    conditions = Conditions.of(session, case.approach, sensor)
    causes, hidden, classes = [], [], []
    for name, lam in zip(case.effect, case.lam or [0.0] * len(case.effect), strict=True):
        cause, same = drawn(name, lam, session, conditions, knowing, rng)
        classes.append(same)
        causes.append(cause)
        parameters = tuple(cause.parameters[0].tolist())
        hidden.append(HiddenEffect(name, cause.settings, parameters, lam))
    output, encoders = (part[0] for part in observe(session, sensor, causes))
    noise = Noise.drawn(case.noise, session, rng)
    forces = noise.read(output, session, rng)
    reading = encoders + session.sigma_angle * rng.standard_normal(encoders.shape)
    campaign = _campaign(case, session, forces, reading)
    campaign = _with_samples(campaign, session, sensor, causes, noise, rng)
    gross: dict[str, Any] = {"name": "", "settings": {}}
    if case.gross is not None:
        campaign, gross["settings"] = GROSS[case.gross](campaign, session, conditions, rng)
        gross["name"] = case.gross
    verdict = knowing.judge(_left(own, sensor, forces, reading), case.lam)
    left = knowing.left(_left(own, sensor, output, encoders)) if case.set == "outside" else ()
    truth = Truth(
        set=case.set,
        design=case.design,
        approach=case.approach,
        sigma_known=case.sigma_known,
        seed=_numbers(seed),
        effects=tuple(hidden),
        classes=tuple(classes),
        noise={
            "kind": noise.kind,
            "name": None if noise.kind is None else NOISES[noise.kind],
            "settings": noise.settings,
        },
        gross=gross,
        sensor={
            "bias": sensor.bias.tolist(),
            "scale": sensor.scale.tolist(),
            "lean": sensor.lean.tolist(),
        },
        oracle={
            "detected": verdict.detected,
            "best": plain(verdict.best),
            "told": plain(verdict.told),
            "alternatives": verdict.alternatives,
        },
        left=left,
    )
    return campaign, truth


def _left(own: Atlas, sensor: Sensor, output: Array, reading: Array) -> Array:
    """What a calibration leaves of the misclosures, (m,), whatever the sensor is."""
    corrected = (output - sensor.bias) @ sensor.correction.T
    return own.conditions.seen(corrected[None], reading[None])[0]


def _campaign(case: Case, session: Session, forces: Array, reading: Array) -> Campaign:
    """The campaign as it was recorded, without the samples within the holds."""
    robot = case.approach == "robot"
    return Campaign(
        name=f"hidden {case.design}",
        positions=np.arange(1, session.n + 1),
        forces=forces,
        gravity=GRAVITY,
        sigma_force=session.sigma if case.sigma_known else None,
        angles=reading if robot else None,
        sigma_angle=session.sigma_angle if robot else None,
        yaw=session.yaw if robot else None,
        time=session.time,
        temperature=session.temperature,
        vibration=session.vibration,
        full_range=session.full_range,
    )


def _with_samples(
    campaign: Campaign,
    session: Session,
    sensor: Sensor,
    causes: list[Cause],
    noise: Noise,
    rng: np.random.Generator,
) -> Campaign:
    """Add the statistics of the samples within the holds, where they were kept."""
    if not session.n_samples:
        return campaign
    sd = noise.sds(session, rng)
    n_samples = np.full(session.n, session.n_samples)
    campaign = replace(campaign, sd=sd, n_samples=n_samples)
    if not session.slopes:
        return campaign
    # Least-squares slope of n equally spaced samples with independent errors.
    root = np.sqrt(12 / session.n_samples) / session.length
    slope = root * noise.samples_sd(session) * rng.standard_normal(sd.shape)
    if any(cause.effect.in_time for cause in causes):
        half = session.length / 4
        ahead, back = (observe(session.later(by), sensor, causes)[0][0] for by in (half, -half))
        slope += (ahead - back) / (2 * half)
    return replace(campaign, slope=slope, sd_slope=root * sd)


def _numbers(seed: np.random.SeedSequence) -> tuple[int, ...]:
    """Entropy and spawn key of a seed."""
    entropy = seed.entropy
    words = () if entropy is None else (entropy,) if isinstance(entropy, int) else tuple(entropy)
    return (*(int(word) for word in words), *(int(key) for key in seed.spawn_key))
