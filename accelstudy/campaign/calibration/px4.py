"""A calibration as parameters of PX4, CAL_ACC0_* and TC_A0_*, by the number of the sensor.

PX4 corrects each axis by itself: (reading − TC − OFF) · SCALE, with TC = X1 ΔT + X2 ΔT² + X3 ΔT³,
ΔT = T − TREF (its Accelerometer::Correct and TemperatureCompensation), as if its reading of a
force f were a f + o. What it cannot hold is left out: a and o are those that come closest to the
readings of the calibrated sensor, by least squares over all attitudes at rest and over the
conditions of the calibration. So they are its scales and biases as long as it has these. What is
lost is stated as errors of roll and pitch.
"""

from __future__ import annotations

from itertools import product

import numpy as np

from accelstudy import __version__
from accelstudy.basics.arrays import Array
from accelstudy.basics.errors import InputError
from accelstudy.basics.levels import MAX_TILT_GON
from accelstudy.basics.units import GON, MGON
from accelstudy.campaign.calibration.sensor_calibration import DEVICE_COLUMNS, SensorCalibration
from accelstudy.effects.hold_conditions import REFERENCE_TEMPERATURE
from accelstudy.leveling.angles import angles_of, wrap_angle
from accelstudy.leveling.error import cap_forces
from accelstudy.pages import render_lines
from accelstudy.positions.points import evenly_spread

TEMPLATE = "campaign/calibration/px4.txt.j2"
ATTITUDES = 60
"""Attitudes, each mirrored in all axes, over which the parameters are fitted."""
LOSS_ATTITUDES = 200
"""Attitudes over which the loss is taken."""
MIN_LOSS_MGON = 0.01
"""Error of an angle below which nothing is lost."""
DEGREE = 3
"""Degree of the polynomials of PX4 in the temperature."""


def px4_parameters(calibration: SensorCalibration) -> tuple[str, list[str]]:
    """Write the file that QGroundControl loads, and say what PX4 cannot hold, a sentence each.

    Raises
    ------
    InputError
        If an effect depends on what no device knows, no force explains a reading, or readings are
        not in m/s².
    """
    calibration.check_device()
    if (unit := calibration.usual_layout.unit) != "m/s^2":
        raise InputError(
            f"PX4 takes readings in m/s^2, and this calibration is of readings in {unit}; "
            "calibrate a flight log of PX4 (sensor_accel)"
        )
    gains, offsets = _fit(calibration)
    instance = calibration.usual_layout.variable or ""
    n = instance if instance.isdecimal() else "0"  # a topic is no instance of sensor_accel
    values: dict[str, float] = {}
    for i, axis in enumerate("XYZ"):
        values[f"CAL_ACC{n}_{axis}OFF"] = offsets[i, 0]
        values[f"CAL_ACC{n}_{axis}SCALE"] = 1 / gains[i]
    if is_warmed := _is_warmed(calibration):
        low, high = calibration.ranges[DEVICE_COLUMNS["temperature"]]
        values |= {f"TC_A{n}_TMIN": low, f"TC_A{n}_TMAX": high}
        values[f"TC_A{n}_TREF"] = REFERENCE_TEMPERATURE
        for i, powers in enumerate(offsets):
            values |= {f"TC_A{n}_X{k}_{i}": x if k else 0.0 for k, x in enumerate(powers)}
    shown = {name: _positional(value) for name, value in sorted(values.items())}
    lags = [
        (effect.name, tau)
        for effect in calibration.model.effects
        if effect.family == "temperature" and (tau := effect.settings.get("tau"))
    ]
    loss = _loss(calibration, gains, offsets) / MGON
    lost = render_lines(TEMPLATE, "losses", *loss, loss.max() > MIN_LOSS_MGON, lags, MAX_TILT_GON)
    axes = calibration.usual_layout.axes
    lines = render_lines(
        TEMPLATE, "parameters", calibration, __version__, n, lost, axes, is_warmed, shown
    )
    return "\n".join(lines) + "\n", lost


def _positional(value: float) -> str:
    """Nine digits; readers take a number without a point for an integer, or for none."""
    rounded = np.round(value, 15) + 0.0  # 0 has no sign
    return np.format_float_positional(rounded, 9, unique=False, fractional=False, trim="0")


def _is_warmed(calibration: SensorCalibration) -> bool:
    """Whether the temperature matters, and varied."""
    low, high = calibration.ranges.get(DEVICE_COLUMNS["temperature"], (0.0, 0.0))
    return high > low and "temperature" in calibration.model.hold_columns


def _readings(calibration: SensorCalibration, forces: Array) -> tuple[Array, Array, Array]:
    """Readings of forces (n, 3), m/s² in frd, in the conditions of a calibration.

    Returns
    -------
    forces, readings : (k, 3) arrays, the forces in frd
    terms : (k, m) array, 1 and the powers of the temperature
    """
    model, frame = calibration.model, calibration.usual_layout.axes
    forces, hold = calibration.with_conditions(forces, model.hold_columns)
    output = model.sense(forces, calibration.parameters, calibration.gravity, hold)
    readings = frame.from_frd(output @ np.linalg.inv(calibration.mending).T)
    warmer = hold.column("temperature") - REFERENCE_TEMPERATURE
    degree = DEGREE if _is_warmed(calibration) else 0
    return forces, readings, np.vander(warmer, degree + 1, increasing=True)


def _fit(calibration: SensorCalibration) -> tuple[Array, Array]:
    """Gains (3,), and offsets (3, k) by powers of the temperature."""
    signs = np.array(list(product((1.0, -1.0), repeat=3)))
    ways = (signs[:, None] * evenly_spread(ATTITUDES)).reshape(-1, 3)
    forces, readings, terms = _readings(calibration, calibration.gravity * ways)
    if not np.isfinite(readings).all():
        raise InputError(f"the model {calibration.model.name!r} has no inverse")
    felt = calibration.usual_layout.axes.from_frd(forces)
    fitted = np.empty((3, 1 + terms.shape[1]))
    for i in range(3):
        columns = np.column_stack([felt[:, i], terms])
        size = np.linalg.norm(columns, axis=0)
        fitted[i] = np.linalg.lstsq(columns / size, readings[:, i], rcond=None)[0] / size
    return fitted[:, 0], fitted[:, 1:]


def _loss(calibration: SensorCalibration, gains: Array, offsets: Array) -> Array:
    """Rms and largest error, (2, 2), of roll and of pitch by what PX4 cannot hold, rad."""
    cap = cap_forces(MAX_TILT_GON * GON, LOSS_ATTITUDES, calibration.gravity)
    forces, readings, terms = _readings(calibration, cap)
    frame = calibration.usual_layout.axes
    corrected = frame.to_frd((readings - terms @ offsets.T) / gains)
    error = wrap_angle(angles_of(corrected) - angles_of(forces))
    return np.array([np.sqrt(np.mean(error**2, axis=0)), np.abs(error).max(axis=0)])
