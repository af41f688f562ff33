"""A calibration as parameters of PX4.

PX4 corrects each axis by itself, as if its reading of a force f were a f + o. What it cannot hold
is left out: a and o are those that come closest to the readings of the calibrated sensor, by least
squares over all attitudes at rest and over the conditions of the calibration. So they are its
scales and biases as long as it has these. What is lost is stated as errors of roll and pitch.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from accelstudy import __version__
from accelstudy.basics.errors import InputError
from accelstudy.basics.units import GON, MGON
from accelstudy.basics.wording import comma_list, number
from accelstudy.campaign.calibration.applying import SensorCalibration
from accelstudy.campaign.calibration.device import KNOWN, in_use, must_be_known
from accelstudy.effects import HoldConditions
from accelstudy.effects.hold_conditions import REFERENCE_TEMPERATURE
from accelstudy.leveling.angles import angles_of, wrapped
from accelstudy.leveling.error import MAX_TILT_GON, cap_forces
from accelstudy.pages import lines
from accelstudy.positions.points import evenly_spread
from accelstudy.sensors.models import compose

Array = NDArray[np.float64]

ATTITUDES = 60
"""Attitudes, each mirrored in all axes, over which the parameters are fitted."""
LOSS_ATTITUDES = 200
"""Attitudes over which the loss is taken."""
MIN_LOSS = 0.01 * MGON
"""Error of an angle below which nothing is lost."""
DEGREE = 3
"""Of the polynomials of PX4 in the temperature."""
REAL, INTEGER = 9, 6
"""Types of parameters in files of PX4 (MAVLink)."""


class PX4:
    """Parameters CAL_ACC0_* and TC_A0_* of PX4, in a file that QGroundControl loads.

    PX4 corrects each axis by itself: (reading − TC − OFF) · SCALE, with TC = X1 ΔT + X2 ΔT² +
    X3 ΔT³, ΔT = T − TREF (its Accelerometer::Correct and TemperatureCompensation).

    Parameters
    ----------
    calibration : SensorCalibration

    Raises
    ------
    InputError
        If an effect depends on what no device knows, no force explains a reading, or readings are
        not in m/s².
    """

    def __init__(self, calibration: SensorCalibration) -> None:
        must_be_known(calibration.needs)
        unit = calibration.usual_layout.unit
        if unit != "m/s^2":
            raise InputError(
                f"PX4 takes readings in m/s^2, and this calibration is of readings in {unit}"
            )
        self.calibration, self.frame = calibration, calibration.usual_layout.axes
        self._to_read = np.linalg.inv(calibration.mending)
        self.gains, self.offsets = self._fitted(calibration)
        self.lost = tuple(self._lost())

    @property
    def text(self) -> str:
        """The file."""
        source = "campaign/calibration/provenance.txt.j2", "provenance"
        known = lines(*source, self.calibration, __version__)
        head = [*known, *self.lost, *self._remarks()]
        return "".join(f"{line}\n" for line in (*(f"# {line}" for line in head), *self._lines()))

    def _remarks(self) -> Iterable[str]:
        """What a user has to know."""
        yield f"(reading - TC - OFF) * SCALE, m/s^2, in the sensor's axes {self.frame.description}"
        yield (
            "CAL_ACC0_ID must be that of the sensor, which PX4's own calibration sets; "
            "CAL_ACC0_ROT stays as it is"
        )
        if self._is_warmed:
            yield "TC_A0_ID must be that of the sensor, too; TC_A_ENABLE takes a reboot"
        yield "vehicle\tcomponent\tname\tvalue\ttype"

    def _lines(self) -> Iterable[str]:
        """Lines of the parameters."""
        values: dict[str, float] = {}
        for i, axis in enumerate("XYZ"):
            values[f"CAL_ACC0_{axis}OFF"] = self.offsets[i, 0]
            values[f"CAL_ACC0_{axis}SCALE"] = 1 / self.gains[i]
        if self._is_warmed:
            low, high = self.calibration.ranges[KNOWN["temperature"]]
            values |= {"TC_A0_TREF": REFERENCE_TEMPERATURE, "TC_A0_TMIN": low, "TC_A0_TMAX": high}
            for i, powers in enumerate(self.offsets):
                values |= {f"TC_A0_X{k}_{i}": x if k else 0.0 for k, x in enumerate(powers)}
            yield f"1\t1\tTC_A_ENABLE\t1\t{INTEGER}"
        for name, value in sorted(values.items()):
            # Readers of such files take a number without a point for an integer, or for none.
            text = np.format_float_positional(
                np.round(value, 15) + 0.0, 9, unique=False, fractional=False, trim="0"
            )
            yield f"1\t1\t{name}\t{text}\t{REAL}"

    def _terms(self, hold: HoldConditions) -> Array:
        """1 and the powers of the temperature, (n, k)."""
        degree = DEGREE if self._is_warmed else 0
        return np.vander(
            hold.column("temperature") - REFERENCE_TEMPERATURE, degree + 1, increasing=True
        )

    @property
    def _is_warmed(self) -> bool:
        """Whether the temperature matters, and varied."""
        low, high = self.calibration.ranges.get(KNOWN["temperature"], (0.0, 0.0))
        return high > low and "temperature" in self.calibration.model.hold_columns

    def _read(self, calibration: SensorCalibration, forces: Array, hold: HoldConditions) -> Array:
        """Readings (n, 3) of forces (n, 3) in frd."""
        output = calibration.model.sense(forces, calibration.parameters, calibration.gravity, hold)
        return self.frame.from_frd(output @ self._to_read.T)

    def _fitted(self, calibration: SensorCalibration) -> tuple[Array, Array]:
        """Gains (3,), and offsets (3, k) by powers of the temperature."""
        signs = np.array(list(product((1.0, -1.0), repeat=3)))
        ways = (signs[:, None] * evenly_spread(ATTITUDES)).reshape(-1, 3)
        forces, hold = in_use(
            calibration, calibration.gravity * ways, calibration.model.hold_columns
        )
        readings = self._read(calibration, forces, hold)
        if not np.isfinite(readings).all():
            raise InputError(f"the model {calibration.model.name!r} has no inverse")
        felt, terms = self.frame.from_frd(forces), self._terms(hold)
        found = np.empty((3, 1 + terms.shape[1]))
        for i in range(3):
            columns = np.column_stack([felt[:, i], terms])
            size = np.linalg.norm(columns, axis=0)
            found[i] = np.linalg.lstsq(columns / size, readings[:, i], rcond=None)[0] / size
        return found[:, 0], found[:, 1:]

    def _loss(self, calibration: SensorCalibration) -> tuple[Array, Array]:
        """Rms and largest error, (2,), of roll and of pitch by what PX4 cannot hold, rad."""
        gains, offsets = self._fitted(calibration)
        cap = cap_forces(MAX_TILT_GON * GON, LOSS_ATTITUDES, calibration.gravity)
        forces, hold = in_use(calibration, cap, calibration.model.hold_columns)
        linear = self._read(calibration, forces, hold) - self._terms(hold) @ offsets.T
        corrected = self.frame.to_frd(linear / gains)
        error = wrapped(angles_of(corrected) - angles_of(forces))
        return np.sqrt(np.mean(error**2, axis=0)), np.abs(error).max(axis=0)

    def _lost(self) -> Iterable[str]:
        """Say what PX4 cannot hold, and what that does to roll and pitch."""
        rms, largest = self._loss(self.calibration)
        if largest.max() > MIN_LOSS:
            parts = [
                effect for effect, alone in self._alone() if self._loss(alone)[1].max() > MIN_LOSS
            ]
            without = f" for {comma_list(parts)}" if parts else ""
            (roll, pitch), (most_roll, most_pitch) = rms / MGON, largest / MGON
            yield (
                f"PX4 has no place{without}; so roll is wrong by "
                f"{number(roll)} mgon and pitch by {number(pitch)} mgon (rms over tilts up to "
                f"{MAX_TILT_GON:g} gon), at most by {number(most_roll)} and {number(most_pitch)} "
                "mgon; the form c holds all"
            )
        for effect in self.calibration.model.effects:
            tau = effect.settings.get("tau") if effect.family == "temperature" else None
            if tau:
                yield (
                    f"PX4 has no lag behind a thermometer: {effect.name} with one of "
                    f"{tau:g} s is right at a settled temperature only"
                )

    def _alone(self) -> Iterable[tuple[str, SensorCalibration]]:
        """Each effect with a calibration that has it alone."""
        first = 0
        for effect in self.calibration.model.effects:
            last = first + len(effect.parameters)
            yield (
                effect.name,
                replace(
                    self.calibration,
                    model=compose(effect.spec, (effect.spec,)),
                    parameters=self.calibration.parameters[first:last],
                ),
            )
            first = last
