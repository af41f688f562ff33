"""Prior knowledge of a sensor by others of its type: the file that `accelstudy lot` writes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import Field

from accelstudy.adjustment.observations import Known
from accelstudy.basics.errors import InputError
from accelstudy.files.documents import Document, Part
from accelstudy.files.reading import read_layer
from accelstudy.files.validation import ParameterSigma, ParameterValue, validate
from accelstudy.sensors.sensor import SensorModel

if TYPE_CHECKING:
    from accelstudy.campaign.session import Campaign

TYPE_FILE = "type.yaml"
TYPE_KEYS = ("schema_version", "models", "sensors", "parameters", "plugins")
"""Keys of a file of a type that data sheets do not have."""
MIN_SENSORS = 5
"""Least number of sensors whose scatter is a prior for the next one."""


@dataclass(frozen=True)
class SensorType:
    """Prior knowledge of a sensor by others of its type.

    Attributes
    ----------
    file : str
    sensors : int, number of them
    known : mapping of str to (mean, sigma), SI, of the parameters that all of them have
    """

    file: str
    sensors: int
    known: Known


class TypicalParameter(Part):
    """A parameter over the sensors of a type, SI.

    Attributes
    ----------
    mean : mean of the type
    sigma : its standard deviation
    scatter : standard deviation from sensor to sensor
    scatter_below : bound below which the scatter is with a probability of 90 %
    unit : SI unit
    in_all : whether the next sensor has it, too: all have it, and it belongs to the sensor and not
        to its mounting
    """

    mean: ParameterValue
    sigma: ParameterSigma
    scatter: ParameterSigma
    scatter_below: ParameterSigma
    unit: str
    in_all: bool

    @property
    def sigma_next(self) -> float:
        """Standard deviation of the next sensor about the mean; the scatter is at its bound."""
        return float((self.scatter_below**2 + self.sigma**2) ** 0.5)


class TypeFile(Document):
    """A type of sensors; `accelstudy lot` writes it. It has the keys of a data sheet as well.

    Attributes
    ----------
    models : model of the type, without sudden effects
    sensors : how many were calibrated and are not odd
    parameters : parameters by their names
    """

    file = TYPE_FILE
    models: dict[str, Any]
    sensors: Annotated[int, Field(ge=1)]
    parameters: dict[str, TypicalParameter]


def read_type(path: str | Path, model: SensorModel) -> SensorType:
    """Read prior knowledge of a sensor from the file of its type.

    Raises
    ------
    InputError
        If the file is none of a type, its model is another one, or it tells of too few sensors.
    """
    content = read_layer(path)
    if not isinstance(content.get("parameters"), Mapping):  # those of a calibration are a list
        raise InputError(f"{path}: no file of a type; `accelstudy lot` writes one, {TYPE_FILE}")
    read = validate(TypeFile, content, path)
    if {*read.parameters} != {*model.parameter_names}:
        raise InputError(
            f"{path}: tells of {', '.join(read.parameters)}, but the model {model.name!r} has "
            f"{', '.join(model.parameter_names)}; give `model` {path}"
        )
    if read.sensors < MIN_SENSORS:
        raise InputError(
            f"{path}: sensors: {read.sensors} are too few to tell how far the next one may be "
            f"away; {MIN_SENSORS} or more do"
        )
    known_of = {
        name: (p.mean, p.sigma_next)
        for name, p in read.parameters.items()
        if p.in_all and p.sigma_next > 0
    }
    return SensorType(str(path), read.sensors, known_of)


def with_type(campaign: Campaign, path: str | Path | None, model: SensorModel) -> Campaign:
    """Add prior knowledge by the file of a type to a campaign, if there is such a file."""
    return campaign if path is None else replace(campaign, sensor_type=read_type(path, model))
