"""Apply a calibration to readings, and level with it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from accelstudy.errors import InputError
from accelstudy.leveling import jacobian, roll_pitch
from accelstudy.models import compose
from accelstudy.sensor import SensorModel

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
    content : mapping, the whole file
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


def read_calibration(path: str | Path) -> Calibration:
    """Read `calibration.json`.

    Raises
    ------
    InputError
        If there is no such file or it is none.
    """
    try:
        content = json.loads(Path(path).read_text(encoding="utf-8"))
        parameters = [entry["value"] for entry in content["parameters"]]
        return Calibration(
            model=compose(content["model"], tuple(content["effects"])),
            parameters=np.array(parameters, dtype=float),
            covariance=np.array(content["covariance"], dtype=float),
            gravity=float(content["gravity_mps2"]),
            content=content,
        )
    except OSError as error:
        raise InputError(f"{path}: {error.strerror or error}") from None
    except (KeyError, TypeError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{path}: not a calibration.json of accelstudy ({error!r})") from None
