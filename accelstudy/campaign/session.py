"""One calibration session of one sensor, in SI."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from accelstudy.basics.arrays import CachedTable
from accelstudy.basics.errors import InputError
from accelstudy.basics.wording import plural
from accelstudy.campaign.columns import COLUMNS, split, table_of
from accelstudy.campaign.header import Header
from accelstudy.campaign.sensor_type import SensorType
from accelstudy.campaign.table import format_columns, parse_holds
from accelstudy.effects import HoldConditions
from accelstudy.files.validation import validate


def _of_holds(attribute: str) -> cached_property[Any]:
    """Array of the columns of an attribute, of the holds that are used; None without them."""
    columns = COLUMNS[attribute]

    def array(campaign: Campaign) -> Any:
        holds = campaign.holds
        if columns.names[0] not in holds:
            return None
        array = columns.array(holds)[campaign.used]
        array = array if len(columns.names) > 1 else array[:, 0]
        array.setflags(write=False)  # a change would not reach the table
        return array

    return cached_property(array)


@dataclass(frozen=True, eq=False, repr=False)
class Campaign:
    """One calibration session of one sensor: a header, and a table of static holds.

    Arrays are of the n holds that are used, in SI; what is unknown is None. No calculation takes
    holds that are left out by mistake, while `hold` still knows what came before a hold.

    Attributes
    ----------
    header : Header, what `campaign.yaml` says
    holds : DataFrame, in SI, in order of acquisition; the index is the position, the columns are
        those of `COLUMNS`, and `left_out` is why a hold is left out of every fit, empty where it
        is used
    warnings : tuple of str, what was ignored when the campaign was read
    notes : tuple of str, what the import of its log found and assumed
    sensor_type : SensorType, optional, what other sensors of the type tell of this one
    truth : mapping, of a simulated campaign: the settings, and all that was drawn
    forces : (n, 3) array, m/s², mean specific forces in sensor axes
    angles : (n, 2) array, rad, roll and pitch that the robot tells, or a reference
    yaw : (n,) array, rad, that the robot tells
    n_samples : (n,) array, samples in the holds
    sd : (n, 3) array, m/s², standard deviations of the samples within the holds
    time : (n,) array, s, middle of the holds since the start of the session
    temperature : (n,) array, °C
    vibration : (n,) array, m/s², rms
    """

    header: Header
    holds: CachedTable = CachedTable()  # noqa: RUF009
    warnings: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    sensor_type: SensorType | None = None
    truth: Mapping[str, Any] = field(default_factory=dict)

    forces, angles, yaw = _of_holds("forces"), _of_holds("angles"), _of_holds("yaw")
    n_samples, sd, time = _of_holds("n_samples"), _of_holds("sd"), _of_holds("time")
    temperature, vibration = _of_holds("temperature"), _of_holds("vibration")

    @classmethod
    def of(cls, content: Mapping[str, Any], *, check: bool = True, **arrays: Any) -> Campaign:
        """Make a campaign of arrays, which are checked as those of a folder are.

        Parameters
        ----------
        content : mapping, keys and values of `campaign.yaml`; at least `name` and `gravity`, as
            ``{"name": "mine", "gravity": {"value_mps2": 9.81}}``
        check : bool, whether the arrays are checked; the import of a log says more on them
        arrays : in SI, by the names of the attributes: `forces`, and perhaps others

        Raises
        ------
        InputError
            If a value cannot be right, or an array has another length.
        """
        content = {"schema_version": 1, "unit": "m/s^2", **content}
        header = validate(Header, content, content.get("name", "campaign"))
        campaign = cls(header, table_of(arrays))
        return (campaign.check_holds(Path("campaign")) if check else campaign).without_excluded()

    def check_holds(self, path: Path) -> Campaign:
        """Return the campaign with its holds as the file of a campaign would give them.

        Raises
        ------
        InputError
            If a value cannot be right; the line begins with `path`.
        """
        columns = format_columns(self.holds, self.header)
        return replace(self, holds=parse_holds(columns, self.header, path))

    def __repr__(self) -> str:
        return f"Campaign({self.name!r}, {plural(self.n_positions, 'position')})"

    def _repr_html_(self) -> str:
        from accelstudy.pages.notebook import notebook_html

        names = {
            name: f"{name} / {columns.si}" if columns.si else name
            for columns in COLUMNS.values()
            for name in columns.names
        }
        table = self.holds[self.used].drop(columns="left_out").rename(columns=names)
        angles = "without a robot" if self.angles is None else "with a robot"
        if self.header.reference is not None:
            angles = f"beside the sensor of {self.header.reference.calibration}"
        counted = f"{plural(self.n_positions, 'position')} {angles}"
        return notebook_html(f"Campaign {self.name}", "; ".join([counted, *self.warnings]), table)

    @property
    def name(self) -> str:
        """Name of the campaign."""
        return self.header.name

    @property
    def gravity(self) -> float:
        """Local gravity, m/s²."""
        return self.header.gravity.value_mps2

    @property
    def sigma_force(self) -> float | None:
        """A-priori standard deviation of a position mean, m/s²; None if unknown."""
        return self.header.sigma_force

    @property
    def prior(self) -> str | None:
        """Path of the file with prior knowledge; None if there is none."""
        return None if self.sensor_type is None else self.sensor_type.file

    @cached_property
    def used(self) -> NDArray[np.bool_]:
        """Which of the holds are used."""
        return self.holds["left_out"].to_numpy() == ""

    @property
    def n_positions(self) -> int:
        """Number of holds that are used."""
        return int(self.used.sum())

    @cached_property
    def positions(self) -> NDArray[np.int_]:
        """Numbers of the holds, (n,)."""
        return self.holds.index.to_numpy()[self.used]

    @cached_property
    def hold(self) -> HoldConditions:
        """Conditions of the holds, such as time and temperature, as the effects take them."""
        holds = self.holds
        known = [name for name in HoldConditions.columns() if name in holds]
        conditions: dict[str, Any] = {name: holds[name].to_numpy() for name in known}
        if self.header.robot is not None:  # without its yaw, that is 0
            conditions.setdefault("yaw", np.zeros(len(holds)))
        session = HoldConditions(**conditions, full_range=self.header.range_mps2)
        # The position before a hold acts on it, whether that position is used or not.
        forces = COLUMNS["forces"].array(holds)
        return session.with_steps(forces).take(np.flatnonzero(self.used))

    @property
    def reasons(self) -> dict[int, str]:
        """Why positions are left out, by their numbers."""
        left_out = self.holds["left_out"][~self.used]
        return dict(zip(left_out.index.tolist(), left_out.tolist(), strict=True))

    @property
    def exclusions(self) -> list[dict[str, Any]]:
        """Positions that are left out, each with its reason, as the header has them."""
        return [{"position": n, "reason": reason} for n, reason in self.reasons.items()]

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
        why = {**self.reasons, **reasons}
        left_out = [why.get(position, "") for position in self.holds.index.tolist()]
        return replace(self, holds=self.holds.assign(left_out=left_out))

    def without_excluded(self) -> Campaign:
        """Leave out the holds that the header excludes; the table of holds says it from here on."""
        reasons = {entry.position: entry.reason for entry in self.header.excluded or ()}
        header = self.header.model_copy(update={"excluded": None})
        return replace(self, header=header).without(reasons)

    def with_arrays(self, **arrays: Any) -> Campaign:
        """Return the campaign with other values of the holds that are used.

        Parameters
        ----------
        arrays : by the names of the attributes, such as `forces` and `time`, in SI; None leaves
            the columns out
        """
        columns = {name: column.to_numpy() for name, column in self.holds.items()}
        for attribute, values in arrays.items():
            before = {name: columns.pop(name, np.nan) for name in COLUMNS[attribute].names}
            if values is not None:
                for name, column in split(attribute, values, self.n_positions).items():
                    own = before[name]
                    columns[name] = np.full(len(self.used), own, np.result_type(own, column))
                    columns[name][self.used] = column
        return replace(self, holds=pd.DataFrame(columns, self.holds.index))

    def with_sigma(self, sigma_force: float | None) -> Campaign:
        """Return the campaign with a noise of a position mean, m/s², that is known; None is not."""
        noise = None if sigma_force is None else {"sigma_mps2": sigma_force}
        return self.with_header(sensor_noise=noise)

    def with_header(self, **keys: Any) -> Campaign:
        """Return the campaign with other values of keys of `campaign.yaml`.

        Raises
        ------
        InputError
            If a value cannot be right.
        """
        return replace(self, header=validate(Header, {**dict(self.header), **keys}, self.name))
