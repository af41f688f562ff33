"""A calibrated sensor on the same plate: its log tells roll and pitch of each hold."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import permutations, product
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.errors import InputError
from accelstudy.basics.units import GON
from accelstudy.campaign.calibration.applying import SensorCalibration, read_calibration
from accelstudy.campaign.checks import Remedies, check_norm
from accelstudy.campaign.header import LogLayout
from accelstudy.campaign.importing.holds import DetectedHolds, hold_noise
from accelstudy.campaign.importing.making import ImportReport, shown
from accelstudy.campaign.importing.recording import AXES, Recording, locate, read_log
from accelstudy.campaign.importing.segments import WANDERING, Segment, at_range
from accelstudy.campaign.importing.windows import (
    Windows,
    choose_threshold,
    samples_in,
    usual_window,
)
from accelstudy.campaign.reference import ReferenceSensor
from accelstudy.campaign.session import Campaign
from accelstudy.files.validation import checked
from accelstudy.leveling.angles import angles_of, near_pole
from accelstudy.sensors.frames import FRD, Frame

Array = NDArray[np.float64]

COVERED = 0.5
"""Share of a hold, below which the reference has not enough samples of it."""
FEWEST = 4
"""Samples of the reference in a hold, at least."""
APART = 0.03
"""Misfit of the turns of both sensors, in parts of gravity, that no pair on one plate has."""
TURNED = 20 * GON
"""Rotation between the sensors, beside quarter turns, up to which it is small."""
QUARTER_TURNS = tuple(
    frame
    for letters in permutations(("fb", "rl", "du"))
    for name in product(*letters)
    if (frame := Frame("".join(name))) and np.linalg.det(frame.matrix) > 0
)
LEAST = 8
"""Holds from which on it is checked that both sensors turn together."""

REMEDIES = Remedies(*["it is read in the unit of the log of which `reference` was made"] * 3)


@dataclass(frozen=True)
class ReferenceLog:
    """What an import is told of a reference.

    Attributes
    ----------
    log, calibration : Path, its raw log, and its calibration.json
    columns : mapping of fx, fy, fz and time to columns, where the log is not like that of its
        calibration
    offset : float, s, to add to its times; None where both logs have one clock, or begin together
    """

    log: Path
    calibration: Path
    columns: Mapping[str, str] = field(default_factory=dict)
    offset: float | None = None


@dataclass(frozen=True)
class Beside:
    """The open log of a reference, and its calibration."""

    given: ReferenceLog
    calibration: SensorCalibration
    log: Recording

    @classmethod
    def of(cls, given: ReferenceLog) -> Beside:
        """Open a reference.

        Raises
        ------
        InputError
            If its log cannot be read, or its calibration tells no angles with their sigmas.
        """
        calibration = usable_reference(given.calibration)
        return cls(given, calibration, _opened(given, calibration))

    def averaged(
        self, log: Recording, holds: DetectedHolds, gravity: float
    ) -> tuple[DetectedHolds, list[Segment]]:
        """Average the reference in the holds of a log.

        Returns
        -------
        holds : DetectedHolds, without those that the reference does not cover
        segments : list of Segment, of the reference, one for each of them

        Raises
        ------
        InputError
            If it covers none of them, moves in most, or its forces are not as large as gravity.
        """
        segments, lost = self._segments(log, holds)
        means = np.array([segment.mean for segment in segments.values()])
        raw = means / self.log.first.conversion.scale[0]
        check_norm(
            f"`reference_log` {self.given.log}",
            raw,
            means,
            self.log.first.layout.unit,
            gravity,
            REMEDIES,
        )
        windows = Windows(self.log, samples_in(self.log, usual_window(self.log)))
        rest = choose_threshold(windows)
        moving = [n for n, s in segments.items() if s.variance > (WANDERING * rest.sd) ** 2]
        if len(moving) > len(segments) / 2:
            raise InputError(
                f"`reference_log` {self.given.log}: the reference moves in {len(moving)} of "
                f"{len(segments)} holds; is it on one plate with the sensor, and are its times "
                "right (`reference_offset`)?"
            )
        for n in moving:
            lost[n] = f"the reference moves: its sd is {np.sqrt(segments.pop(n).variance):.2g} m/s²"
        said = [f"hold {n} left out: {why}" for n, why in lost.items()]
        others = holds.without(lost)
        return replace(others, warnings=(*holds.warnings, *said)), list(segments.values())

    def _segments(
        self, log: Recording, holds: DetectedHolds
    ) -> tuple[dict[int, Segment], dict[int, str]]:
        """Samples of the reference in the holds of a log, and why there are none in others."""
        content, read = self.calibration.content, self.log.samples
        full_range = content.get("range_mps2") or np.inf
        time = read.time + self._shift(log)
        samples = read._replace(time=time, forces=read.forces @ self.calibration.mending.T)
        segments, lost = {}, {}
        for n, hold in holds.segments.items():
            inside = slice(*np.searchsorted(time, [hold.t0, hold.t1 + holds.step / 2]).tolist())
            count = inside.stop - inside.start
            if count * self.log.step < COVERED * (hold.t1 - hold.t0) or count < FEWEST:
                lost[n] = "the reference log does not cover it"
            elif at_range(samples.forces[inside], full_range):
                lost[n] = "the reference is saturated"
            else:
                segments[n] = Segment.of(samples, inside)
        if not segments:
            raise InputError(
                f"`reference_log` {self.given.log}: runs from {time[0]:.6g} s to {time[-1]:.6g} s "
                f"of the time of {log.path}, whose holds lie from {holds.t0[0]:.6g} s to "
                f"{holds.t1[-1]:.6g} s: all are left out, the first because "
                f"{next(iter(lost.values()))}; `reference_offset` gives the seconds to add to the "
                "times of the reference"
            )
        return segments, lost

    def _shift(self, log: Recording) -> float:
        """Time from the first sample of a log to that of the reference, s."""
        apart = self.log.first.start - log.first.start
        return float(np.nan_to_num(apart)) + (self.given.offset or 0.0)

    def _clock(self, log: Recording) -> str:
        """Say by what the times of both belong together."""
        by_clock = np.isfinite(self.log.first.start - log.first.start)
        offset = "" if self.given.offset is None else f", {self.given.offset:+g} s"
        return ("of the same clock" if by_clock else "begun together with the log") + offset

    def beside(
        self, campaign: Campaign, report: ImportReport, segments: list[Segment], log: Recording
    ) -> tuple[Campaign, ImportReport]:
        """Give a campaign roll and pitch of its holds by the means of the reference.

        Raises
        ------
        InputError
            If the two do not turn together, or one is mounted askew to the other.
        """
        whole, g = campaign.whole, campaign.gravity
        own = self.calibration.correct(np.array([segment.mean for segment in segments]))
        used = np.isin(whole.positions, campaign.positions)
        frame = self._frame(whole.forces[used], own[used])
        angles = angles_of(frame.to_frd(own))
        resting = [segment for segment, use in zip(segments, used, strict=True) if use]
        accuracy = hold_noise(resting, self.log.step).accuracy
        reference = reference_sensor(self.calibration, accuracy.allan, frame)
        sigma, common = reference.errors(angles, g)
        whole = replace(whole, angles=angles, sigma_angle=accuracy.allan / g, reference=reference)
        poles = near_pole(angles, np.hypot(sigma, np.linalg.norm(common, axis=-1)))
        why = "the x axis of the reference is too near to the vertical for a roll"
        reasons = {int(n): why for n in whole.positions[poles]}
        warnings = [f"hold {n} left out: {why}" for n in reasons]
        if angles_in_log := locate(log.first.source, {}, ("roll", "pitch"), needed=False):
            warnings.append(
                f"{log.path}: columns {', '.join(angles_in_log)} are left out: roll and pitch are "
                "those of `reference_log`"
            )
        notes = [
            f"reference: {self.given.log}, {self._clock(log)}; its axes x, y, z point "
            f"{frame.description.split(': ')[1]}, as frd of the sensor; sigma of a mean: "
            f"{shown(accuracy.allan)}"
        ]
        return whole.without({**reasons, **campaign.reasons}), replace(
            report,
            notes=(*report.notes, *notes),
            warnings=(*report.warnings, *warnings),
        )

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
        log = f"`reference_log` {self.given.log}"
        if len(own) >= LEAST:
            design = np.column_stack([own, np.ones(len(own))])
            left = forces - design @ np.linalg.lstsq(design, forces, rcond=None)[0]
            misfit = np.sqrt(np.mean(np.sum(left**2, axis=1))) / self.calibration.gravity
            if misfit > APART:
                raise InputError(
                    f"{log}: the two sensors do not turn together: their forces differ by "
                    f"{misfit:.2g} g, whatever the rotation between them; are they on one plate, "
                    "and are the times of the reference right (`reference_offset`)?"
                )
        left_side, _, right_side = np.linalg.svd(forces.T @ own)
        turn = left_side @ np.diag([1, 1, np.linalg.det(left_side @ right_side)]) @ right_side
        traces = {frame: np.trace(frame.matrix.T @ turn) for frame in QUARTER_TURNS}
        best = max(traces, key=lambda frame: traces[frame])
        rest = float(np.arccos(np.clip((traces[best] - 1) / 2, -1, 1)))
        if rest > TURNED:
            raise InputError(
                f"{log}: besides quarter turns, the reference is turned by {rest / GON:.0f} gon "
                f"against the sensor; mount it within {TURNED / GON:.0f} gon, as only a small "
                "rotation is estimated"
            )
        return best


def reference_sensor(
    calibration: SensorCalibration, sigma: float, frame: Frame = FRD
) -> ReferenceSensor:
    """Reference with a calibration, a noise of its means, m/s², and its axes."""
    return ReferenceSensor(
        calibration=calibration.content["campaign"],
        frame=frame.name,
        sigma_mps2=sigma,
        effects=[effect.spec for effect in calibration.model.effects],
        parameters=calibration.parameters.tolist(),
        covariance=calibration.covariance.tolist(),
    )


def usable_reference(path: Path) -> SensorCalibration:
    """Read the calibration of a reference.

    Raises
    ------
    InputError
        If it tells no angles with their sigmas.
    """
    calibration, where = read_calibration(path), f"`reference` {path}"
    quality = calibration.content["quality"]
    if not quality["plausible"]:
        why = "; ".join(quality["warnings"])
        raise InputError(f"{where}: do not use this calibration: {why}")
    if not np.isfinite(calibration.covariance).all():
        raise InputError(
            f"{where}: it has no covariance matrix, so nothing tells how far its angles can be "
            "trusted; calibrate it in more positions than its model has parameters"
        )
    for effect, condition in calibration.needs:
        raise InputError(
            f"{where}: its effect {effect} needs the {condition} of each hold; give a "
            "calibration with a model that needs the forces only (calibrate --model)"
        )
    return calibration


def _opened(given: ReferenceLog, calibration: SensorCalibration) -> Recording:
    """Open the log of a reference; it is read like that of its calibration."""
    columns = dict(given.columns)
    if unknown := [key for key in columns if key not in (*AXES, "time")]:
        raise InputError(
            f"`reference_columns`: {unknown[0]}: expected {', '.join(AXES)} and perhaps time"
        )
    time = {"time": columns.pop("time")} if "time" in columns else {}
    layout = checked(LogLayout, {**time, "columns": columns}, "`reference_columns`")
    try:
        log = read_log(given.log, layout, like=calibration.usual_layout, conditions=("time",))
    except InputError as error:
        said = re.split("; give the column of time|; the columns are those", str(error))[0]
        raise InputError(
            f"`reference_log` {said}; it is read like the log of `reference`, and "
            "`reference_columns` fx=…,fy=…,fz=…,time=… names other columns"
        ) from None
    return Recording([log])
