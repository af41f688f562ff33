"""The schema of the configuration of a study, `config/*.yaml`, checked before anything runs.

The models below are the schema; `workflow/schemas/config.schema.json` is generated from them.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from typing import Annotated, Any, Literal

from pydantic import Field, field_validator, model_validator

from accelstudy.approaches import approach_names, get_approach
from accelstudy.basics import bounds
from accelstudy.basics.errors import InputError
from accelstudy.basics.names import LONGEST
from accelstudy.basics.units import STANDARD_GRAVITY, to_si
from accelstudy.effects import get_effect
from accelstudy.files.reading import config_hash
from accelstudy.files.validation import (
    Configuration,
    Gravity,
    OneOrMore,
    Seed,
)
from accelstudy.noise_effects import get_noise_effect
from accelstudy.schemes import get_scheme, scheme_names
from accelstudy.schemes.files import held, remember
from accelstudy.sensors.models import MODELS, PRESETS, get_model
from accelstudy.sensors.sensor import SensorModel
from accelstudy.simulation.hold_plan import HoldPlan
from accelstudy.simulation.sessions import sigma_of_mean
from accelstudy.study.config.blocks import (
    Grid,
    HoldPlanConfig,
    LevelingConfig,
    NoiseConfig,
    Presets,
    Quantity,
    SensitivityConfig,
)

CLAIMED_EFFECTS = ("bias", "scale", "nonorthogonality")
"""Effects that the model of the paper's claims and figures must have."""


_NAME = "[A-Za-z0-9][A-Za-z0-9_-]*"


class StudyConfig(Configuration):
    """A study."""

    retired = {  # noqa: RUF012
        "keep": "every calibration is stored in estimates/: leave it out",
        "control": "linear theory is always the control variate: leave it out",
        "rare": "quantiles of small shares, such as 1e-6, are in the table quantiles where "
        "replicates are enough: leave it out",
    }

    study: Annotated[str, Field(pattern=f"^{_NAME}$", max_length=LONGEST)] = Field(
        description="name; results go to results/<study>/"
    )
    seed: Seed = Field(description="seed of all random numbers")
    gravity_mps2: Gravity = Field(STANDARD_GRAVITY, description="true local gravity")
    noise: NoiseConfig = NoiseConfig()
    holds: HoldPlanConfig = HoldPlanConfig()
    sensor: dict[str, Quantity] = Field(
        default_factory=dict,
        description="true parameters of the simulated sensor, by effect: its name, or its name "
        "with settings",
    )
    simulated_effects: OneOrMore[str] = Field(
        default=["model"],
        description="effects that the simulated sensor has: model, for those of the cell's model, "
        "or a list",
    )
    models: dict[str, OneOrMore[str]] = Field(
        default_factory=dict, description="models of your own: name and effects"
    )
    schemes: dict[str, dict[str, Any]] = Field(
        default_factory=dict,
        description="positions of the schemes that are read from files, as `scheme`, `title`, "
        "`source` and `directions`; filled in when the configuration is read",
    )
    grids: list[Grid] = Field(default_factory=list, description="sets of cells")
    presets: Presets | None = Field(None, description="Table 1 of the paper")
    leveling: LevelingConfig = LevelingConfig()
    sensitivity: SensitivityConfig | None = Field(None, description="figures 4 to 6")
    angle_unit: Literal["gon", "deg"] | None = Field(
        None,
        description="unit of angles in figures, gon or deg; without it the environment variable "
        "ACCELSTUDY_ANGLE_UNIT says, else gon. Tables keep their units",
    )
    paper: bool = Field(
        False,
        description="draw the paper's figures and judge its claims; needs `sensitivity`, and the "
        "cells of its model and scheme with both approaches",
    )

    @field_validator("schemes")
    @classmethod
    def _schemes_of_files(cls, given: dict[str, dict[str, Any]]) -> dict[str, dict[str, Any]]:
        """Remember these schemes before the grids name them."""
        for name, content in given.items():
            if (proper := remember(content, name).name) != name:
                raise InputError(
                    f"{name}: is the name of other positions; the name of these is {proper}"
                )
        return dict(given)

    @model_validator(mode="after")
    def _names_exist(self) -> StudyConfig:
        for name, effects in self.models.items():
            with _at(f"models.{name}"):
                if name in MODELS:
                    raise InputError("is the name of a registered model; choose another")
                if name == "all" or not re.fullmatch(_NAME, name) or len(name) > LONGEST:
                    raise InputError(
                        "is not a valid name: use letters, digits, _ and -, "
                        f"at most {LONGEST} of them, and not `all`"
                    )
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
        with _at("noise.effects"):
            for effect in self.noise.effects:
                get_noise_effect(effect)
        if self.simulated_effects != ["model"]:
            with _at("simulated_effects"):
                SensorModel.of("simulated", self.simulated_effects)
        with _at("holds"):
            self.hold_plan  # noqa: B018
        for index, grid in enumerate(self.grids):
            with _at(f"grids.{index}.models"):
                self.model_names(grid.models)
            with _at(f"grids.{index}.schemes"):
                _known_schemes(grid.schemes)
            with _at(f"grids.{index}.approaches"):
                _known_approaches(grid.approaches)
            with _at(f"grids.{index}: number of cells"):
                bounds.CELLS.check(self._n_cells(grid))
        for name in (name for grid in self.grids for name in grid.schemes):
            if (content := held(name)) is not None:
                self.schemes[name] = content
        self._check_gravity()
        if self.presets is not None:
            with _at("presets.approaches"):
                _known_approaches(self.presets.approaches)
        if not self.grids and self.presets is None:
            raise ValueError("neither grids nor presets are given: the study has no cells")
        if self.sensitivity is not None:
            self._check_sensitivity(self.sensitivity)
        elif self.paper:
            raise ValueError("paper: true needs the block `sensitivity` (figures 4 to 6)")
        return self

    def _check_gravity(self) -> None:
        """Check that the values of gravity, errors included, are within the bounds of gravity."""
        errors = {"noise.gravity.error_mps2": [self.noise.gravity.error_mps2]}
        for index, grid in enumerate(self.grids):
            errors[f"grids.{index}.gravity_error_mps2"] = grid.gravity_error_mps2 or []
        for key, values in errors.items():
            with _at(f"{key}: with it gravity"):
                for error in values:
                    bounds.GRAVITY.check(self.gravity_mps2 + error)

    def _check_sensitivity(self, settings: SensitivityConfig) -> None:
        """Check that the cells exist whose standard deviations the sensitivity analysis needs."""
        with _at("sensitivity.model"):
            model = get_model(settings.model, self.models)
            missing = set(CLAIMED_EFFECTS) - {effect.name for effect in model.effects}
            if self.paper and missing:
                raise InputError(
                    f"{settings.model!r} lacks {', '.join(sorted(missing))}, which the paper's "
                    "claims need; choose another model, or paper: false"
                )
        with _at("sensitivity.scheme"):
            get_scheme(settings.scheme)
        for name in ("roll_gon", "pitch_gon"):
            if self.paper and 0 not in getattr(settings, name):
                raise ValueError(f"sensitivity.{name}: must contain 0, which paper: true needs")
        for approach in ("gravity", "robot"):
            cell = f"{settings.model}/{settings.scheme}/{approach}"
            if self._usual_replicates(settings.model, settings.scheme, approach) < 2:
                raise ValueError(
                    f"sensitivity: needs at least 2 replicates of the cell {cell}, with the noise "
                    "of `noise`; add it to `grids`"
                )

    def _n_cells(self, grid: Grid) -> int:
        """Number of combinations in a grid, counted without making them."""
        lists: list[Sequence[object]] = [
            self.model_names(grid.models),
            _known_schemes(grid.schemes),
            _known_approaches(grid.approaches),
            grid.sensor_sigma_mps2 or [None],
            grid.robot_sigma_mgon or [None],
            grid.gravity_sigma_mps2 or [None],
            grid.gravity_error_mps2 or [None],
        ]
        return math.prod(map(len, lists))

    @property
    def all_grids(self) -> list[Grid]:
        """The grids, and the presets as grids."""
        if self.presets is None:
            return self.grids
        return [
            *self.grids,
            *(
                Grid(
                    models=[preset.model],
                    schemes=[preset.scheme],
                    approaches=self.presets.approaches,
                    replicates=self.presets.replicates,
                )
                for preset in PRESETS
            ),
        ]

    def _usual_replicates(self, model: str, scheme: str, approach: str) -> int:
        """Replicates of a cell with the noise of `noise`; 0 if the study has no such cell."""

        def has(values: list[float] | None, usual: float) -> bool:
            return values is None or usual in values

        noise = self.noise
        return max(
            (
                grid.replicates
                for grid in self.all_grids
                if model in self.model_names(grid.models)
                and scheme in _known_schemes(grid.schemes)
                and approach in _known_approaches(grid.approaches)
                and has(grid.sensor_sigma_mps2, noise.sensor.sigma_mps2)
                and (approach == "gravity" or has(grid.robot_sigma_mgon, noise.robot.sigma_mgon))
                and has(grid.gravity_sigma_mps2, noise.gravity.sigma_mps2)
                and has(grid.gravity_error_mps2, noise.gravity.error_mps2)
            ),
            default=0,
        )

    def model_names(self, names: Sequence[str]) -> list[str]:
        """Spell out `all` and check that the models exist."""
        if list(names) == ["all"]:
            return [*MODELS, *self.models]
        return [get_model(name, self.models).name for name in names]

    @property
    def hold_plan(self) -> HoldPlan:
        """Conditions of the holds."""
        holds = self.holds
        return HoldPlan(
            interval=holds.interval_s,
            temperature=holds.temperature_degC,
            temperature_order=holds.temperature_order,
            vibration=holds.vibration_mps2,
            yaw=holds.yaw,
            seed=self.seed,
        )

    @property
    def sigma_force(self) -> float:
        """Default noise of a position's mean, m/s²."""
        return self.position_sigma(self.noise.sensor.sigma_mps2)

    def position_sigma(self, sigma_mps2: float) -> float:
        """Noise of a position's mean, m/s², from the configured noise (per position or sample)."""
        sensor = self.noise.sensor
        if sensor.per == "position":
            return sigma_mps2
        return sigma_of_mean(sigma_mps2, sensor.rate_hz, sensor.duration_s)

    def truth(self, effects: Iterable[str]) -> dict[str, float]:
        """Return the true parameters of the given effects in SI; those not configured are zero."""
        values: dict[str, float] = {}
        given = {**self.sensor, **{get_effect(k).spec: v for k, v in self.sensor.items()}}
        for effect in map(get_effect, effects):
            key = effect.spec if effect.spec in given else effect.name
            quantity = given.get(key)
            # The value may be that of the whole effect although the model has a part of it.
            names = [parameter.name for parameter in get_effect(key).parameters]
            for name, unit in ((p.name, p.unit) for p in effect.parameters):
                values[name] = (
                    float(to_si(quantity.value[names.index(name)], quantity.unit, unit))
                    if quantity
                    else 0.0
                )
        return values

    @property
    def fingerprint(self) -> str:
        """Hash of everything that the numbers depend on, defaults included."""
        return config_hash(self.model_dump(mode="json"))


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
