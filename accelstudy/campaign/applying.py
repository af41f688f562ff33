"""Apply a calibration to readings, and level with it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import BaseModel, Field, ValidationError, model_validator

from accelstudy.campaign.header import Nominal, PerAxis
from accelstudy.campaign.wording import one_line
from accelstudy.errors import InputError
from accelstudy.leveling import jacobian, roll_pitch
from accelstudy.models import compose
from accelstudy.sensor import SensorModel
from accelstudy.study.config.errors import first_error
from accelstudy.study.config.types import Finite, NotNegative, Number, Positive

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Calibration:
    """A calibration, as `calibration.json` holds it.

    Attributes
    ----------
    model : SensorModel
    parameters : (u,) array, SI
    covariance : (u, u) array, SI
    gravity : float, m/s²
    content : mapping, what is used of the file
    """

    model: SensorModel
    parameters: Array
    covariance: Array
    gravity: float
    content: Mapping[str, Any]

    def correct(self, forces: ArrayLike) -> Array:
        """Calibrated specific force (n, 3) of readings (n, 3), m/s²."""
        return self.model.correct(forces, self.parameters, self.gravity)

    def level(self, forces: ArrayLike, sigma_force: float) -> tuple[Array, Array]:
        """Roll and pitch with standard deviations.

        Parameters
        ----------
        forces : (n, 3) array, m/s², readings
        sigma_force : float, m/s², noise of a reading, per axis

        Returns
        -------
        angles, sigma : (n, 2) arrays, rad; sigma holds the noise of the reading and the
        uncertainty of the calibration
        """
        forces = np.asarray(forces, dtype=float)
        corrected = self.correct(forces)
        slope = jacobian(corrected)
        # A reading's noise reaches the corrected force by ∂f_b/∂f_s, which is close to I.
        by_parameters = slope @ self.model.correction_jacobian(
            forces, self.parameters, self.gravity
        )
        variance = np.einsum("nau,uw,naw->na", by_parameters, self.covariance, by_parameters)
        variance += sigma_force**2 * np.sum(slope**2, axis=-1)
        return np.stack(roll_pitch(tuple(corrected.T)), axis=-1), np.sqrt(variance)


class _Shown(BaseModel):
    value: Finite
    sigma: NotNegative | None
    unit: str


class _Parameter(BaseModel):
    name: str
    value: Finite
    sigma: NotNegative | None
    sigma_priori: NotNegative | None
    sigma_posteriori: NotNegative | None
    unit: str
    shown: _Shown


Triple = Annotated[list[Finite], PerAxis]


class _Affine(BaseModel):
    matrix: Annotated[list[Triple], PerAxis]
    bias_mps2: Triple


class _Document(BaseModel):
    """What is read of `calibration.json`; the rest is for persons and other programs."""

    schema_version: Annotated[Literal[1], Number]
    campaign: str
    model: str
    effects: Annotated[list[str], Field(min_length=1)]
    unit: Literal["m/s^2", "g", "counts"]
    nominal: Nominal | None
    gravity_mps2: Positive
    sigma_position_mps2: NotNegative | None
    parameters: list[_Parameter]
    covariance: list[list[Finite | None]]
    affine: _Affine | None

    @model_validator(mode="after")
    def _whole(self) -> Self:
        names = list(compose(self.model, tuple(self.effects)).parameter_names)
        if [entry.name for entry in self.parameters] != names:
            raise ValueError(f"parameters: expected {', '.join(names)}, in this order")
        if {len(row) for row in self.covariance} | {len(self.covariance)} != {len(names)}:
            raise ValueError(f"covariance: expected {len(names)} rows of {len(names)} numbers")
        if self.unit == "counts" and self.nominal is None:
            raise ValueError("nominal: missing; unit: counts needs it")
        return self


def read_calibration(path: str | Path) -> Calibration:
    """Read `calibration.json`.

    Raises
    ------
    InputError
        If there is no such file or it is none.
    """
    try:
        document = _Document.model_validate(json.loads(Path(path).read_text(encoding="utf-8")))
    except OSError as error:
        raise InputError(f"{path}: {error.strerror or error}") from None
    except ValidationError as error:
        reason = first_error(error, _Document)
    except RecursionError:
        reason = "nested too deeply"
    except (ValueError, OverflowError) as error:
        reason = one_line(error)
    else:
        return Calibration(
            model=compose(document.model, tuple(document.effects)),
            parameters=np.array([entry.value for entry in document.parameters]),
            covariance=np.array(document.covariance, dtype=float),  # None becomes NaN
            gravity=document.gravity_mps2,
            content=document.model_dump(),
        )
    raise InputError(f"{path}: not a calibration.json of accelstudy: {reason}")
