"""The configuration of a study: what may stand in `config/*.yaml`, checked before anything runs.

The models below are the schema; `workflow/schemas/config.schema.json` is generated from them.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

import yaml
from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator, model_validator

from accelstudy.approaches import approach_names, get_approach
from accelstudy.effects import get_effect
from accelstudy.errors import InputError
from accelstudy.models import MODELS, get_model
from accelstudy.schemes import get_scheme, scheme_names
from accelstudy.sensor import SensorModel
from accelstudy.simulation import sigma_of_mean
from accelstudy.units import STANDARD_GRAVITY, to_si

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Count = Annotated[int, Field(gt=0)]
PowerOfTwo = Annotated[int, Field(ge=2)]


class Block(BaseModel):
    """A part of the configuration; keys that it does not know are errors."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=False)


class SensorNoise(Block):
    """White noise of the accelerometer."""

    sigma_mps2: Positive = Field(0.002, description="standard deviation per axis, m/s²")
    per: Literal["position", "sample"] = Field(
        "position", description="whether sigma_mps2 is that of a position's mean or of one sample"
    )
    rate_hz: Positive = Field(100.0, description="sampling rate; used with per: sample")
    duration_s: Positive = Field(2.0, description="duration of a hold; used with per: sample")


class RobotNoise(Block):
    """Noise of the robot's angles."""

    sigma_mgon: NotNegative = Field(3.2, description="standard deviation of roll and of pitch")


class GravityNoise(Block):
    """What is known of local gravity."""

    sigma_mps2: NotNegative = Field(
        0.0, description="standard deviation of the value used; 0 holds it fixed in the adjustment"
    )
    error_mps2: Finite = Field(0.0, description="systematic error of the value used")


class NoiseConfig(Block):
    """The stochastic model of all cells that do not say otherwise."""

    sensor: SensorNoise = SensorNoise()
    robot: RobotNoise = RobotNoise()
    gravity: GravityNoise = GravityNoise()


class Quantity(Block):
    """True values of the parameters of one effect."""

    value: list[Finite] = Field(description="one number per parameter of the effect")
    unit: str = Field(description="unit of the values, e.g. mgon, ppm, m/s^2")


class Grid(Block):
    """Cells: every combination of what is listed. A single value may stand for a list of one."""

    models: list[str] = Field(description="names of models, or all")
    schemes: list[str] = Field(description="names of schemes, or all")
    approaches: list[str] = Field(default=["gravity", "robot"], description="names, or all")
    replicates: Count = Field(description="simulated calibrations per cell")
    sensor_sigma_mps2: list[Positive] | None = Field(None, description="noise.sensor.sigma_mps2")
    robot_sigma_mgon: list[NotNegative] | None = Field(None, description="noise.robot.sigma_mgon")
    gravity_sigma_mps2: list[NotNegative] | None = Field(
        None, description="noise.gravity.sigma_mps2"
    )
    gravity_error_mps2: list[Finite] | None = Field(None, description="noise.gravity.error_mps2")

    @field_validator(
        "models",
        "schemes",
        "approaches",
        "sensor_sigma_mps2",
        "robot_sigma_mgon",
        "gravity_sigma_mps2",
        "gravity_error_mps2",
        mode="before",
    )
    @classmethod
    def _one_is_a_list(cls, value: Any) -> Any:
        return [value] if isinstance(value, str | int | float) else value


class Presets(Block):
    """The rows of the paper's Table 1, each with its own model and scheme."""

    replicates: Count = Field(description="simulated calibrations per row and approach")
    approaches: list[str] = Field(default=["gravity", "robot"], description="names")


class LevelingConfig(Block):
    """Where the tilt error that a calibration leaves is evaluated."""

    max_tilt_gon: Annotated[float, Field(gt=0, lt=100)] = Field(
        50.0, description="largest tilt of the z axis from the vertical"
    )
    attitudes: Count = Field(200, description="attitudes, spread evenly over that cap")


class SensitivityConfig(Block):
    """Variance-based sensitivity analysis of leveling (figures 4 to 6)."""

    base_samples: PowerOfTwo = Field(1024, description="Sobol base samples, a power of two")
    resamples: Count = Field(100, description="bootstrap resamples for confidence intervals")
    roll_gon: list[Finite] = Field(description="rolls of the grid")
    pitch_gon: list[Annotated[float, Field(gt=-100, lt=100)]] = Field(
        description="pitches of the grid"
    )
    model: str = Field("bias-scale-nonorthogonality", description="model of figures 5 and 6")
    scheme: str = Field("mclaren-24", description="scheme whose calibration gives the sds")

    @field_validator("base_samples")
    @classmethod
    def _is_power_of_two(cls, value: int) -> int:
        if value & (value - 1):
            raise ValueError("must be a power of two, as Sobol sequences are balanced only there")
        return value


class StudyConfig(Block):
    """A study."""

    study: Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]*$")] = Field(
        description="name; results go to results/<study>/"
    )
    seed: Annotated[int, Field(ge=0)] = Field(description="seed of all random numbers")
    gravity_mps2: Positive = Field(STANDARD_GRAVITY, description="true local gravity")
    noise: NoiseConfig = NoiseConfig()
    sensor: dict[str, Quantity] = Field(
        default_factory=dict, description="true parameters of the simulated sensor, by effect"
    )
    simulated_effects: Literal["model"] | list[str] = Field(
        "model",
        description="effects that the simulated sensor has: those of the cell's model, or a list",
    )
    models: dict[str, list[str]] = Field(
        default_factory=dict, description="models of your own: name and effects"
    )
    grids: list[Grid] = Field(default_factory=list, description="sets of cells")
    presets: Presets | None = Field(None, description="Table 1 of the paper")
    leveling: LevelingConfig = LevelingConfig()
    sensitivity: SensitivityConfig | None = Field(None, description="figures 4 to 6")
    paper: bool = Field(
        False,
        description="draw the paper's figures and judge its claims; needs `sensitivity`, and the "
        "cells of its model and scheme with both approaches",
    )

    @model_validator(mode="after")
    def _names_exist(self) -> StudyConfig:
        for name, effects in self.models.items():
            with _at(f"models.{name}"):
                if name in MODELS:
                    raise InputError("is the name of a registered model; choose another")
                SensorModel.of(name, effects)
        for name, quantity in self.sensor.items():
            with _at(f"sensor.{name}"):
                parameters = get_effect(name).parameters
                if len(quantity.value) != len(parameters):
                    raise InputError(
                        f"value: {len(quantity.value)} numbers; the effect has "
                        f"{len(parameters)} parameters ({', '.join(p.name for p in parameters)})"
                    )
                to_si(quantity.value, quantity.unit, parameters[0].unit)
        if isinstance(self.simulated_effects, list):
            with _at("simulated_effects"):
                for effect in self.simulated_effects:
                    get_effect(effect)
        for index, grid in enumerate(self.grids):
            with _at(f"grids.{index}.models"):
                self.model_names(grid.models)
            with _at(f"grids.{index}.schemes"):
                _known_schemes(grid.schemes)
            with _at(f"grids.{index}.approaches"):
                _known_approaches(grid.approaches)
        if self.presets is not None:
            with _at("presets.approaches"):
                _known_approaches(self.presets.approaches)
        if self.sensitivity is not None:
            with _at("sensitivity.model"):
                get_model(self.sensitivity.model, self.models)
            with _at("sensitivity.scheme"):
                get_scheme(self.sensitivity.scheme)
        if not self.grids and self.presets is None:
            raise ValueError("neither grids nor presets are given: the study has no cells")
        if self.paper and self.sensitivity is None:
            raise ValueError("paper: true needs the block `sensitivity` (figures 4 to 6)")
        return self

    def model_names(self, names: Sequence[str]) -> list[str]:
        """Spell out `all` and check that the models exist."""
        if list(names) == ["all"]:
            return [*MODELS, *self.models]
        return [get_model(name, self.models).name for name in names]

    @property
    def sigma_force(self) -> float:
        """Default noise of a position's mean, m/s²."""
        return self.position_sigma(self.noise.sensor.sigma_mps2)

    def position_sigma(self, sigma_mps2: float) -> float:
        """Noise of a position's mean, m/s², for a noise as configured (per position or sample)."""
        sensor = self.noise.sensor
        if sensor.per == "position":
            return sigma_mps2
        return sigma_of_mean(sigma_mps2, sensor.rate_hz, sensor.duration_s)

    def truth(self, effects: Iterable[str]) -> dict[str, float]:
        """Return the true parameters of the given effects in SI; those not configured are zero."""
        values: dict[str, float] = {}
        for name in effects:
            for i, parameter in enumerate(get_effect(name).parameters):
                quantity = self.sensor.get(name)
                values[parameter.name] = (
                    float(to_si(quantity.value[i], quantity.unit, parameter.unit))
                    if quantity
                    else 0.0
                )
        return values

    @property
    def fingerprint(self) -> str:
        """Hash of the whole configuration, defaults included."""
        text = json.dumps(self.model_dump(mode="json"), sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:16]


class _at:
    """Name the key at which an error occurs."""

    def __init__(self, key: str) -> None:
        self.key = key

    def __enter__(self) -> None:
        return None

    def __exit__(self, kind: Any, error: BaseException | None, trace: Any) -> None:
        if isinstance(error, InputError):
            raise ValueError(f"{self.key}: {error}") from None


def _known_schemes(names: Sequence[str]) -> list[str]:
    if list(names) == ["all"]:
        return list(scheme_names())
    return [get_scheme(name).name for name in names]


def _known_approaches(names: Sequence[str]) -> list[str]:
    if list(names) == ["all"]:
        return list(approach_names())
    return [get_approach(name).name for name in names]


def parse_study(content: Mapping[str, Any], source: str = "config") -> StudyConfig:
    """Check a configuration.

    Parameters
    ----------
    content : mapping, as read from YAML
    source : str, named in errors

    Raises
    ------
    InputError
        One line that names the source, the key, what is wrong and what would be right.
    """
    try:
        return StudyConfig.model_validate(content)
    except ValidationError as error:
        raise InputError(f"{source}: {_first_error(error)}") from None


def read_study(*paths: str | Path) -> StudyConfig:
    """Read a configuration from YAML files; later ones overlay earlier ones key by key.

    Raises
    ------
    InputError
        If a file cannot be read, is no YAML mapping, or does not fit the schema.
    """
    content: dict[str, Any] = {}
    for path in paths:
        try:
            layer = yaml.safe_load(Path(path).read_text(encoding="utf-8"))
        except OSError as error:
            raise InputError(f"{path}: {error.strerror or error}") from None
        except (yaml.YAMLError, UnicodeDecodeError) as error:
            line = " ".join(str(error).split())
            raise InputError(f"{path}: not valid YAML: {line}") from None
        if not isinstance(layer, dict):
            raise InputError(f"{path}: not a mapping of keys to values")
        content = _overlay(content, layer)
    return parse_study(content, ", ".join(str(path) for path in paths))


def _overlay(below: dict[str, Any], above: Mapping[str, Any]) -> dict[str, Any]:
    result = dict(below)
    for key, value in above.items():
        old = result.get(key)
        both = isinstance(old, dict) and isinstance(value, Mapping)
        result[key] = _overlay(dict(old or {}), value) if both else value
    return result


def _first_error(error: ValidationError) -> str:
    first, *others = error.errors()
    key = ".".join(str(part) for part in first["loc"])
    if first["type"] == "extra_forbidden":
        text = f"{key}: unknown key"
        siblings = _keys_beside(first["loc"])
        if siblings:
            text += f" (known: {', '.join(siblings)})"
    elif first["type"] == "value_error":
        text = ": ".join(filter(None, [key, str(first["ctx"]["error"])]))
    else:
        given = first["input"]
        shown = "" if first["type"] == "missing" else f", not {given!r}"
        text = f"{key}: {first['msg'][0].lower()}{first['msg'][1:]}{shown}"
    more = f" (and {len(others)} more)" if others else ""
    return f"{text}{more}"


def _keys_beside(location: Sequence[str | int]) -> list[str]:
    """Keys that are known where an unknown one stands."""
    block: Any = StudyConfig
    for part in location[:-1]:
        if isinstance(part, int):
            continue
        field = block.model_fields.get(part)
        if field is None:
            continue
        candidates = [field.annotation, *getattr(field.annotation, "__args__", ())]
        nested = [c for c in candidates if isinstance(c, type) and issubclass(c, Block)]
        if not nested:
            return []
        block = nested[0]
    return list(block.model_fields)
