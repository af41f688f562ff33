"""What the user should know about a log that is leveled: empty rows, outliers, assumptions."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from accelstudy.basics.errors import InputError
from accelstudy.basics.units import display_unit, to_display
from accelstudy.basics.wording import counted, quantity_text, short_list
from accelstudy.campaign.calibration.ranges import MARGIN, Watch
from accelstudy.campaign.files.checks import likely_fault
from accelstudy.campaign.logs.tables import column_names, numbers
from accelstudy.campaign.use.applying import Calibration
from accelstudy.campaign.use.readings import Readings
from accelstudy.effects import HoldConditions

Array = NDArray[np.float64]

CLIPPED = 0.999
"""A reading beyond this part of the sensor's range is saturated: the last count is often below the
range."""

NEAR_POLE = "near_pole"
"""Column that says whether a row is too close to the roll pole for its sigmas."""

RAGGED = "ragged"
"""Key of an unusable line that has more or fewer cells than the others."""


def clipped(calibration: Calibration, forces: Array) -> NDArray[np.bool_]:
    """Which readings (k, 3), m/s², are at the end of the sensor's range."""
    full = calibration.content.get("range_mps2")
    return np.abs(forces) >= CLIPPED * (np.inf if full is None else full)


class Account:
    """Collects what the user should know about a log; chunks are added one after the other.

    Attributes
    ----------
    rows : int, so far
    empty : int, rows without a calibrated force
    """

    def __init__(self, calibration: Calibration, readings: Readings) -> None:
        self._calibration, self._readings = calibration, readings
        self._watch = Watch(calibration.ranges)
        self._norms = np.empty(0)
        self._usable = self._far = self._after = self._near = 0
        self._first_empty: tuple[int, str | None] = (0, None)
        self.rows = self.empty = 0

    def add(
        self,
        table: pa.Table,
        forces: Array,
        corrected: Array,
        near: NDArray[np.bool_],
        hold: HoldConditions,
    ) -> None:
        """Add rows, their readings and calibrated forces (k, 3), m/s² in frd, and conditions.

        `near` says which of them are too close to the roll pole for their sigmas.

        Raises
        ------
        InputError
            If all readings of the first chunk are nowhere near gravity.
        """
        lost = np.isnan(corrected[:, 0])
        if lost.any() and not self.empty:
            first = int(np.argmax(lost))
            self._first_empty = self.rows + first, self._unusable(table, first)
        self.rows += len(lost)
        self.empty += int(lost.sum())
        self._near += int(near.sum())
        norms = np.linalg.norm(forces, axis=1)
        norms = norms[np.isfinite(norms)]
        # Even bad sensors are wrong by some tenths only; larger differences come from motion.
        gravity = self._calibration.gravity
        self._far += int(np.sum((norms < gravity / 2) | (norms > gravity * 2)))
        if not self._usable and len(norms):
            self._norms = norms
            if self._far == len(norms):
                raise self._wrong_unit()
        self._usable += len(norms)
        if self._calibration.drifts and hold.time is not None:
            self._after += int(np.sum(hold.time > (1 + MARGIN) * self._session_end))
        self._watch.look_at(corrected, hold)

    def close(self) -> None:
        """Raise `InputError` if no row is usable, or most readings are far from gravity."""
        if not self._usable:
            path = self._readings.source.path
            raise InputError(f"{path}: no row has three numbers; the first: {self._reason()}")
        if 2 * self._far > self._usable:
            raise self._wrong_unit()

    def assumptions(self) -> Iterator[str]:
        """Assumptions that are made if the user does not say when the log was started."""
        needs = self._calibration.needs
        warmed = {effect for effect, column in needs if column == "temperature"}
        timed = [e for e, column in needs if column == "time" and e not in warmed]
        lagging = [e for e, column in needs if column == "time" and e in warmed]
        if lagging:
            yield f"{short_list(lagging)}: assumes that the sensor has the temperature of row 1"
        if timed:
            yield (
                f"{short_list(timed)}: assumes that the first row is the start of the calibration "
                "session; if not, give the seconds between them by --start"
            )

    def warnings(self) -> Iterator[str]:
        """Warnings about the log."""
        of_all = f"of {counted(self.rows, 'row')}"
        if self.empty:
            first = self._reason()
            yield f"{self.empty} {of_all} have no calibrated force and get empty cells; {first}"
        if self._near:
            yield (
                f"{self._near} {of_all} are too close to a pitch of "
                f"±{quantity_text(np.pi / 2, 'rad')}, where roll has no meaning, for their sigmas "
                f"of roll and pitch to hold ({NEAR_POLE} is true there); use the calibrated force"
            )
        if self._after:
            yield (
                f"{short_list(self._calibration.drifts)}: kept constant after the end of the "
                f"calibration session ({self._session_end:.0f} s), in {self._after} {of_all}"
            )
        moved = dict.fromkeys(e for e, c in self._calibration.needs if c.startswith("step_"))
        for name in moved:
            yield (
                f"{name} is not corrected ({self._sizes(name)}): it depends on the position "
                "before, which a log does not have"
            )
        yield from self._watch.warnings(self.rows)

    @property
    def _session_end(self) -> float:
        return self._calibration.ranges.get("time_s", [0.0, np.inf])[1]

    def _sizes(self, name: str) -> str:
        model = self._calibration.model
        values = dict(zip(model.parameter_names, self._calibration.parameters, strict=True))
        (effect,) = (effect for effect in model.effects if effect.name == name)
        return ", ".join(
            f"{p.name} = {float(to_display(values[p.name], p.unit)):.3g} {display_unit(p.unit)}"
            for p in effect.parameters
        )

    def _unusable(self, table: pa.Table, row: int) -> str | None:
        """Key of the first used column that has no number in a row of a chunk."""
        names = column_names(self._readings.source)
        if all(not cell.is_valid for column in table.columns for cell in column.slice(row, 1)):
            return RAGGED
        for key, place in self._readings.places.items():
            if not np.isfinite(numbers(table[names[place]].slice(row, 1))).all():
                return key
        return None

    def _reason(self) -> str:
        """Say why the first empty row is empty, and where it is."""
        source, places = self._readings.source, self._readings.places
        row, key = self._first_empty
        # This reads the file again to find the line.
        where, cell = source.look_up(row, places.get(key or "", places["fx"]))
        if key == RAGGED:
            return f"{where} does not have {len(source.names)} columns like the others"
        if key is not None:
            return f"{where}, column {source.names[places[key]]} ({key}): {cell}"
        full = self._calibration.content.get("range_mps2")
        end = "" if full is None else f", or it is at the end of the range, ± {full:.4g} m/s²"
        return f"{where}: the calibration has no force for such a reading{end}"

    def _wrong_unit(self) -> InputError:
        readings, gravity = self._readings, self._calibration.gravity
        norm = float(np.median(self._norms))
        given = norm / abs(float(readings.conversion.scale[0]))
        fault = likely_fault(given, norm, readings.unit, gravity)
        looks = f"these look like {fault}; give --unit {fault}"
        return InputError(
            f"{readings.source.path}: the readings are about {given:.3g} {readings.unit}: "
            + (
                looks
                if fault in ("m/s^2", "g")
                else "nowhere near gravity, "
                f"{gravity:.3g} m/s²; give the --unit or the --columns of this log"
            )
        )
