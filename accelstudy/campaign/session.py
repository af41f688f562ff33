"""One calibration session of one sensor, in SI."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.errors import InputError
from accelstudy.basics.wording import plural
from accelstudy.campaign.header import COLUMNS, LogLayout
from accelstudy.campaign.reference import ReferenceSensor
from accelstudy.campaign.sensor_type import SensorType
from accelstudy.effects import HoldConditions
from accelstudy.sensors.conversion import Conversion

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class Campaign:
    """One calibration session of one sensor, in SI; n static holds in order of acquisition.

    Holds that are left out of every fit are in `left_out` only. So no calculation uses them by
    mistake, while `hold` and `with_left_out` still know them.

    Attributes
    ----------
    name : str
    positions : (n,) int array, the column `position`
    forces : (n, 3) array, m/s², mean specific force of the holds in sensor axes
    gravity, sigma_gravity : float, m/s²
    unit : str, of the file ("m/s^2", "g", "mg" or "counts")
    sensor : str, optional
    date : str, optional, ISO 8601
    sigma_force : float, m/s², a-priori sd of a position mean; None if unknown
    sigma_dof : float, degrees of freedom of `sigma_force`, where it is an estimate
    angles : (n, 2) array, rad, robot's roll and pitch; None without a robot
    sigma_angle : float, rad, of a level hold; None without a robot
    reference : ReferenceSensor, optional, which gave the angles instead of a robot
    sensor_type : SensorType, optional, what other sensors of the type tell of this one
    n_samples : (n,) int array, optional
    sd : (n, 3) array, m/s², optional, sd of the samples within the holds
    time, temperature, vibration, yaw : (n,) arrays in s, °C, m/s², rad, optional
    nominal : Conversion, of the three axes; with unit "counts" only
    full_range : float, m/s², optional, the sensor measures ± this
    resolution : (3,) array, m/s², optional, steps in which the axes are read, 0 for none; where
        rounding to them counts
    log : LogLayout, optional, layout of the log from which the campaign was made
    left_out : mapping, the same columns of the holds that were left out, and why, `reason`; empty
        if there are none
    warnings : tuple of str, what was ignored when the campaign was read
    notes : tuple of str, what the import of its log found and assumed
    truth : mapping, of a simulated campaign: the settings, and all that was drawn
    """

    name: str
    positions: NDArray[np.int_]
    forces: Array
    gravity: float
    sigma_gravity: float = 0.0
    unit: str = "m/s^2"
    sensor: str | None = None
    date: str | None = None
    sigma_force: float | None = None
    sigma_dof: float | None = None
    angles: Array | None = None
    sigma_angle: float | None = None
    reference: ReferenceSensor | None = None
    n_samples: NDArray[np.int_] | None = None
    sd: Array | None = None
    time: Array | None = None
    temperature: Array | None = None
    vibration: Array | None = None
    yaw: Array | None = None
    nominal: Conversion | None = None
    full_range: float | None = None
    resolution: Array | None = None
    log: LogLayout | None = None
    left_out: Mapping[str, NDArray[Any]] = field(default_factory=dict)
    warnings: tuple[str, ...] = field(default=())
    notes: tuple[str, ...] = field(default=())
    sensor_type: SensorType | None = None
    truth: Mapping[str, Any] = field(default_factory=dict)

    def __repr__(self) -> str:
        return f"Campaign({self.name!r}, {plural(self.n_positions, 'position')})"

    def _repr_html_(self) -> str:
        import pandas as pd

        from accelstudy.pages.notebook import notebook_html

        units = {"time": "s", "temperature": "°C", "vibration": "m/s²"}
        columns = dict(zip(("fx / m/s²", "fy / m/s²", "fz / m/s²"), self.forces.T, strict=True))
        for name, unit in units.items():
            if (values := getattr(self, name)) is not None:
                columns[f"{name} / {unit}"] = values
        table = pd.DataFrame(columns, index=pd.Index(self.positions, name="position"))
        beside = "without a robot" if self.angles is None else "with a robot"
        if self.reference is not None:
            beside = f"beside the sensor of {self.reference.calibration}"
        said = f"{plural(self.n_positions, 'position')} {beside}"
        return notebook_html(f"Campaign {self.name}", "; ".join([said, *self.warnings]), table)

    @property
    def n_positions(self) -> int:
        """Number of static holds, without those that were left out."""
        return len(self.forces)

    @property
    def prior(self) -> str | None:
        """Path of the file with prior knowledge; None if there is none."""
        return None if self.sensor_type is None else self.sensor_type.file

    @property
    def hold(self) -> HoldConditions:
        """Conditions of the holds, such as time and temperature, as the effects take them."""
        # The position before a hold acts on it, whether that position is used or not.
        whole, used = self._rows()
        session = HoldConditions(time=whole.get("time"), temperature=whole.get("temperature"))
        session = session.with_steps(whole["forces"]).take(np.flatnonzero(used))
        roll, pitch = (None, None) if self.angles is None else self.angles.T
        return replace(
            session,
            vibration=self.vibration,
            roll=roll,
            pitch=pitch,
            yaw=self.yaw,
            full_range=self.full_range,
        )

    @property
    def reasons(self) -> dict[int, str]:
        """Why positions were left out, by their numbers."""
        if not self.left_out:
            return {}
        pairs = (self.left_out[name].tolist() for name in ("positions", "reason"))
        return dict(zip(*pairs, strict=True))

    @property
    def exclusions(self) -> list[dict[str, Any]]:
        """Positions that were left out, each with its reason, as the header has them."""
        return [{"position": n, "reason": reason} for n, reason in self.reasons.items()]

    @property
    def with_left_out(self) -> Campaign:
        """The campaign with all its holds, as its file has them."""
        return replace(self, **self._rows()[0], left_out={}) if self.left_out else self

    def without(self, reasons: Mapping[int, str]) -> Campaign:
        """Leave out holds.

        Parameters
        ----------
        reasons : mapping of int to str
            Why, by position.

        Raises
        ------
        InputError
            If there is no such hold, or none is left.
        """
        if not reasons:
            return self
        unknown = [position for position in reasons if position not in self.positions]
        if unknown:
            raise InputError(f"{self.name}: excluded: there is no position {unknown[0]}")
        if np.isin(self.positions, list(reasons)).all():
            raise InputError(f"{self.name}: excluded: no position is left")
        why, (rows, _) = {**self.reasons, **reasons}, self._rows()
        out = np.isin(rows["positions"], list(why))
        left_out = {name: values[out] for name, values in rows.items()}
        left_out["reason"] = np.array([why[n] for n in left_out["positions"].tolist()])
        used: dict[str, Any] = {name: values[~out] for name, values in rows.items()}
        return replace(self, **used, left_out=left_out)

    def _rows(self) -> tuple[dict[str, Any], NDArray[np.bool_]]:
        """Columns with all the holds, and which of them are used."""
        rows = {name: values for name in COLUMNS if (values := getattr(self, name)) is not None}
        used = np.ones(self.n_positions, dtype=bool)
        if not self.left_out:
            return rows, used
        out = self.left_out
        order = np.argsort(np.concatenate([rows["positions"], out["positions"]]))
        rows = {k: np.concatenate([rows[k], out[k]])[order] for k in rows if k in out}
        return rows, (np.arange(len(order)) < self.n_positions)[order]
