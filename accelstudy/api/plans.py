"""Plans of a program."""

from __future__ import annotations

import math
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd

from accelstudy.basics.errors import InputError, UnknownNameError
from accelstudy.basics.progress import begin, say, show
from accelstudy.basics.suggested import study_again
from accelstudy.data_sheets import of_sigma
from accelstudy.drawing.style import FULL
from accelstudy.files.outputs import PLAN
from accelstudy.pages.result import Result
from accelstudy.planning import question, wording
from accelstudy.planning.answer import Answer, answer
from accelstudy.planning.output import plan_files, plan_table
from accelstudy.planning.question import Equipment, Question

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SHOWN = ["equipment", "model", "scheme", "n_positions", "hold_s", "minutes"]


class Plan(Result):
    """The cheapest calibrations for a tilt accuracy.

    Attributes
    ----------
    answer : accelstudy.planning.answer.Answer, all of it
    """

    kind = PLAN
    size = FULL, 95.0

    def __init__(self, answer: Answer) -> None:
        self.answer, self.name = answer, answer.question.sheet.name

    @classmethod
    def of(cls, **given: Any) -> Plan:
        """Plan by the keywords of `accelstudy.plan`, checked."""
        sensor, sigma, max_time = given["sensor"], given["sigma"], given["max_time"]
        by_hand = Equipment("gravity", given["moving_time"], 0.0)
        robot = Equipment("robot", given["robot_moving_time"], given["robot_setup_time"])
        equipment = {"gravity": (by_hand,), "robot": (robot,), "both": (by_hand, robot)}
        if given["equipment"] not in equipment:
            raise UnknownNameError("equipment", given["equipment"], equipment)
        if (sensor is None) == (sigma is None):
            both = ", not both" if sensor else ""
            raise InputError(f"plan: give the sensor by `sensor`, or its noise by `sigma`{both}")
        sheet = question.get_sensor(sensor) if sigma is None else of_sigma(sigma)
        beside = None
        if given["reference"] is not None:
            planned = question.planned_reference(str(given["reference"]), sheet)
            beside = Equipment("reference", by_hand.moving, question.MOUNTING, planned)
        if given["history"] is not None:
            from accelstudy.data_sheets.measured import with_history  # slow to import

            sheet = with_history(sheet, given["history"])
        asked = Question(
            given["tilt_accuracy"],
            given["tilt_range"],
            sheet,
            equipment[given["equipment"]],
            given["confidence"],
            tuple(sorted({*given["holds"]})),
            given["robot_sigma"],
            math.inf if max_time is None else max_time,
            given["max_positions"],
            given["schemes"],
            beside,
        )
        begin("comparing calibrations, which takes some seconds ...")
        return cls(answer(asked, given["seed"], given["replicates"]))

    @property
    def exit_status(self) -> int:  # type: ignore[override]
        """1 if nothing reaches the accuracy."""
        return 0 if self.answer.ranked else 1

    @property
    def state(self) -> str:
        """Whether a calibration reaches the accuracy: reached or unreachable."""
        return "reached" if self.answer.ranked else "unreachable"

    @property
    def verdict(self) -> str:
        """What to do, in one line."""
        return wording.part_lines("answer", self.answer)[0]

    @property
    def content(self) -> dict[str, Any]:
        """State, verdict and the cheapest calibrations."""
        calibrations = self.table.reset_index().to_dict("records")
        return {"state": self.state, "verdict": self.verdict, "calibrations": calibrations}

    @cached_property
    def compared(self) -> pd.DataFrame:
        """All calibrations that were compared, with their units in the names of the columns."""
        return plan_table(self.answer)

    @property
    def table(self) -> pd.DataFrame:
        """The cheapest calibrations that reach the accuracy, by rank."""
        return self.compared.dropna(subset="rank").set_index("rank").sort_index()

    def to_frame(self) -> pd.DataFrame:
        """Return what the cheapest calibrations take, by rank; `table` has all that is known."""
        return self.table[SHOWN]

    def draw(self, ax: Axes) -> None:
        """Draw the tilt error left over the time in the field."""
        from accelstudy.planning.figure import draw_plan  # Matplotlib is slow to import

        draw_plan(ax, self.answer)

    def write(self, folder: Path, place: Path) -> None:
        """Write what `accelstudy plan` does; raises `InputError` if nothing is reached."""
        if not self.answer.ranked:
            raise InputError(self.verdict)
        plan_files(self.answer, folder, {"config_hash": None, "seed": self.answer.seed}, place)

    def tell(self, place: Path | None) -> None:
        """Print the answer, the table and the assumptions."""
        if not self.answer.ranked:
            show(self.verdict)
            return
        answer, how_to, reasons, assumptions = (
            "\n".join(wording.part_lines(part, self.answer))
            for part in ("answer", "how_to", "reasons", "assumptions")
        )
        show(f"{answer}\n\n{how_to}")
        say("\n".join(["", *wording.table_lines(self.answer), "", reasons]))
        say(f"\n{assumptions}\n")
        if place is None:
            study = "a study that makes the numbers again"
            say(f"--out FOLDER keeps the table, the figure, and {study}.")
        else:
            say(f"plan, table and figure: {place}")
            say(f"the same numbers again: {study_again(place / 'study.yaml')}")
