"""Plans of a program."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd

from accelstudy.api.given import drawing
from accelstudy.api.results import Result
from accelstudy.basics.errors import InputError
from accelstudy.basics.progress import say, show
from accelstudy.basics.suggested import study_again
from accelstudy.drawing.style import FULL
from accelstudy.files.outputs import PLAN
from accelstudy.planning.answer import Answer
from accelstudy.planning.figure import draw_plan
from accelstudy.planning.output import plan_files, plan_table
from accelstudy.planning.wording import (
    answer_lines,
    assumption_lines,
    how_to,
    reason_lines,
    table_lines,
    unreachable,
)

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

    def __init__(self, answer: Answer) -> None:
        self.answer = answer

    @property
    def exit_status(self) -> int:  # type: ignore[override]
        """1 if nothing reaches the accuracy."""
        return 0 if self.answer.ranked else 1

    @property
    def name(self) -> str:
        """Name of the sensor."""
        return self.answer.question.sheet.name

    @property
    def state(self) -> str:
        """Whether a calibration reaches the accuracy: reached or unreachable."""
        return "reached" if self.answer.ranked else "unreachable"

    @property
    def verdict(self) -> str:
        """What to do, in one line."""
        return answer_lines(self.answer)[0] if self.answer.ranked else unreachable(self.answer)

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

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the tilt error left over the time in the field."""
        with drawing(ax, FULL, 95) as ax:
            draw_plan(ax, self.answer)
        return ax

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
        for line in (*answer_lines(self.answer), "", *how_to(self.answer)):
            show(line)
        for line in ("", *table_lines(self.answer), "", *reason_lines(self.answer)):
            say(line)
        for line in ("", *assumption_lines(self.answer.question)):
            say(line)
        if place is None:
            say(
                "\n--out FOLDER keeps the table, the figure, and a study that makes the numbers "
                "again."
            )
            return
        say(f"\nplan, table and figure: {place}")
        say(f"the same numbers again: {study_again(place / 'study.yaml')}")
