"""The calibrated sensor on a pole: from an existing calibration, or from linear theory."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from accelstudy.approaches import get_approach
from accelstudy.basics.errors import InputError
from accelstudy.basics.units import STANDARD_GRAVITY
from accelstudy.basics.wording import comma_list, quantity_text
from accelstudy.campaign.calibration.applying import read_calibration
from accelstudy.data_sheets import DataSheet
from accelstudy.design.estimability import estimability
from accelstudy.effects import HoldConditions
from accelstudy.effects.hold_conditions import REFERENCE_TEMPERATURE
from accelstudy.effects.lag import Course
from accelstudy.leveling.angles import roll_pitch
from accelstudy.schemes import get_scheme
from accelstudy.sensors.frames import FRD, Frame
from accelstudy.sensors.models import compose, get_model
from accelstudy.sensors.sensor import SensorModel
from accelstudy.simulation.hold_plan import check_needs_no_plan
from accelstudy.simulation.sessions import Noise

Array = NDArray[np.float64]


COEFFICIENTS = {"bias": "m/s^2/K", "scale": "1/K"}
"""Parameters that change with temperature, and the unit of their temperature coefficient."""


@dataclass(frozen=True)
class CalibratedSensor:
    """A sensor, its calibration and its data sheet.

    Attributes
    ----------
    model : SensorModel
    parameters : (u,) array, SI
    covariance : (u, u) array, SI, of the parameters
    sheet : DataSheet
    tilt_sigma : float, rad, sd of roll and of pitch, if nothing else is known of the calibration
    gravity : float, m/s²
    mounting : Frame, where the axes point when the pole is upright
    temperature : float, °C, of the calibration
    time : float, s, end of its session
    origin : str, where the calibration comes from
    warnings : tuple of str
    """

    model: SensorModel
    parameters: Array
    covariance: Array
    sheet: DataSheet
    tilt_sigma: float | None = None
    gravity: float = STANDARD_GRAVITY
    mounting: Frame = FRD
    temperature: float = REFERENCE_TEMPERATURE
    time: float = 0.0
    origin: str = ""
    warnings: tuple[str, ...] = ()

    @property
    def corrected(self) -> tuple[str, ...]:
        """Those of bias and scale whose change with temperature the calibration corrects."""
        units = {parameter.unit for parameter in self.model.parameters}
        return tuple(name for name, unit in COEFFICIENTS.items() if unit in units)

    def warmed(self, kelvin: float) -> tuple[float, float]:
        """Sds of the uncorrected change of bias, m/s², and of scale; see `DataSheet.warmed`."""
        return self.sheet.warmed(kelvin, self.corrected)

    def conditions(self, forces: Array, temperature_change: float) -> HoldConditions | None:
        """Conditions besides the force, in attitudes with forces (k, 3), m/s².

        All columns are (k, 1). The sensor has the temperature of the air, does not vibrate, and has
        no position before. Drifts keep their values at the end of the session.
        """
        if not self.model.hold_columns:
            return None
        roll, pitch = (angle[:, None] for angle in roll_pitch(tuple(forces.T)))
        zero = np.zeros_like(roll)
        then, warmth = zero + self.time, zero + self.temperature + temperature_change
        return HoldConditions(
            temperature=warmth,
            time=then,
            vibration=zero,
            roll=roll,
            pitch=pitch,
            yaw=zero,
            step_x=zero,
            step_y=zero,
            step_z=zero,
            order=then + 1.0,
            course=Course(then[0], warmth[0]),
        )


def from_calibration(path: str | Path, sheet: DataSheet, mounting: Frame = FRD) -> CalibratedSensor:
    """Sensor of a calibration.json.

    Raises
    ------
    InputError
        If the file cannot be read, or does not say how accurate its parameters are.
    """
    calibration = read_calibration(path)
    unknown = [
        name
        for name, variance in zip(
            calibration.model.parameter_names, np.diag(calibration.covariance), strict=True
        )
        if not np.isfinite(variance)
    ]
    if unknown or not np.isfinite(calibration.covariance).all():
        raise InputError(
            f"{path}: covariance: unknown for {comma_list(unknown) or 'some parameters'}; "
            "calibrate a campaign with more positions, or give the sigma of the sensor in it"
        )
    quality = calibration.content["quality"]
    faults = [] if quality["plausible"] else quality["warnings"]
    doubts = [f"do not use this calibration: {fault}" for fault in faults]
    if quality["state"] == "rejected":
        doubts.append(
            "the residuals of the calibration contradict its noise, so its errors may exceed its "
            f"sigmas; `accelstudy diagnose` looks for what the model lacks ({path})"
        )
    return CalibratedSensor(
        calibration.model,
        calibration.parameters,
        calibration.covariance,
        sheet,
        gravity=calibration.gravity,
        mounting=mounting,
        temperature=float(
            np.mean(calibration.ranges.get("temperature_degC", [REFERENCE_TEMPERATURE]))
        ),
        time=calibration.ranges.get("time_s", [0.0])[-1],
        origin=f"the calibration {path} ({calibration.content['model']})",
        warnings=tuple(doubts),
    )


def from_linear_theory(
    model: str,
    scheme: str,
    approach: str,
    sheet: DataSheet,
    seconds: float,
    robot_sigma: float = Noise.sigma_angle,
    mounting: Frame = FRD,
) -> CalibratedSensor:
    """Sensor after a calibration, predicted by linear theory at the ideal sensor.

    Parameters
    ----------
    model, scheme, approach : str, names
    sheet : DataSheet
    seconds : float, s, at each position
    robot_sigma : float, rad, of the robot's roll and of its pitch
    mounting : Frame

    Raises
    ------
    InputError
        If the scheme does not determine the model.
    """
    chosen, positions = get_model(model), get_scheme(scheme)
    check_needs_no_plan(chosen)
    sigma = sheet.sigma_mean(seconds, positions.n_positions * seconds)
    noise = Noise(sigma_force=sigma, sigma_angle=robot_sigma)
    determined = estimability(positions, chosen, get_approach(approach), noise)
    if not determined.estimable:
        raise InputError(f"scheme {positions.name}, model {chosen.name}: {determined.reason}")
    stays = np.flatnonzero(chosen.stays)
    of_sensor = tuple(effect.spec for effect in chosen.effects if effect.part == "sensor")
    used = compose(chosen.name, of_sensor)
    return CalibratedSensor(
        used,
        np.zeros(used.n_parameters),
        determined.cofactors[np.ix_(stays, stays)],
        sheet,
        mounting=mounting,
        origin=(
            f"{chosen.name} in {positions.n_positions} positions ({positions.name}), {approach}, "
            f"{seconds:g} s each, by linear theory"
        ),
    )


def from_tilt_sigma(sigma: float, sheet: DataSheet, mounting: Frame = FRD) -> CalibratedSensor:
    """Sensor whose calibration is known only by the sd, rad, that it leaves in roll and pitch."""
    model = get_model("bias")
    return CalibratedSensor(
        model,
        np.zeros(model.n_parameters),
        np.zeros((model.n_parameters, model.n_parameters)),
        sheet,
        sigma,
        mounting=mounting,
        origin=f"a calibration that leaves {quantity_text(sigma, 'rad')} in roll and in pitch",
    )
