"""A study, as its configuration `config/*.yaml` says: schema, parser and cells.

The models below are the schema; `workflow/schemas/config.schema.json` is generated from them.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from functools import cached_property
from itertools import product
from typing import Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    Field,
    ValidationInfo,
    ValidatorFunctionWrapHandler,
    field_validator,
    model_validator,
)

from accelstudy.basics import bounds
from accelstudy.basics.errors import InputError
from accelstudy.basics.names import LONGEST
from accelstudy.basics.units import MGON, STANDARD_GRAVITY, to_si
from accelstudy.effects import get_effect
from accelstudy.files.reading import config_hash
from accelstudy.files.validation import Configuration, Gravity, OneOrMore, Seed
from accelstudy.schemes import get_scheme
from accelstudy.schemes.files import held, remember
from accelstudy.sensors.models import MODELS, PRESETS, get_model
from accelstudy.sensors.sensor import SensorModel
from accelstudy.simulation.hold_plan import HoldPlan
from accelstudy.simulation.sessions import Noise
from accelstudy.study.cell import Cell
from accelstudy.study.compiling import with_compiled
from accelstudy.study.config.blocks import (
    OWN_MODELS,
    Composition,
    Grid,
    HoldPlanConfig,
    LevelingConfig,
    NoiseConfig,
    Presets,
    Quantity,
    SensitivityConfig,
    Written,
    composed,
    specs,
)

CLAIMED_EFFECTS = ("bias", "scale", "nonorthogonality")
"""Effects that the model of the paper's claims and figures must have."""

_NAME = "[A-Za-z0-9][A-Za-z0-9_-]*"


def _own_name(name: str) -> str:
    if name in MODELS:
        raise InputError("is the name of a registered model; choose another")
    if name == "all" or not re.fullmatch(_NAME, name) or len(name) > LONGEST:
        raise InputError(
            "is not a valid name: use letters, digits, _ and -, "
            f"at most {LONGEST} of them, and not `all`"
        )
    return name


def _simulated(effects: list[str]) -> SensorModel | None:
    return None if effects == ["model"] else composed("simulated", effects)


Simulated = Annotated[
    SensorModel | None,
    Written(
        OneOrMore[str],
        _simulated,
        lambda model: specs(model.effects) if model else ["model"],
    ),
]


class Study(Configuration):
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
    simulated_effects: Simulated = Field(
        default=["model"],
        validate_default=True,
        description="effects that the simulated sensor has: model, for those of the cell's model, "
        "or a list",
    )
    models: dict[Annotated[str, AfterValidator(_own_name)], Composition] = Field(
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

    @field_validator("models")
    @classmethod
    def _named(cls, models: dict[str, SensorModel]) -> dict[str, SensorModel]:
        """Give each model the name under which it stands."""
        return {name: composed(name, specs(model.effects)) for name, model in models.items()}

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

    @field_validator("grids", "sensitivity", mode="wrap")
    @classmethod
    def _with_own_models(
        cls, content: Any, parse: ValidatorFunctionWrapHandler, info: ValidationInfo
    ) -> Any:
        """Parse what may name models and schemes that the configuration defines itself."""
        if not {"models", "schemes"} <= info.data.keys():  # it is these that are wrong
            return content
        before = OWN_MODELS.set(info.data["models"])
        try:
            return parse(content)
        finally:
            OWN_MODELS.reset(before)

    @model_validator(mode="after")
    def _fits_together(self) -> Study:
        for name, quantity in self.sensor.items():
            with _at(f"sensor.{name}"):
                quantity.check(get_effect(name))
        self._check_gravity()
        if not self.grids and self.presets is None:
            raise ValueError("neither grids nor presets are given: the study has no cells")
        for scheme in (scheme for grid in self.grids for scheme in grid.schemes):
            if (content := held(scheme.name)) is not None:
                self.schemes[scheme.name] = content
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
        missing = set(CLAIMED_EFFECTS) - {effect.name for effect in settings.model.effects}
        if self.paper and missing:
            raise ValueError(
                f"sensitivity.model: {settings.model.name!r} lacks {', '.join(sorted(missing))}, "
                "which the paper's claims need; choose another model, or paper: false"
            )
        for name in ("roll_gon", "pitch_gon"):
            if self.paper and 0 not in getattr(settings, name):
                raise ValueError(f"sensitivity.{name}: must contain 0, which paper: true needs")
        replicates = {cell.name: cell.replicates for cell in self.cells}
        for cell in map(settings.cell, ("gravity", "robot")):
            if replicates.get(cell, 0) < 2:
                raise ValueError(
                    f"sensitivity: needs at least 2 replicates of the cell {cell}, with the noise "
                    "of `noise`; add it to `grids`"
                )

    @property
    def all_grids(self) -> list[Grid]:
        """The grids, and the presets as grids."""
        rows = () if self.presets is None else PRESETS
        return [
            *self.grids,
            *(
                Grid.model_construct(
                    models=[get_model(row.model)],
                    schemes=[get_scheme(row.scheme)],
                    **dict(self.presets or ()),
                )
                for row in rows
            ),
        ]

    @cached_property
    def cells(self) -> list[Cell]:
        """All cells, in the order of the configuration, without repetition.

        A cell that occurs more than once, such as in Table 1 and in a grid, runs once, with the
        largest number of replicates.
        """
        cells: dict[str, Cell] = {}
        for cell in (cell for grid in self.all_grids for cell in self._cells_of(grid)):
            earlier = cells.get(cell.name)
            if earlier is None or cell.replicates > earlier.replicates:
                cells[cell.name] = cell
        return with_compiled(list(cells.values()))

    def _cells_of(self, grid: Grid) -> Iterator[Cell]:
        usual, noises = self.noise.settings, [*product(*grid.noises(self.noise))]
        for model, scheme, approach, noise in product(
            grid.models, grid.schemes, grid.approaches, noises
        ):
            settings = dict(zip(usual, noise, strict=True))
            if not approach.uses_angles:  # the same cell whatever the robot's accuracy
                settings["robot_sigma_mgon"] = usual["robot_sigma_mgon"]
            changed = [f"{k}={_shown(v)}" for k, v in settings.items() if v != usual[k]]
            effects = tuple(specs(model.effects))
            simulated = tuple(specs((self.simulated_effects or model).effects))
            file = held(scheme.name)
            yield Cell(
                name="/".join([model.name, scheme.name, approach.name, *changed]),
                model=model.name,
                effects=effects,
                simulated_effects=simulated,
                scheme=scheme.name,
                approach=approach.name,
                replicates=grid.replicates,
                noise=Noise(
                    self.noise.sensor.of_mean(settings["sensor_sigma_mps2"]),
                    settings["robot_sigma_mgon"] * MGON if approach.uses_angles else 0.0,
                    settings["gravity_sigma_mps2"],
                    settings["gravity_error_mps2"],
                    tuple(specs(self.noise.effects)),
                ),
                gravity=self.gravity_mps2,
                truth=self.truth(dict.fromkeys([*effects, *simulated])),
                holds=self.hold_plan,
                directions=None if file is None else tuple(map(tuple, file["directions"])),
            )

    @property
    def hold_plan(self) -> HoldPlan:
        """Conditions of the holds."""
        return self.holds.plan(self.seed)

    @property
    def sigma_force(self) -> float:
        """Default noise of a position's mean, m/s²."""
        return self.noise.sensor.of_mean(self.noise.sensor.sigma_mps2)

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


@contextmanager
def _at(key: str) -> Iterator[None]:
    """Name the key at which an error occurs."""
    try:
        yield
    except InputError as error:
        raise ValueError(f"{key}: {error}") from None


def _shown(value: float) -> str:
    """Show a number briefly, but never two numbers alike."""
    short = f"{value:g}"
    return short if float(short) == value else repr(value)
