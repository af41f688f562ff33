"""Campaigns with hidden effects, and the truth about them."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from math import nan
from typing import Any

import numpy as np

from accelstudy.basics.errors import InputError
from accelstudy.basics.units import MGON
from accelstudy.campaign.session import Campaign
from studies.hidden.physics.conditions import Conditions, Shape
from studies.hidden.physics.geometry import GRAVITY, Array
from studies.hidden.physics.gross import GROSS
from studies.hidden.physics.kinds import EFFECTS, NOWHERE, OF_ROBOT, Cause, Place
from studies.hidden.physics.measuring import Noise, Sensor, observe
from studies.hidden.physics.oracle import Oracle, Verdict, oracle


@dataclass(frozen=True)
class Case:
    """One kind of campaign.

    Attributes
    ----------
    set : str, of the study, or null or lot
    design : str
    approach : str, "gravity" or "robot"
    sigma_known : bool, whether the campaign states its sigma
    effect : tuple of str, what is hidden
    lam : tuple of float, the noncentralities that they shall have; empty for effects that cannot be
        seen, which have usual sizes
    noise : str, kind of wrong noise; None where it is right
    gross : str, gross error; None for none
    """

    set: str
    design: str
    approach: str
    sigma_known: bool
    effect: tuple[str, ...] = ()
    lam: tuple[float, ...] = ()
    noise: str | None = None
    gross: str | None = None

    @property
    def what(self) -> str:
        """What is hidden: names of effects, kind of noise or gross error; empty for nothing."""
        return self.noise or self.gross or "+".join(self.effect)

    @property
    def size(self) -> float:
        """Noncentrality λ, of either effect; NaN where there is none."""
        return self.lam[0] if self.lam else nan

    @property
    def name(self) -> str:
        """Name, unique within a study."""
        size, known = f"{self.size:g}" if self.lam else "", "" if self.sigma_known else "not "
        parts = self.set, self.what, size, self.design, self.approach, f"sigma {known}given"
        return "/".join(filter(None, parts))

    def digest(self, *numbers: int) -> bytes:
        """Hash of the case and of further numbers."""
        text = json.dumps([asdict(self), *numbers], sort_keys=True)
        return hashlib.sha256(text.encode()).digest()

    def seed(self, seed: int, campaign: int) -> np.random.SeedSequence:
        """Seed of a campaign.

        It depends on the study's seed, the case and the number of the campaign only: no other case
        or campaign changes it.
        """
        words = np.frombuffer(self.digest(), dtype="<u4").tolist()
        return np.random.SeedSequence([seed, *words], spawn_key=(campaign,))


@dataclass(frozen=True)
class HiddenEffect:
    """An effect in a campaign: with which settings and parameters, and how much of it shows."""

    name: str
    settings: dict[str, float]
    parameters: tuple[float, ...]
    lam: float

    @classmethod
    def of(cls, cause: Cause) -> HiddenEffect:
        """Effect of a cause."""
        return cls(cause.kind.name, cause.settings, tuple(cause.parameters[0].tolist()), cause.lam)


@dataclass(frozen=True)
class Truth:
    """What is true of a campaign, beside its case.

    Attributes
    ----------
    effects : tuple of HiddenEffect
    classes : for each effect the names that mean the same in this campaign
    oracle : Verdict, what the oracle says; None where it is not asked
    noise : dict with kind and settings
    gross : dict with name (empty for none) and settings
    sensor : dict with the parameters of the sensor
    true_place : coordinate and target of an effect outside the catalogue; None where it has
        none, or where the campaign does not record its coordinate
    p_known : float, of effects in a real log: p-value of an F test that knows their form
    """

    effects: tuple[HiddenEffect, ...] = ()
    classes: tuple[tuple[str, ...], ...] = ()
    oracle: Verdict | None = None
    noise: dict[str, Any] | None = None
    gross: dict[str, Any] = field(default_factory=lambda: {"name": "", "settings": {}})
    sensor: dict[str, list[float]] | None = None
    true_place: Place | None = None
    p_known: float = nan


ARRIVAL = 5e-4  # rad, sd of the joints about the attitudes of the design


def generate(
    case: Case,
    seed: np.random.SeedSequence,
    given: Mapping[str, Cause] | None = None,
    roughness: float = 1.0,
) -> tuple[Campaign, Truth]:
    """Simulate a campaign.

    Parameters
    ----------
    case : Case
    seed : numpy.random.SeedSequence, from which all that is random follows
    given : mapping of effects of the case to what they are; the others are drawn
    roughness : float, factor of the noise of a position mean, by longer or shorter holds

    Raises
    ------
    InputError
        If the design cannot see an effect that shall have a size.
    """
    rng = np.random.default_rng(seed)
    knowing = oracle(case.design, case.approach)
    planned = knowing.session
    session = replace(
        planned,
        # No joint comes to rest exactly where it was sent.
        joints=planned.joints + ARRIVAL * rng.standard_normal(planned.joints.shape),
        sigma=planned.sigma * roughness,
        n_samples=round(planned.n_samples / roughness**2),
    )
    sensor = Sensor.drawn(rng)
    conditions = Conditions(session, case.approach, sensor)
    sizes = case.lam or (0.0,) * len(case.effect)
    causes = [
        (given or {}).get(name) or drawn(name, lam, conditions, knowing, rng)
        for name, lam in zip(case.effect, sizes, strict=True)
    ]
    output, encoders = (part[0] for part in observe(session, sensor, causes))
    noise = Noise.drawn(case.noise, session, rng)
    forces = noise.read(output, session, rng)
    reading = encoders + session.sigma_angle * rng.standard_normal(encoders.shape)
    recorded = ("time", "temperature", "vibration")
    columns: dict[str, Any] = {name: getattr(session, name) for name in recorded}
    if conditions.robot:
        columns |= {"angles": reading, "yaw": session.yaw}
    if n := session.n_samples:
        columns |= {"sd": noise.sds(session, rng), "n_samples": np.full(session.n, n)}
    robot = {"angle_sigma_mgon": session.sigma_angle / MGON}
    header = {
        "name": f"hidden {case.design}",
        "gravity": {"value_mps2": GRAVITY},
        "sensor_noise": {"sigma_mps2": session.sigma} if case.sigma_known else None,
        "robot": robot if conditions.robot else None,
        "range_mps2": session.full_range,
    }
    campaign = Campaign.of(header, forces=forces, **columns)
    settings: dict[str, float] = {}
    if case.gross is not None:
        campaign, settings = GROSS[case.gross](campaign, rng, session.sigma, conditions)
    strange = NOWHERE.get(case.effect[0]) if case.effect else None
    seen = strange and (conditions.robot or strange.of not in OF_ROBOT)
    truth = Truth(
        effects=tuple(map(HiddenEffect.of, causes)),
        classes=tuple(cause.same for cause in causes),
        oracle=knowing.judge(left_of(knowing, sensor, forces, reading), case.lam),
        noise=dict(vars(noise)),
        gross={"name": case.gross or "", "settings": settings},
        sensor={name: value.tolist() for name, value in vars(sensor).items()},
        true_place=strange.place if strange and seen else None,
    )
    return campaign, truth


def left_of(knowing: Oracle, sensor: Sensor, output: Array, reading: Array) -> Array:
    """What a calibration leaves of the misclosures, (m,), whatever the sensor is."""
    corrected = (output - sensor.bias) @ sensor.correction.T
    return knowing.conditions.seen(corrected[None], reading[None])[0]


DRAWS = 200  # draws of an effect until one is as it should be


def drawn(
    name: str, lam: float, conditions: Conditions, knowing: Oracle, rng: np.random.Generator
) -> Cause:
    """Draw an effect.

    Parameters
    ----------
    name : str, of an effect of the catalogue or outside it
    lam : float, its noncentrality; 0 for an effect of usual size, however little of it shows
    conditions : Conditions, of a session in which the joints stand where they really do, with the
        sensor that has the effect
    knowing : Oracle, of the design

    Raises
    ------
    InputError
        If the design cannot see the effect.
    """
    effect = EFFECTS.get(name) or NOWHERE[name]
    if not lam:
        parameters = effect.typical * rng.standard_normal((1, effect.k))
        return Cause(effect, effect.draw(conditions.session, rng), parameters, same=(name,))
    if effect.shows(knowing.session):
        for _ in range(DRAWS):
            shape = knowing.shape(effect, effect.draw(knowing.session, rng))
            if shape is not None:
                cause, change = _scaled(shape, lam, conditions, rng)
                if name in EFFECTS or knowing.is_outside(change):
                    return replace(cause, same=knowing.same_as(shape))
    approach = "robot" if conditions.robot else "gravity"
    raise InputError(
        f"{knowing.session.name}, {approach}: cannot see {name} as such; "
        f"it sees {', '.join(knowing.visible)}"
    )


def _scaled(
    shape: Shape, lam: float, conditions: Conditions, rng: np.random.Generator
) -> tuple[Cause, Array]:
    """Draw parameters with a given noncentrality; return the effect and what it leaves, (m,)."""
    session, typical = conditions.session, shape.effect.typical
    cause = Cause(shape.effect, shape.settings, typical * shape.drawn(rng)[None], lam)
    without = conditions.misclosures(*observe(session, conditions.sensor, ()))
    for _ in range(2):  # an effect is almost, but not quite, proportional to its parameters
        with_it = conditions.misclosures(*observe(session, conditions.sensor, (cause,)))
        change = conditions.left(with_it - without)[0]
        factor = np.sqrt(lam / float(change @ change))
        cause = replace(cause, parameters=cause.parameters * factor)
    return cause, change * factor
