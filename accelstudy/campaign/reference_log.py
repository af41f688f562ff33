"""The log of a calibrated sensor on the same plate: it tells roll and pitch of each hold."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from accelstudy.basics.arrays import Array
from accelstudy.basics.errors import InputError, key
from accelstudy.basics.units import GON
from accelstudy.campaign.gross_errors.recognition import check_size
from accelstudy.campaign.importing.columns import AXES
from accelstudy.campaign.importing.holds import MAX_WANDER, Holds, reaches_range, scatter
from accelstudy.campaign.importing.log import Log, join, read_log
from accelstudy.campaign.importing.noise import hold_noise, sigma_text
from accelstudy.campaign.importing.windows import windows_at_rest
from accelstudy.campaign.reference import ReferenceSensor
from accelstudy.leveling.angles import angles_of, near_pole
from accelstudy.pages import render_lines
from accelstudy.sensors.frames import WAYS, Frame

if TYPE_CHECKING:
    from accelstudy.campaign.calibration.sensor_calibration import SensorCalibration


DOUBTS = "campaign/calibration/leveling.txt.j2"
KEYWORDS = ("reference_log", "reference", "reference_columns", "reference_offset")
"""Keywords of an import by which a reference is given."""
MIN_COVERAGE = 0.5
"""Share of a hold, below which the reference has not enough samples of it."""
MIN_SAMPLES = 4
"""Samples of the reference in a hold, at least."""
MIN_MISFIT = 0.03
"""Misfit of the turns of both sensors, in parts of gravity, that no pair on one plate has."""
MAX_ROTATION = 20 * GON
"""Rotation between the sensors, beside quarter turns, up to which it is small."""
MIN_HOLDS = 8
"""Holds from which on it is checked that both sensors turn together."""


def reference_of(given: Mapping[str, Any]) -> ReferenceLog | None:
    """Read the log of a reference as keywords say; without them there is none.

    It is read like the log of its calibration, unless `reference_columns` says otherwise.

    Raises
    ------
    InputError
        If one of the keywords is missing, the log cannot be read, or the calibration tells no
        angles with their sigmas.
    """
    path, calibration, columns, offset = (given[name] for name in KEYWORDS)
    if path is None or calibration is None:
        for name in (name for name in KEYWORDS if given[name] is not None):
            raise InputError(
                f"{key(name)}: give both the raw log of a calibrated sensor (`reference_log`) and "
                "its calibration.json (`reference`)"
            )
        return None
    sensor, columns = usable_reference(calibration), dict(columns or {})
    layout = {"time": columns.pop("time", None), "columns": columns}
    said = {name: value for name, value in layout.items() if value not in (None, {})}
    with _remedy(
        "it is read like the log of `reference`, and `reference_columns` fx=…,fy=…,fz=…,time=… "
        "names other columns"
    ):
        log = read_log(path, said, sensor.usual_layout)
        log.check_timed()
    return ReferenceLog(sensor, join([log]), offset or 0.0)


@contextmanager
def _remedy(text: str) -> Iterator[None]:
    """Name another remedy than what an error within the block ends with, and whose log it is."""
    try:
        yield
    except InputError as error:
        wrong = str(error).partition("; ")[0]
        raise InputError(f"`reference_log` {wrong}; {text}") from None


@dataclass(frozen=True)
class ReferenceLog:
    """The log of a reference, and its calibration; see `reference_of`.

    Attributes
    ----------
    calibration : SensorCalibration
    log : Log, joined
    offset : float, s, that is added to its times
    """

    calibration: SensorCalibration
    log: Log
    offset: float = 0.0

    def angles_for(self, holds: Holds, gravity: float) -> tuple[Holds, Array, ReferenceSensor, str]:
        """Roll and pitch of the holds of a log, by the means of the reference in them.

        Parameters
        ----------
        holds : Holds
        gravity : float, m/s²

        Returns
        -------
        holds : Holds, those that it covers; what is too near to the pole for a roll is left out
        angles : (n, 2) array, rad
        reference : ReferenceSensor, for the header of the campaign
        note : str, how the reference was used

        Raises
        ------
        InputError
            If the reference covers none of them, moves in most, does not turn with the sensor, is
            mounted askew to it, or its forces are not as large as gravity.
        """
        # Both begin together unless they have one clock.
        apart = self.log.starts[0] - holds.log.starts[0]
        records, lost = self._records(holds, float(np.nan_to_num(apart)) + self.offset)
        table = holds.table.drop(index=[*lost])
        means, used = np.array([records[n].mean(axis=0) for n in table.index]), table.left_out == ""
        with _remedy("names as ax [m/s^2] tell another unit than that of the log of `reference`"):
            check_size(f"{self.log.path}", means, gravity, self.log.layout.conversion)
        own = self.calibration.correct(means)
        frame = self._frame(table.loc[used, [*AXES]].to_numpy(), own[used])
        angles = angles_of(frame.to_frd(own))
        noise = hold_noise([records[n] for n in table.index[used]], self.log.step).accuracy.allan
        reference = ReferenceSensor(
            calibration=self.calibration.document.campaign,
            frame=frame.name,
            sigma_mps2=noise,
            effects=[effect.spec for effect in self.calibration.model.effects],
            parameters=self.calibration.parameters.tolist(),
            covariance=self.calibration.covariance.tolist(),
        )
        sigma, common = reference.errors(angles, gravity)
        poles = near_pole(angles, np.hypot(sigma, np.linalg.norm(common, axis=-1)))
        why = "the x axis of the reference is too near to the vertical for a roll"
        lost |= dict.fromkeys(table.index[poles].tolist(), why)
        table["left_out"] = table["left_out"].where(~(poles & used), why)
        doubts = render_lines(DOUBTS, "doubts", self.calibration.document)
        warnings = [f"`reference` {reference.calibration}: {doubt}" for doubt in doubts]
        warnings += [f"hold {n} left out: {reason}" for n, reason in lost.items()]
        clock = "of the same clock" if np.isfinite(apart) else "begun together with the log"
        clock += f", {self.offset:+g} s" if self.offset else ""
        return (
            replace(holds, table=table, warnings=(*holds.warnings, *warnings)),
            angles,
            reference,
            (
                f"reference: {self.log.path}, {clock}; its axes x, y, z point "
                f"{frame.description.split(': ')[1]}, as frd of the sensor; sigma of a mean: "
                f"{sigma_text(noise)}"
            ),
        )

    def _records(self, holds: Holds, apart: float) -> tuple[dict[int, Array], dict[int, str]]:
        """Samples (m, 3) of the reference, m/s², in holds, and why it has none in others."""
        log, table, where = self.log, holds.table, f"`reference_log` {self.log.path}"
        full_range = self.calibration.document.range_mps2 or np.inf
        with _remedy("a name as time_ms tells the unit of its times"):
            limit = MAX_WANDER * windows_at_rest(log).threshold
        time, forces = log.time + apart, log.forces @ self.calibration.mending.T
        half = holds.log.step / 2  # so that a rounded time changes nothing
        records: dict[int, Array] = {}
        lost: dict[int, str] = {}
        moving = 0
        for n, t0, t1 in table[["t0", "t1"]].itertuples():
            record = forces[slice(*np.searchsorted(time, [t0 - half, t1 + half]))]
            if len(record) * log.step < MIN_COVERAGE * (t1 - t0) or len(record) < MIN_SAMPLES:
                lost[n] = "the reference log does not cover it"
            elif reaches_range(record, full_range):
                lost[n] = "the reference is saturated"
            elif (sd := scatter(record)) > limit:
                lost[n] = f"the reference moves: its sd is {sd:.2g} m/s²"
                moving += 1
            else:
                records[n] = record
        if moving > len(records):
            raise InputError(
                f"{where}: the reference moves in {moving} of {moving + len(records)} holds; is it "
                "on one plate with the sensor, and are its times right (`reference_offset`)?"
            )
        if not records:
            first, last = table["t0"].iloc[0], table["t1"].iloc[-1]
            raise InputError(
                f"{where}: runs from {time[0]:.6g} s to {time[-1]:.6g} s of the time of "
                f"{holds.log.path}, whose holds lie from {first:.6g} s to {last:.6g} s: all are "
                f"left out, the first because {next(iter(lost.values()))}; `reference_offset` "
                "gives the seconds to add to the times of the reference"
            )
        return records, lost

    def _frame(self, forces: Array, own: Array) -> Frame:
        """Quarter turns from the axes of the reference to those of a sensor.

        Parameters
        ----------
        forces, own : (n, 3) arrays, m/s², of the sensor and of the reference, in the same holds

        Raises
        ------
        InputError
            If a rotation does not explain them, or it is not small beside the quarter turns.
        """
        where = f"`reference_log` {self.log.path}"
        if len(own) >= MIN_HOLDS:
            design = np.column_stack([own, np.ones(len(own))])
            left = forces - design @ np.linalg.lstsq(design, forces, rcond=None)[0]
            misfit = np.sqrt(np.mean(np.sum(left**2, axis=1))) / self.calibration.gravity
            if misfit > MIN_MISFIT:
                raise InputError(
                    f"{where}: the two sensors do not turn together: their forces differ by "
                    f"{misfit:.2g} g, whatever the rotation between them; are they on one plate, "
                    "and are the times of the reference right (`reference_offset`)?"
                )
        left_side, _, right_side = np.linalg.svd(forces.T @ own)
        turn = left_side @ np.diag([1, 1, np.linalg.det(left_side @ right_side)]) @ right_side
        # Where each axis of the reference points, nearly; what is left has this trace.
        along, ways = np.abs(turn).argmax(axis=0), np.array([*WAYS]).reshape(3, 2)
        cosines = turn[along, range(3)]
        rest = float(np.arccos(np.clip((np.abs(cosines).sum() - 1) / 2, -1, 1)))
        if rest > MAX_ROTATION:
            raise InputError(
                f"{where}: besides quarter turns, the reference is turned by {rest / GON:.0f} gon "
                f"against the sensor; mount it within {MAX_ROTATION / GON:.0f} gon, as only a "
                "small rotation is estimated"
            )
        return Frame("".join(ways[along, np.where(cosines < 0, 1, 0)]))


def usable_reference(path: Path) -> SensorCalibration:
    """Read the calibration of a reference.

    Raises
    ------
    InputError
        If it tells no angles with their sigmas.
    """
    # An import without a reference takes no time for what reads a calibration.
    from accelstudy.campaign.calibration.sensor_calibration import read_calibration

    calibration, where = read_calibration(path), f"`reference` {path}"
    quality = calibration.document.quality
    if not quality.plausible:
        why = "; ".join(quality.warnings)
        raise InputError(f"{where}: do not use this calibration: {why}")
    if not np.isfinite(calibration.covariance).all():
        raise InputError(
            f"{where}: it has no covariance matrix, so nothing tells how far its angles can be "
            "trusted; calibrate it in more positions than its model has parameters"
        )
    for effect, condition in calibration.model.needs:
        raise InputError(
            f"{where}: its effect {effect} needs the {condition} of each hold; give a "
            "calibration with a model that needs the forces only (calibrate --model)"
        )
    return calibration
