"""A study, as its configuration `config/*.yaml` says: schema, parser and cells.

The models below are the schema; `workflow/schemas/config.schema.json` is generated from them.
Models, schemes, approaches and effects are written by their names; a section has the objects.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from contextvars import ContextVar
from functools import cached_property
from itertools import product
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    Field,
    GetPydanticSchema,
    ValidationInfo,
    ValidatorFunctionWrapHandler,
    field_validator,
    model_validator,
)
from pydantic_core import core_schema

from accelstudy.approaches import Approach, approach_names, get_approach
from accelstudy.basics import bounds
from accelstudy.basics.errors import InputError, brief, locate_errors
from accelstudy.basics.levels import MAX_TILT_GON
from accelstudy.basics.names import MAX_NAME_BYTES
from accelstudy.basics.units import GON, MGON, STANDARD_GRAVITY, to_si
from accelstudy.effects import Effect, get_effect, is_effect
from accelstudy.files import validation as kinds
from accelstudy.files.reading import overlay, read_layer
from accelstudy.files.validation import ConfigSection, Configuration, OneOrMore, validate
from accelstudy.leveling.error import ATTITUDES
from accelstudy.noise_effects import NoiseEffect, get_noise_effect
from accelstudy.schemes import Scheme, get_scheme, scheme_names
from accelstudy.schemes.files import known_scheme
from accelstudy.sensors.models import MODELS, NINE, compose, get_model
from accelstudy.sensors.sensor import SensorModel
from accelstudy.simulation.hold_plan import HoldPlan
from accelstudy.simulation.sessions import Noise
from accelstudy.study.cell import Cell
from accelstudy.study.compiling import with_compiled

# --- how a configuration is read ------------------------------------------------------------------


def read_study(*paths: str | Path) -> Study:
    """Read a configuration from YAML files; later ones overlay earlier ones key by key.

    Raises
    ------
    InputError
        If a file cannot be read, is no YAML mapping, or does not fit the schema.
    """
    content: dict[str, Any] = {}
    for path in paths:
        content = overlay(content, read_layer(path))
    return parse_study(content, ", ".join(map(str, paths)) or "config")


def parse_study(content: Mapping[str, Any], source: str = "config") -> Study:
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
    study = validate(Study, content, source)
    with locate_errors(source):
        study.check()
    return study


def named_files(content: Any) -> list[str]:
    """Files that a configuration names: of schemes, models and plug-ins."""
    if isinstance(content, str):
        named = content.endswith((".yaml", ".yml", ".py")) and Path(content).is_file()
        return [content] if named else []
    if isinstance(content, Mapping):
        content = [*content, *content.values()]
    if not isinstance(content, list):
        return []
    return sorted({path for each in content for path in named_files(each)})


def config_schema() -> dict[str, Any]:
    """JSON schema of the configuration, as kept in `workflow/schemas/config.schema.json`."""
    dialect = "https://json-schema.org/draft/2020-12/schema"
    return {"$schema": dialect, **Study.model_json_schema()}


# --- things that are written by their names -------------------------------------------------------

OWN_MODELS: ContextVar[Mapping[str, SensorModel]] = ContextVar(
    "own_models", default=MappingProxyType({})
)
"""Models that the configuration defines, while the sections that may name them are parsed."""


def _written(
    kind: Any, parse: Callable[[Any], Any], plain: Callable[[Any], Any]
) -> GetPydanticSchema:
    """How a field is written: the type in the file, and the ways to the object and back."""
    return GetPydanticSchema(
        lambda _, handler: core_schema.no_info_after_validator_function(
            parse,
            handler.generate_schema(kind),
            serialization=core_schema.plain_serializer_function_ser_schema(plain),
        )
    )


def _one(find: Callable[[str], Any]) -> GetPydanticSchema:
    return _written(str, find, lambda thing: thing.name)


def _several(
    find: Callable[[str], Any], everything: Callable[[], Iterable[str]]
) -> GetPydanticSchema:
    """How a list of things is written: by their names, or as `all`."""

    def parse(names: list[str]) -> list[Any]:
        return [find(name) for name in (everything() if names == ["all"] else names)]

    return _written(OneOrMore[str], parse, lambda things: [thing.name for thing in things])


def _model(text: str) -> SensorModel:
    return get_model(text, OWN_MODELS.get())


def _composed(effects: Iterable[str], name: str = "") -> SensorModel:
    """Compose a model; the same one for the same effects, however they are written."""
    parts = (get_model(e).effects if "+" in e or e in MODELS else [get_effect(e)] for e in effects)
    return compose(name, tuple(effect.spec for part in parts for effect in part))


def _specs(effects: Collection[Any]) -> list[str]:
    return [effect.spec for effect in effects]


def _noise_effects(texts: list[str]) -> list[NoiseEffect]:
    specs = [get_noise_effect(text).spec for text in texts]
    return [get_noise_effect(spec) for spec in specs]  # the same one, however it is written


def _effects(model: SensorModel | None) -> list[str]:
    return ["model"] if model is None else _specs(model.effects)


def _simulated(effects: list[str]) -> SensorModel | None:
    return None if effects == ["model"] else _composed(effects, "simulated")


_NAME = "[A-Za-z0-9][A-Za-z0-9_-]*"


def _name(name: str) -> str:
    if not re.fullmatch(_NAME, name) or len(name) > MAX_NAME_BYTES:
        raise InputError(
            f"{brief(name)} is not a valid name: use letters, digits, _ and -, "
            f"at most {MAX_NAME_BYTES} of them, and begin with a letter or a digit"
        )
    return name


def _own_name(name: str) -> str:
    if name in MODELS or is_effect(name) or name == "all":
        raise InputError("is the name of registered models or of an effect; choose another")
    return _name(name)


Models = Annotated[list[SensorModel], _several(_model, lambda: [*MODELS, *OWN_MODELS.get()])]
Schemes = Annotated[list[Scheme], _several(get_scheme, scheme_names)]
Approaches = Annotated[
    list[Approach],
    _several(get_approach, approach_names),
    Field(
        default=["gravity", "robot"],
        validate_default=True,
        description="names of approaches, or all",
    ),
]
Composition = Annotated[SensorModel, _written(OneOrMore[str], _composed, _effects)]
"""A model that is written as a list of effects."""
Simulated = Annotated[SensorModel | None, _written(OneOrMore[str], _simulated, _effects)]

# --- the sections --------------------------------------------------------------------------------


class SensorNoise(ConfigSection):
    """White noise of the accelerometer.

    Attributes
    ----------
    sigma_mps2 : standard deviation of the mean of a position, per axis, m/s²
    """

    retired = dict.fromkeys(
        ("per", "rate_hz", "duration_s"),
        "sigma_mps2 is that of a position's mean, σ/√n of n samples: leave out per, rate_hz and "
        "duration_s",
    )

    sigma_mps2: kinds.SigmaForce = 0.002


class RobotNoise(ConfigSection):
    """Noise of the robot's angles.

    Attributes
    ----------
    sigma_mgon : standard deviation of roll and of pitch
    """

    sigma_mgon: kinds.SigmaAngle = 3.2


class GravityNoise(ConfigSection):
    """What is known of local gravity.

    Attributes
    ----------
    sigma_mps2 : standard deviation of the value used; 0 holds it fixed in the adjustment
    error_mps2 : systematic error of the value used
    """

    sigma_mps2: kinds.SigmaGravity = 0.0
    error_mps2: kinds.GravityError = 0.0


class NoiseConfig(ConfigSection):
    """The stochastic model of all cells, except where a grid gives other values.

    Attributes
    ----------
    effects : noise effects of the forces, e.g. heavy_tails(nu=3), in the order in which they
        act; the calibration ignores them
    """

    sensor: SensorNoise = SensorNoise()
    robot: RobotNoise = RobotNoise()
    gravity: GravityNoise = GravityNoise()
    effects: Annotated[list[NoiseEffect], _written(list[str], _noise_effects, _specs)] = Field(
        default_factory=list
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


class HoldPlanConfig(ConfigSection):
    """Conditions of the holds, on which some effects depend.

    Attributes
    ----------
    interval_s : time between holds
    temperature_degC : temperatures from and to
    temperature_order : course of the temperature; ABBA: in quarters of the session
    vibration_mps2 : rms of the vibration, drawn for each hold between these
    yaw : yaw of the robot: zero, or drawn
    """

    interval_s: kinds.Interval | None = None
    temperature_degC: tuple[kinds.Temperature, kinds.Temperature] | None = None
    temperature_order: Literal["linear", "ABBA", "random"] = "linear"
    vibration_mps2: tuple[kinds.Vibration, kinds.Vibration] | None = None
    yaw: Literal["none", "random"] = "none"


class Quantity(ConfigSection):
    """True values of the parameters of one effect.

    Attributes
    ----------
    value : one number per parameter of the effect
    unit : unit of the values, e.g. mgon, ppm, m/s^2
    """

    value: OneOrMore[kinds.Finite]
    unit: str

    def in_si(self, effect: Effect) -> dict[str, float]:
        """The values by the names of the parameters of the effect, SI."""
        names = [parameter.name for parameter in effect.parameters]
        if len(self.value) != len(names):
            raise InputError(
                f"value: {len(self.value)} numbers; the effect has {len(names)} parameters "
                f"({', '.join(names)})"
            )
        pairs = zip(self.value, effect.parameters, strict=True)
        return {p.name: float(to_si(value, self.unit, p.unit)) for value, p in pairs}


class Grid(ConfigSection):
    """Cells: every combination of what is listed. A single value may stand for a list of one.

    Attributes
    ----------
    models : models: names, compositions as bias-scale+warm_up(tau=300), YAML files with a
        model; or all
    schemes : schemes: names, YAML files as `accelstudy design` writes them; or all
    replicates : simulated calibrations per cell
    sensor_sigma_mps2 : noise.sensor.sigma_mps2
    robot_sigma_mgon : noise.robot.sigma_mgon
    gravity_sigma_mps2 : noise.gravity.sigma_mps2
    gravity_error_mps2 : noise.gravity.error_mps2
    """

    models: Models
    schemes: Schemes
    approaches: Approaches
    replicates: kinds.Replicates
    sensor_sigma_mps2: OneOrMore[kinds.SigmaForce] | None = None
    robot_sigma_mgon: OneOrMore[kinds.SigmaAngle] | None = None
    gravity_sigma_mps2: OneOrMore[kinds.SigmaGravity] | None = None
    gravity_error_mps2: OneOrMore[kinds.GravityError] | None = None

    def lists(self, usual: Mapping[str, float]) -> list[list[Any]]:
        """Models, schemes, approaches, and values of the settings of the noise, in their order."""
        noises = [getattr(self, key) or [value] for key, value in usual.items()]
        return [self.models, self.schemes, self.approaches, *noises]

    @model_validator(mode="after")
    def _not_too_many(self) -> Grid:
        count = math.prod(map(len, self.lists(NoiseConfig().settings)))
        bounds.CELLS.check_key("number of cells", count)
        return self


class LevelingConfig(ConfigSection):
    """Where the tilt error that a calibration leaves is evaluated.

    Attributes
    ----------
    max_tilt_gon : largest tilt of the z axis from the vertical
    attitudes : least number of attitudes, spread evenly over these tilts
    """

    max_tilt_gon: kinds.Tilt = MAX_TILT_GON
    attitudes: kinds.Attitudes = ATTITUDES


class SensitivityConfig(ConfigSection):
    """Variance-based sensitivity analysis of leveling (figures 4 to 6).

    Attributes
    ----------
    base_samples : Sobol base samples, a power of two
    roll_gon : rolls of the grid
    pitch_gon : pitches of the grid
    model : model of figures 5 and 6
    scheme : scheme whose calibration gives the sds
    """

    retired = {  # noqa: RUF012
        "resamples": "intervals follow from the scatter of the samples: leave it out"
    }

    base_samples: kinds.BaseSamples = 1024
    roll_gon: OneOrMore[kinds.Angle]
    pitch_gon: OneOrMore[kinds.Pitch]
    model: Annotated[SensorModel, _one(_model)] = Field(NINE, validate_default=True)
    scheme: Annotated[Scheme, _one(get_scheme)] = Field("mclaren-24", validate_default=True)

    def cell(self, approach: str, scheme: str = "") -> str:
        """Name of the cell of an approach, in the scheme of the analysis if no other is named."""
        return f"{self.model.name}/{scheme or self.scheme.name}/{approach}"

    def check(self, study: Study) -> None:
        """Check that the calibrations exist whose standard deviations the analysis needs."""
        if columns := self.model.hold_columns:
            raise InputError(
                f"sensitivity.model: {self.model.name!r} depends on the {columns[0]} of each "
                "hold, and leveling is analysed without; choose another model"
            )
        missing = CLAIMED_EFFECTS - {effect.name for effect in self.model.effects}
        if study.paper and missing:
            raise InputError(
                f"sensitivity.model: {self.model.name!r} lacks {', '.join(sorted(missing))}, "
                "which the paper's claims need; choose another model, or paper: false"
            )
        zeros = [name for name, x in study.truth(sorted(CLAIMED_EFFECTS)).items() if x == 0]
        if study.paper and zeros:
            raise InputError(f"sensor: {', '.join(zeros)}: must not be 0, which paper: true needs")
        for name in ("roll_gon", "pitch_gon"):
            if study.paper and 0 not in getattr(self, name):
                raise InputError(f"sensitivity.{name}: must contain 0, which paper: true needs")
        cells = {cell.name: cell for cell in study.cells}
        for name in map(self.cell, APPROACHES):
            if name not in cells or cells[name].replicates < 2:
                raise InputError(
                    f"sensitivity: needs at least 2 replicates of the cell {name}, with the noise "
                    "of `noise`; add it to `grids`"
                )
            positions = cells[name].estimability
            if not positions.estimable:
                raise InputError(f"sensitivity: {name} cannot be estimated: {positions.reason}")
            if study.paper and positions.redundancy == 0:
                raise InputError(f"sensitivity: {name} has no redundancy, which paper: true needs")


APPROACHES = ("gravity", "robot")
"""The approaches that the analysis, the figures of the paper and its claims compare."""
CLAIMED_EFFECTS = {"bias", "scale", "nonorthogonality"}
"""Effects that the model of the paper's claims and figures must have."""
HOLD_KEYS = {
    "time": "holds.interval_s",
    "temperature": "holds.temperature_degC",
    "vibration": "holds.vibration_mps2",
}
"""Columns of the holds and the keys that provide them."""

# --- the study -----------------------------------------------------------------------------------


class Study(Configuration):
    """A study.

    Attributes
    ----------
    study : name; results go to results/<study>/
    seed : seed of all random numbers
    gravity_mps2 : true local gravity
    sensor : true parameters of the simulated sensor, by effect: its name, or its name with
        settings
    simulated_effects : effects that the simulated sensor has: model, for those of the cell's
        model, or a list
    models : models of your own: name and effects
    grids : sets of cells
    sensitivity : figures 4 to 6
    angle_unit : unit of angles in figures, gon or deg; without it the environment variable
        ACCELSTUDY_ANGLE_UNIT says, else gon. Tables keep their units
    paper : draw the paper's figures and judge its claims; needs `sensitivity`, and the cells of
        its model and scheme with both approaches
    """

    retired = {  # noqa: RUF012
        "keep": "every calibration is stored in estimates/: leave it out",
        "presets": "the rows of Table 1 are cells of `grids`: leave it out",
        "schemes": "write positions into a YAML file, and its path into `grids`",
    }

    study: Annotated[str, AfterValidator(_name)] = Field(
        json_schema_extra={"pattern": f"^{_NAME}$", "maxLength": MAX_NAME_BYTES}
    )
    seed: kinds.Seed
    gravity_mps2: kinds.Gravity = STANDARD_GRAVITY
    noise: NoiseConfig = NoiseConfig()
    holds: HoldPlanConfig = HoldPlanConfig()
    sensor: dict[str, Quantity] = Field(default_factory=dict)
    simulated_effects: Simulated = Field(default=["model"], validate_default=True)
    models: dict[Annotated[str, AfterValidator(_own_name)], Composition] = Field(
        default_factory=dict
    )
    grids: list[Grid] = Field(min_length=1)
    leveling: LevelingConfig = LevelingConfig()
    sensitivity: SensitivityConfig | None = None
    angle_unit: Literal["gon", "deg"] | None = None
    paper: bool = False

    @field_validator("models")
    @classmethod
    def _named(cls, models: dict[str, SensorModel]) -> dict[str, SensorModel]:
        """Give each model the name under which it stands."""
        return {name: _composed(_specs(model.effects), name) for name, model in models.items()}

    @field_validator("grids", "sensitivity", mode="wrap")
    @classmethod
    def _with_own_models(
        cls, content: Any, parse: ValidatorFunctionWrapHandler, info: ValidationInfo
    ) -> Any:
        """Parse what may name models that the configuration defines itself."""
        if "models" not in info.data:  # it is these that are wrong
            return content
        before = OWN_MODELS.set(info.data["models"])
        try:
            return parse(content)
        finally:
            OWN_MODELS.reset(before)

    def check(self) -> None:
        """Check that all fits together; jobs read a configuration that was checked before.

        Raises
        ------
        InputError
            One line that names the key, what is wrong and what would be right.
        """
        for name, quantity in self.sensor.items():
            with locate_errors(f"sensor.{name}"):
                quantity.in_si(get_effect(name))
        simulated = self.simulated_effects.effects if self.simulated_effects else ()
        models = [model for grid in self.grids for model in grid.models]
        effects = [*simulated, *(effect for model in models for effect in model.effects)]
        for effect in {effect.spec: effect for effect in effects}.values():
            if column := self.hold_plan.missing(effect):
                raise InputError(
                    f"{HOLD_KEYS[column]}: missing; the effect {effect.name!r} needs the {column} "
                    "of each hold"
                )
        for effect in simulated:
            if not self._keys.keys() & {effect.spec, effect.name}:
                raise InputError(
                    f"sensor.{effect.spec}: missing; each effect of simulated_effects needs its "
                    "value and unit (0 is a value, too)"
                )
        if self.sensitivity is not None:
            self.sensitivity.check(self)
        elif self.paper:
            raise InputError("paper: true needs the block `sensitivity` (figures 4 to 6)")

    @cached_property
    def cells(self) -> list[Cell]:
        """All cells, in the order of the configuration, without repetition.

        A cell that occurs more than once runs once, with the largest number of replicates.
        """
        cells: dict[str, Cell] = {}
        for cell in (cell for grid in self.grids for cell in self._cells_of(grid)):
            earlier = cells.get(cell.name)
            if earlier is None or cell.replicates > earlier.replicates:
                cells[cell.name] = cell
        return with_compiled(list(cells.values()))

    def _cells_of(self, grid: Grid) -> Iterator[Cell]:
        usual = self.noise.settings
        for model, scheme, approach, *noise in product(*grid.lists(usual)):
            settings = dict(zip(usual, noise, strict=True))
            if not approach.uses_angles:  # the same cell whatever the robot's accuracy
                settings["robot_sigma_mgon"] = usual["robot_sigma_mgon"]
            changed = [f"{k}={_number_text(v)}" for k, v in settings.items() if v != usual[k]]
            effects = tuple(_specs(model.effects))
            simulated = tuple(_specs((self.simulated_effects or model).effects))
            file = known_scheme(scheme.name)
            yield Cell(
                name="/".join([model.name, scheme.name, approach.name, *changed]),
                model=model.name,
                effects=effects,
                simulated_effects=simulated,
                scheme=scheme.name,
                approach=approach.name,
                replicates=grid.replicates,
                noise=Noise(
                    settings["sensor_sigma_mps2"],
                    settings["robot_sigma_mgon"] * MGON if approach.uses_angles else 0.0,
                    settings["gravity_sigma_mps2"],
                    settings["gravity_error_mps2"],
                    tuple(_specs(self.noise.effects)),
                ),
                gravity=self.gravity_mps2,
                truth=self.truth(dict.fromkeys([*effects, *simulated])),
                holds=self.hold_plan,
                directions=None if file is None else tuple(map(tuple, file.directions.tolist())),
                max_tilt=self.leveling.max_tilt_gon * GON,
                attitudes=self.leveling.attitudes,
            )

    @property
    def hold_plan(self) -> HoldPlan:
        """Conditions of the holds."""
        holds = self.holds
        columns = holds.temperature_degC, holds.temperature_order, holds.vibration_mps2
        return HoldPlan(holds.interval_s, *columns, holds.yaw, self.seed)

    @cached_property
    def _keys(self) -> dict[str, str]:
        """Keys of `sensor` by the effects that they stand for."""
        return {key: key for key in self.sensor} | {get_effect(k).spec: k for k in self.sensor}

    def truth(self, effects: Iterable[str]) -> dict[str, float]:
        """Return the true parameters of the given effects in SI; those not configured are zero."""
        values: dict[str, float] = {}
        for effect in map(get_effect, effects):
            # The value may be that of the whole effect although the model has a part of it.
            key = self._keys.get(effect.spec) or self._keys.get(effect.name)
            configured = self.sensor[key].in_si(get_effect(key)) if key else {}
            values |= {p.name: configured.get(p.name, 0.0) for p in effect.parameters}
        return values


def _number_text(value: float) -> str:
    """Show a number briefly, but never two numbers alike."""
    short = f"{value:g}"
    return short if float(short) == value else repr(value)
