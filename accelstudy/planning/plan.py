"""A plan: the cheapest calibrations for an accuracy, as it is printed, drawn and written."""

from __future__ import annotations

import math
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import yaml

from accelstudy.basics.errors import InputError, UnknownNameError
from accelstudy.basics.plugins import file_key
from accelstudy.basics.progress import begin, say, show
from accelstudy.basics.suggestions import study_again
from accelstudy.basics.units import MGON
from accelstudy.data_sheets import get_data_sheet, sheet_of_sigma
from accelstudy.design.order import field_order
from accelstudy.drawing.style import FULL
from accelstudy.files.outputs import PLAN
from accelstudy.pages.result import Result
from accelstudy.planning import wording
from accelstudy.planning.answer import Answer, answer
from accelstudy.planning.candidates import Candidate
from accelstudy.planning.design import write_scheme
from accelstudy.planning.question import Equipment, Question
from accelstudy.planning.reasons import limits

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

SHOWN = ["equipment", "model", "scheme", "n_positions", "hold_s", "minutes"]
STUDY_HEAD = """\
# The simulated candidates of a plan as a study, made by `accelstudy plan`. It reproduces their
# numbers: {command}
"""
ANGLES, UNKNOWN = ("roll", "pitch"), np.full(2, np.nan)


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
        sheet = get_data_sheet(sensor) if sigma is None else sheet_of_sigma(sigma)
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
        """All calibrations that were compared, with their units in the names of the columns.

        Angles are in mgon, whatever unit the user chose; rank is that in the table of the plan.
        """
        import pandas as pd  # slow to import, and not needed for what is printed

        rows = [_row(self.answer, candidate) for candidate in self.answer.compared]
        return pd.DataFrame(rows).astype({"rank": "Int64"})

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
        # Slow to import, and not needed for what is printed.
        import matplotlib as mpl

        from accelstudy.drawing.saving import save
        from accelstudy.drawing.style import DPI, STYLE, new_figure
        from accelstudy.files.tables import write_table

        if not self.answer.ranked:
            raise InputError(self.verdict)
        provenance = {"config_hash": None, "seed": self.answer.seed}
        write_table(folder / "plan.parquet", self.compared, provenance)
        head = STUDY_HEAD.format(command=study_again(place / "study.yaml"))
        study = {**file_key(), **self.answer.study}
        content = yaml.safe_dump(study, sort_keys=False, allow_unicode=True)
        (folder / "study.yaml").write_text(head + content, encoding="utf-8")
        first = self.answer.first
        directions = first.scheme.directions
        if first.search is not None:
            directions = directions[field_order(first.search.task, directions)]
        made = wording.positions_command(first), directions, {"made_by": "accelstudy plan"}
        write_scheme(folder / "positions.yaml", "plan", "of plan", *made)
        with mpl.rc_context(STYLE):  # type: ignore[arg-type]
            figure = new_figure(*self.size)
            self.draw(figure.subplots())
        for name in ("plan.svg", "plan.png"):
            save(figure, folder / name, "Plan", DPI)

    def tell(self, place: Path | None) -> None:
        """Print the answer, the table and the assumptions."""
        if not self.answer.ranked:
            show(self.verdict)
            return
        answer, how_to, reasons, assumptions = (
            "\n".join(wording.part_lines(part, self.answer))
            for part in ("answer", "how_to", "reasons", "assumptions")
        )
        table = "\n".join(wording.table_lines(self.answer))
        show(f"{answer}\n\n{how_to}")
        say(f"\n{table}\n\n{reasons}\n\n{assumptions}\n")
        if place is None:
            study = "a study that makes the numbers again"
            say(f"--out FOLDER keeps the table, the figure, and {study}.")
        else:
            say(f"plan, table and figure: {place}")
            say(f"the same numbers again: {study_again(place / 'study.yaml')}")


def _row(answer: Answer, c: Candidate) -> dict[str, Any]:
    rank = answer.ranked.index(c) + 1 if c in answer.ranked else None
    row = {
        "equipment": c.equipment.name,
        "model": c.model.name,
        "n_parameters": c.model.n_parameters,
        "scheme": c.scheme.name,
        "n_positions": c.scheme.n_positions,
        "hold_s": c.hold,
        "sensor_sigma_mps2": c.sigma,
        "minutes": c.seconds / 60,
        "redundancy": c.redundancy,
        "reaches": answer.question.reached_by(c.tilt),
        "rank": rank,
        "limited_by": limits(answer.question, c) if rank else None,
        "cell": None if c.simulated is None else c.simulated.cell,
    }
    left = {"rms": c.tilt.rms, "rms_simulated": UNKNOWN, "rms_q95_simulated": UNKNOWN}
    both = np.nan
    if c.simulated is not None:
        left |= {"rms_simulated": c.simulated.rms, "rms_q95_simulated": c.simulated.quantile(0.95)}
        both = c.simulated.quantile_of_both(0.95)
    angles = {f"{a}_{k}_mgon": v[i] / MGON for k, v in left.items() for i, a in enumerate(ANGLES)}
    return {**row, **angles, "both_rms_q95_simulated_mgon": both / MGON}
