"""A reference sensor: it is calibrated, and gives roll and pitch of each hold.

Its readings have noise, independent from hold to hold. Its calibration has errors, the same in all
holds: with the covariance matrix C = L Lᵀ of its parameters they are J L c, with the derivatives J
of roll and pitch by the parameters, and unknown numbers c that are 0 ± 1.
"""

from __future__ import annotations

from functools import cached_property
from typing import Annotated, Self

import numpy as np
from pydantic import AfterValidator, Field, model_validator

from accelstudy.basics.arrays import Array
from accelstudy.files.validation import ConfigSection, Finite, SigmaForce
from accelstudy.leveling.angles import jacobian, specific_force
from accelstudy.sensors.frames import Frame, parse_frame
from accelstudy.sensors.models import compose
from accelstudy.sensors.sensor import SensorModel

MIN_POLE_DISTANCE = 1e-4
"""rad; nearer to the pole of roll its derivatives are those at this distance."""


class ReferenceSensor(ConfigSection):
    """A reference sensor, whose roll and pitch stand in the table of positions.

    Attributes
    ----------
    calibration : campaign of its calibration
    frame : where its axes x, y and z point, in the axes of the sensor: frd if they are the same
        up to a small rotation
    sigma_mps2 : standard deviation of its mean in a hold, per axis
    effects : its model
    parameters : its calibration, SI
    covariance : covariance matrix of the parameters, SI
    """

    calibration: str
    frame: Annotated[str, AfterValidator(lambda name: parse_frame(name).name)]
    sigma_mps2: SigmaForce
    effects: Annotated[list[str], Field(min_length=1)]
    parameters: list[Finite]
    covariance: list[list[Finite]]

    @model_validator(mode="after")
    def _whole(self) -> Self:
        u = self.model.n_parameters
        if {len(self.parameters), len(self.covariance), *map(len, self.covariance)} != {u}:
            raise ValueError(f"parameters, covariance: expected {u} and {u} by {u} numbers")
        return self

    @property
    def model(self) -> SensorModel:
        """Sensor model of the reference."""
        return compose("+".join(self.effects), tuple(self.effects))

    @property
    def axes(self) -> Frame:
        """Frame of the axes of the reference."""
        return parse_frame(self.frame)

    @cached_property
    def _root(self) -> Array:
        """L, (u, u), of a covariance matrix that may be singular."""
        values, vectors = np.linalg.eigh(np.array(self.covariance))
        return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))

    def errors(self, angles: Array, gravity: float) -> tuple[Array, Array]:
        """Errors of roll and pitch in some attitudes.

        Parameters
        ----------
        angles : (n, 2) array, rad
        gravity : float, m/s²

        Returns
        -------
        sigma : (n, 2) array, rad, standard deviations by the noise of its readings
        common : (n, 2, u) array, rad, derivatives J L by the errors of its calibration
        """
        most = np.pi / 2 - MIN_POLE_DISTANCE
        roll, pitch = angles[:, 0], np.clip(angles[:, 1], -most, most)
        forces = np.column_stack(specific_force(roll, pitch, gravity))
        own, model, p = self.axes.from_frd(forces), self.model, np.array(self.parameters)
        output = model.sense(own, p, gravity)
        by_force = jacobian(forces) @ self.axes.matrix
        by_output = by_force @ model.output_jacobian(output, p, gravity)
        by_parameters = by_force @ model.correction_jacobian(output, p, gravity)
        return self.sigma_mps2 * np.linalg.norm(by_output, axis=-1), by_parameters @ self._root
