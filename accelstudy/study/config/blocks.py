"""The blocks of the configuration of a study.

Models, schemes, approaches and effects are written by their names; a block has the objects.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from contextvars import ContextVar
from dataclasses import dataclass
from types import MappingProxyType
from typing import Annotated, Any, Literal

from pydantic import Field, GetCoreSchemaHandler, model_validator
from pydantic_core import core_schema

from accelstudy.approaches import Approach, approach_names, get_approach
from accelstudy.basics import bounds
from accelstudy.basics.errors import InputError
from accelstudy.basics.units import to_si
from accelstudy.effects import Effect, get_effect
from accelstudy.files.validation import (
    Angle,
    Attitudes,
    BaseSamples,
    Block,
    Duration,
    Finite,
    GravityError,
    Interval,
    OneOrMore,
    Pitch,
    Rate,
    Replicates,
    Resamples,
    SigmaAngle,
    SigmaForce,
    SigmaGravity,
    Temperature,
    Tilt,
    Vibration,
)
from accelstudy.leveling.error import ATTITUDES, MAX_TILT_GON
from accelstudy.noise_effects import NoiseEffect, get_noise_effect
from accelstudy.schemes import Scheme, get_scheme, scheme_names
from accelstudy.sensors.models import MODELS, NINE, compose, get_model
from accelstudy.sensors.sensor import SensorModel
from accelstudy.simulation.hold_plan import HoldPlan
from accelstudy.simulation.sessions import sigma_of_mean

OWN_MODELS: ContextVar[Mapping[str, SensorModel]] = ContextVar(
    "own_models", default=MappingProxyType({})
)
"""Models that the configuration defines, while the blocks that may name them are parsed."""


@dataclass(frozen=True)
class Written:
    """How a field is written: the type in the file, and the ways there and back.

    Attributes
    ----------
    kind : type, of what the file has
    parse, plain : functions from that to the object, and back
    """

    kind: Any
    parse: Callable[[Any], Any]
    plain: Callable[[Any], Any]

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> core_schema.CoreSchema:
        back = core_schema.plain_serializer_function_ser_schema(self.plain)
        inner = handler.generate_schema(self.kind)
        return core_schema.no_info_after_validator_function(self.parse, inner, serialization=back)


def _names(things: Collection[Any]) -> list[str]:
    return [thing.name for thing in things]


def specs(effects: Collection[Any]) -> list[str]:
    """Effects as they are written."""
    return [effect.spec for effect in effects]


def _listed(find: Callable[[str], Any], everything: Callable[[], Collection[str]]) -> Written:
    """How a list of things is written: by their names, or as `all`."""

    def parse(names: list[str]) -> list[Any]:
        return [find(name) for name in (everything() if names == ["all"] else names)]

    return Written(OneOrMore[str], parse, _names)


def composed(name: str, effects: Collection[str]) -> SensorModel:
    """Compose a model; the same one for the same effects, however they are written."""
    return compose(name, tuple(get_effect(effect).spec for effect in effects))


def _model(text: str) -> SensorModel:
    return get_model(text, OWN_MODELS.get())


def _noise_effect(text: str) -> NoiseEffect:
    return get_noise_effect(get_noise_effect(text).spec)  # the same one, however it is written


def _name(thing: Any) -> str:
    return str(thing.name)


Model = Annotated[SensorModel, Written(str, _model, _name)]
Positions = Annotated[Scheme, Written(str, get_scheme, _name)]
Models = Annotated[list[SensorModel], _listed(_model, lambda: [*MODELS, *OWN_MODELS.get()])]
Schemes = Annotated[list[Scheme], _listed(get_scheme, scheme_names)]
Approaches = Annotated[list[Approach], _listed(get_approach, approach_names)]
Composition = Annotated[
    SensorModel,
    Written(
        OneOrMore[str],
        lambda effects: composed("", effects),
        lambda model: specs(model.effects),
    ),
]
"""A model that is written as a list of effects."""
NoiseEffects = Annotated[
    list[NoiseEffect], Written(list[str], lambda texts: [*map(_noise_effect, texts)], specs)
]

Temperatures = tuple[Temperature, Temperature]
Vibrations = tuple[Vibration, Vibration]
"""Two numbers, from and to."""


class SensorNoise(Block):
    """White noise of the accelerometer."""

    sigma_mps2: SigmaForce = Field(0.002, description="standard deviation per axis, m/s²")
    per: Literal["position", "sample"] = Field(
        "position", description="whether sigma_mps2 is that of a position's mean or of one sample"
    )
    rate_hz: Rate = Field(100.0, description="sampling rate; used with per: sample")
    duration_s: Duration = Field(2.0, description="duration of a hold; used with per: sample")

    def of_mean(self, sigma_mps2: float) -> float:
        """Noise of a position's mean, m/s², from a configured noise (per position or sample)."""
        if self.per == "position":
            return sigma_mps2
        return sigma_of_mean(sigma_mps2, self.rate_hz, self.duration_s)


class RobotNoise(Block):
    """Noise of the robot's angles."""

    sigma_mgon: SigmaAngle = Field(3.2, description="standard deviation of roll and of pitch")


class GravityNoise(Block):
    """What is known of local gravity."""

    sigma_mps2: SigmaGravity = Field(
        0.0, description="standard deviation of the value used; 0 holds it fixed in the adjustment"
    )
    error_mps2: GravityError = Field(0.0, description="systematic error of the value used")


class NoiseConfig(Block):
    """The stochastic model of all cells, except where a grid gives other values."""

    sensor: SensorNoise = SensorNoise()
    robot: RobotNoise = RobotNoise()
    gravity: GravityNoise = GravityNoise()
    effects: NoiseEffects = Field(
        default_factory=list,
        description="noise effects of the forces, e.g. heavy_tails(nu=3), in the order in which "
        "they act; the calibration ignores them",
    )

    @property
    def settings(self) -> dict[str, float]:
        """The four settings that a grid may vary, by their keys there."""
        return {
            "sensor_sigma_mps2": self.sensor.sigma_mps2,
            "robot_sigma_mgon": self.robot.sigma_mgon,
            "gravity_sigma_mps2": self.gravity.sigma_mps2,
            "gravity_error_mps2": self.gravity.error_mps2,
        }


class HoldPlanConfig(Block):
    """Conditions of the holds, on which some effects depend."""

    interval_s: Interval | None = Field(None, description="time between holds")
    temperature_degC: Temperatures | None = Field(None, description="temperatures from and to")
    temperature_order: Literal["linear", "ABBA", "random"] = Field(
        "linear", description="course of the temperature; ABBA: in quarters of the session"
    )
    vibration_mps2: Vibrations | None = Field(
        None, description="rms of the vibration, drawn for each hold between these"
    )
    yaw: Literal["none", "random"] = Field("none", description="yaw of the robot: zero, or drawn")

    def plan(self, seed: int) -> HoldPlan:
        """The plan of the holds in SI, whose random conditions have this seed."""
        return HoldPlan(
            interval=self.interval_s,
            temperature=self.temperature_degC,
            temperature_order=self.temperature_order,
            vibration=self.vibration_mps2,
            yaw=self.yaw,
            seed=seed,
        )


HOLD_KEYS = {
    "time": "holds.interval_s",
    "temperature": "holds.temperature_degC",
    "vibration": "holds.vibration_mps2",
}
"""Columns of the holds and the keys that provide them."""


class Quantity(Block):
    """True values of the parameters of one effect."""

    value: OneOrMore[Finite] = Field(description="one number per parameter of the effect")
    unit: str = Field(description="unit of the values, e.g. mgon, ppm, m/s^2")

    def check(self, effect: Effect) -> None:
        """Check that these may be the parameters of an effect."""
        parameters = effect.parameters
        if len(self.value) != len(parameters):
            raise InputError(
                f"value: {len(self.value)} numbers; the effect has "
                f"{len(parameters)} parameters ({', '.join(p.name for p in parameters)})"
            )
        to_si(self.value, self.unit, parameters[0].unit)


class Grid(Block):
    """Cells: every combination of what is listed. A single value may stand for a list of one."""

    models: Models = Field(
        description="models: names, compositions as bias-scale+warm_up(tau=300), YAML files with a "
        "model; or all"
    )
    schemes: Schemes = Field(
        description="schemes: names, YAML files as `accelstudy design` writes them; or all"
    )
    approaches: Approaches = Field(
        default=["gravity", "robot"],
        validate_default=True,
        description="names of approaches, or all",
    )
    replicates: Replicates = Field(description="simulated calibrations per cell")
    sensor_sigma_mps2: OneOrMore[SigmaForce] | None = Field(
        None, description="noise.sensor.sigma_mps2"
    )
    robot_sigma_mgon: OneOrMore[SigmaAngle] | None = Field(
        None, description="noise.robot.sigma_mgon"
    )
    gravity_sigma_mps2: OneOrMore[SigmaGravity] | None = Field(
        None, description="noise.gravity.sigma_mps2"
    )
    gravity_error_mps2: OneOrMore[GravityError] | None = Field(
        None, description="noise.gravity.error_mps2"
    )

    def noises(self, usual: NoiseConfig) -> list[list[float]]:
        """Values of the settings of the noise, in the order of those."""
        return [getattr(self, key) or [value] for key, value in usual.settings.items()]

    @model_validator(mode="after")
    def _not_too_many(self) -> Grid:
        lists: list[Sequence[object]] = [
            self.models,
            self.schemes,
            self.approaches,
            *self.noises(NoiseConfig()),
        ]
        try:
            bounds.CELLS.check(math.prod(map(len, lists)))
        except ValueError as error:
            raise ValueError(f"number of cells: {error}") from None
        return self


class Presets(Block):
    """The rows of the paper's Table 1, each with its own model and scheme."""

    replicates: Replicates = Field(description="simulated calibrations per row and approach")
    approaches: Approaches = Field(
        default=["gravity", "robot"],
        validate_default=True,
        description="names of approaches, or all",
    )


class LevelingConfig(Block):
    """Where the tilt error that a calibration leaves is evaluated."""

    max_tilt_gon: Tilt = Field(
        MAX_TILT_GON, description="largest tilt of the z axis from the vertical"
    )
    attitudes: Attitudes = Field(
        ATTITUDES, description="least number of attitudes, spread evenly over these tilts"
    )


class SensitivityConfig(Block):
    """Variance-based sensitivity analysis of leveling (figures 4 to 6)."""

    base_samples: BaseSamples = Field(1024, description="Sobol base samples, a power of two")
    resamples: Resamples = Field(100, description="bootstrap resamples for confidence intervals")
    roll_gon: OneOrMore[Angle] = Field(description="rolls of the grid")
    pitch_gon: OneOrMore[Pitch] = Field(description="pitches of the grid")
    model: Model = Field(NINE, validate_default=True, description="model of figures 5 and 6")
    scheme: Positions = Field(
        "mclaren-24",
        validate_default=True,
        description="scheme whose calibration gives the sds",
    )

    def cell(self, approach: str, scheme: str = "") -> str:
        """Name of the cell of an approach, in the scheme of the analysis if no other is named."""
        return f"{self.model.name}/{scheme or self.scheme.name}/{approach}"
