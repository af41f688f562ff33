"""A calibration without the effects of the rig, which corrects readings and levels with them."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from accelstudy.basics.arguments import path_of
from accelstudy.basics.arrays import Array
from accelstudy.basics.errors import InputError, brief
from accelstudy.campaign.calibration.file_format import CalibrationDocument
from accelstudy.campaign.columns import COLUMNS
from accelstudy.campaign.header import LogLayout
from accelstudy.effects import HoldConditions, TemperatureCourse
from accelstudy.effects.hold_conditions import REFERENCE_TEMPERATURE
from accelstudy.leveling.angles import angles_of, jacobian, tilt_slope
from accelstudy.sensors.models import compose
from accelstudy.sensors.sensor import SensorModel

RANGE_MARGIN = 0.1
"""Part of the width of a range by which a log may leave it without a warning."""
DEVICE_COLUMNS = {name: COLUMNS[name].keys[0] for name in ("time", "temperature", "vibration")}
"""Columns of `HoldConditions` that a device has, and the ranges of a calibration in them."""
FORCES = ("fx_mps2", "fy_mps2", "fz_mps2")
RANGED = {key: (name, COLUMNS[name].unit) for name, key in DEVICE_COLUMNS.items()} | {
    key: ("specific force", f"m/s² {way}")
    for key, way in zip(FORCES, ("forward", "right", "down"), strict=True)
}
"""What a calibration has a range of, in words, and its unit."""
LEVELS = 5
"""Number of values of a condition that matters."""


@dataclass(frozen=True, eq=False)
class SensorCalibration:
    """A calibration without the effects of the rig, which corrects readings.

    Attributes
    ----------
    document : CalibrationDocument, all that its file says
    model : SensorModel
    parameters : (u,) array, SI
    covariance : (u, u) array, SI
    """

    document: CalibrationDocument
    model: SensorModel
    parameters: Array
    covariance: Array

    @classmethod
    def of(cls, document: CalibrationDocument, where: str) -> SensorCalibration:
        """Take the part of a calibration that belongs to the sensor; errors begin with `where`."""
        # Effects of the rig were estimated together with those of the sensor, but stay with it.
        estimated = compose(document.model, tuple(document.effects))
        model, stays = estimated.without_rig, np.flatnonzero(estimated.stays)
        covariance = np.array(document.covariance, dtype=float)  # None becomes NaN
        parameters = np.array([entry.value for entry in document.parameters])[stays]
        if not model.hold_columns:
            g = document.gravity_mps2
            corrected = model.correct(g * np.concatenate([np.eye(3), -np.eye(3)]), parameters, g)
            if not np.isfinite(corrected).all(1).any():
                raise InputError(f"{where}: parameters: with these no force explains any reading")
        return cls(document, model, parameters, covariance[np.ix_(stays, stays)])

    @property
    def gravity(self) -> float:
        """Gravity where it was calibrated, m/s²."""
        return self.document.gravity_mps2

    @property
    def ranges(self) -> Mapping[str, list[float]]:
        """Smallest and largest force, time, temperature and vibration of the calibration."""
        return self.document.ranges

    @property
    def dof(self) -> float:
        """Degrees of freedom of the noise in its sigmas; infinite where it is known."""
        of_residuals = self.document.sigma_source == "a posteriori"
        default = self.document.redundancy if of_residuals else np.inf  # of files of 0.2
        return self.document.sigma_dof or default

    @property
    def usual_layout(self) -> LogLayout:
        """How a log of the sensor is read: as that of the campaign, or in the campaign's unit."""
        nominal = self.document.nominal
        of_unit = {} if nominal is None else nominal.model_dump()
        return self.document.log or LogLayout(unit=self.document.unit, **of_unit)

    @cached_property
    def mending(self) -> Array:
        """C (3, 3) that turns forces as they are read into those that were fitted, in frd.

        It differs from I if the data had a gross error that a diagnosis mended.
        """
        mended = self.document.mended
        return np.eye(3) if mended is None or mended.matrix is None else np.array(mended.matrix)

    @property
    def drifts(self) -> tuple[str, ...]:
        """Effects that drift during the session; afterwards they keep their value at its end."""
        return tuple(effect.name for effect in self.model.effects if effect.drifts)

    @property
    def noise_of_reading(self) -> float:
        """Noise of a reading, m/s²: the noise within the holds of the campaign.

        If that is unknown it is the noise of the mean of a hold, which is smaller; 0 if neither is
        known.
        """
        sigmas = self.document.sigma_reading_mps2, self.document.sigma_position_mps2
        return next((sigma for sigma in sigmas if sigma is not None), 0.0)

    def value(self, parameter: str) -> float:
        """Value of a parameter, SI."""
        return float(self.parameters[self.model.parameter_names.index(parameter)])

    def check_device(self) -> None:
        """Raise `InputError` if an effect needs a column that no device knows."""
        for effect, column in unknown_to_devices(self.model):
            what = "position before" if column.startswith("step_") else column
            raise InputError(
                f"{effect} depends on the {what}, which no device knows; calibrate without it"
            )

    def with_conditions(
        self, forces: Array, columns: Collection[str]
    ) -> tuple[Array, HoldConditions]:
        """Combine forces with conditions, spread over the ranges of the calibration.

        The temperature is settled: what lags behind it is as warm.

        Parameters
        ----------
        forces : (n, 3) array, m/s²
        columns : names of what varies

        Returns
        -------
        forces, hold
            (n k, 3) array, each force with each of k conditions, and these.
        """
        levels = []
        for column, name in DEVICE_COLUMNS.items():
            usual = REFERENCE_TEMPERATURE if column == "temperature" else 0.0
            low, high = self.ranges.get(name, (usual, usual))
            levels.append(np.linspace(low, high, LEVELS if column in columns else 1))
        grid = np.stack(np.meshgrid(*levels, indexing="ij"), axis=-1).reshape(-1, len(levels))
        each, forces = np.repeat(grid, len(forces), axis=0).T, np.tile(forces, (len(grid), 1))
        conditions: dict[str, Any] = dict(zip(DEVICE_COLUMNS, each, strict=True))
        course = TemperatureCourse(np.zeros(1), np.full(1, REFERENCE_TEMPERATURE))
        return forces, HoldConditions(**conditions, course=course).with_steps(0 * forces)

    def correct(self, forces: ArrayLike, hold: HoldConditions | None = None) -> Array:
        """Calibrated specific force of readings.

        Parameters
        ----------
        forces : (n, 3) array, m/s², readings
        hold : HoldConditions, other columns of the readings that the effects need

        Returns
        -------
        (n, 3) array, m/s²; NaN where no force explains the reading
        """
        sessions, share, hold = self._sessions(forces, hold)
        return self._solve(sessions, share * self.parameters, hold)[0].reshape(-1, 3)

    def level(
        self, forces: ArrayLike, sigma_force: float, hold: HoldConditions | None = None
    ) -> tuple[Array, Array]:
        """Roll and pitch with standard deviations.

        Parameters
        ----------
        forces : (n, 3) array, m/s², readings
        sigma_force : float, m/s², noise of a reading, per axis
        hold : HoldConditions, as in `correct`

        Returns
        -------
        angles, sigma : (n, 2) arrays, rad; sigma combines the noise of the reading and the
        uncertainty of the calibration
        """
        return self.correct_and_level(forces, sigma_force, hold)[1:]

    def correct_and_level(
        self, forces: ArrayLike, sigma_force: float, hold: HoldConditions | None = None
    ) -> tuple[Array, Array, Array]:
        """Return what `correct` and `level` do, of one solution of the equations."""
        sessions, share, hold = self._sessions(forces, hold)
        p = share * self.parameters
        corrected, by_reading = self._solve(sessions, p, hold)
        at = self.model, p, sessions, corrected, self.gravity, hold
        slope = share[:, None, None] * tilt_slope(*at)
        variance = np.sum((slope @ self.covariance) * slope, axis=-1)
        by_output = jacobian(corrected) @ by_reading
        variance += np.square(sigma_force) * np.sum(by_output**2, axis=-1)
        corrected, sigma = corrected.reshape(-1, 3), np.sqrt(variance).reshape(-1, 2)
        return corrected, angles_of(corrected), sigma

    def _solve(
        self, sessions: Array, parameters: Array, hold: HoldConditions | None
    ) -> tuple[Array, Array]:
        """Forces of readings (s, k, 3) and their derivatives by the readings (s, k, 3, 3).

        A root where an output falls as its force grows is none: if a loss of gain is estimated as
        1.001, where a sensor clips, a reading beyond the knee has a root at -1000 g.
        """
        at = sessions, parameters, self.gravity, hold
        by_reading = self.model.output_jacobian(*at)
        rises = (np.diagonal(by_reading, axis1=-2, axis2=-1) > 0).all(axis=-1, keepdims=True)
        is_root = rises | self.model.trace.affine
        return np.where(is_root, self.model.correct(*at), np.nan), by_reading

    def _sessions(
        self, forces: ArrayLike, hold: HoldConditions | None
    ) -> tuple[Array, Array, HoldConditions | None]:
        """Readings as sessions with parameters of their own.

        A drift is known within the session of the calibration only. After it the sensor keeps the
        value at its end, as if the drift had been slower; so each reading is a session by itself.

        Returns
        -------
        forces : (s, k, 3) array, m/s²
        share : (s, u) array, factors of the parameters
        hold : HoldConditions of s sessions of k readings
        """
        forces = np.asarray(forces, dtype=float)
        if hold is None or hold.time is None or "time_s" not in self.ranges or not self.drifts:
            return forces[None], np.ones((1, self.model.n_parameters)), hold
        kept = np.clip(hold.time, 0.0, self.ranges["time_s"][1])
        part = np.divide(kept, hold.time, out=np.ones_like(kept), where=hold.time != 0)
        drifts = [effect.drifts for effect in self.model.effects for _ in effect.parameters]
        each = hold.take(np.arange(len(forces))[:, None])
        return forces[:, None], np.where(drifts, part[:, None], 1.0), each


def read_calibration(path: str | Path) -> SensorCalibration:
    """Read a calibration.json, given by itself or by its folder.

    Raises
    ------
    InputError
        If there is no such file, or it is not a calibration.
    """
    return SensorCalibration.of(CalibrationDocument.read(path), str(path))


def sensor_of(given: Any, name: str = "calibration") -> SensorCalibration:
    """Return the part of a calibration that belongs to the sensor, by object or path."""
    if isinstance(given, str | PathLike):
        return read_calibration(path_of(name, given))
    if isinstance(sensor := getattr(given, "sensor", None), SensorCalibration):
        return sensor
    expected = "what `calibrate` or `read_calibration` returns, or a path"
    raise InputError(f"{name}: expected {expected}, not {brief(given)}")


def ranged_values(forces: Array, hold: HoldConditions) -> dict[str, Array]:
    """Values of what a calibration has ranges of: forces (n, 3), m/s² in frd, and conditions."""
    values = {key: getattr(hold, name) for name, key in DEVICE_COLUMNS.items()}
    values |= zip(FORCES, forces.T, strict=True)
    return {key: each for key, each in values.items() if each is not None}


def unknown_to_devices(model: SensorModel) -> list[tuple[str, str]]:
    """Effects that need a column that no device knows, each with it."""
    return [(effect, column) for effect, column in model.needs if column not in DEVICE_COLUMNS]
