"""A plan: the cheapest calibrations for an accuracy, as it is printed, drawn and written."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Literal, Self

from accelstudy.basics.errors import InputError
from accelstudy.basics.progress import say, show
from accelstudy.basics.units import MGON
from accelstudy.design.order import field_order
from accelstudy.drawing.style import FULL
from accelstudy.files.documents import Document, Part
from accelstudy.files.outputs import PLAN
from accelstudy.pages.result import Result
from accelstudy.planning import wording
from accelstudy.planning.candidates import Candidate
from accelstudy.planning.question import Question
from accelstudy.planning.reasons import limits
from accelstudy.planning.simulated import QUOTED

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

ANGLES = ("roll", "pitch")


class PlannedCalibration(Part):
    """A calibration that reaches the accuracy.

    Attributes
    ----------
    rank : by the time that it takes; 1 is the quickest
    equipment : positions by hand, or with a robot
    model : name of the model
    n_parameters : of the model
    scheme : name of the positions
    n_positions : number of positions
    hold_s : duration of a position
    sensor_sigma_mps2 : noise of the mean of a position
    minutes : time in the field
    redundancy : conditions minus unknowns
    limited_by : what limits its accuracy
    roll_rms_mgon : rms tilt error in roll, by linear theory
    pitch_rms_mgon : the same in pitch
    roll_rms_simulated_mgon : rms tilt error in roll over simulated calibrations
    pitch_rms_simulated_mgon : the same in pitch
    both_rms_q95_simulated_mgon : bound that both angles stay below in 95 of 100, by linear theory
        over sensors if the model neglects effects
    """

    rank: int
    equipment: Literal["gravity", "robot"]
    model: str
    n_parameters: int
    scheme: str
    n_positions: int
    hold_s: float
    sensor_sigma_mps2: float
    minutes: float
    redundancy: int
    limited_by: str
    roll_rms_mgon: float
    pitch_rms_mgon: float
    roll_rms_simulated_mgon: float
    pitch_rms_simulated_mgon: float
    both_rms_q95_simulated_mgon: float

    @classmethod
    def of(cls, question: Question, c: Candidate, rank: int) -> Self:
        """Describe a candidate that was simulated."""
        assert c.simulated is not None
        left = {"rms": c.tilt.rms, "rms_simulated": c.simulated.rms}
        return cls(
            rank=rank,
            equipment=c.equipment.name,
            model=c.model.name,
            n_parameters=c.model.n_parameters,
            scheme=c.scheme.name,
            n_positions=c.scheme.n_positions,
            hold_s=c.hold,
            sensor_sigma_mps2=c.sigma,
            minutes=c.seconds / 60,
            redundancy=c.redundancy,
            limited_by=limits(question, c),
            **{f"{a}_{k}_mgon": v[i] / MGON for k, v in left.items() for i, a in enumerate(ANGLES)},
            both_rms_q95_simulated_mgon=c.simulated.quantile_of_both(QUOTED) / MGON,
        )


class PlanDocument(Document):
    """The cheapest calibrations for a tilt accuracy; `accelstudy plan --out` writes it.

    Attributes
    ----------
    state : whether a calibration reaches the accuracy
    verdict : what to do
    seed : of the simulations
    calibrations : the cheapest ones
    """

    file = "plan.json"
    state: Literal["reached", "unreachable"]
    verdict: str
    seed: int
    calibrations: list[PlannedCalibration]


@dataclass(frozen=True, eq=False, repr=False)
class Plan(Result):
    """The cheapest calibrations for a tilt accuracy.

    Attributes
    ----------
    question : accelstudy.planning.question.Question
    seed, replicates : int, of the simulation
    candidates : list of accelstudy.planning.candidates.Candidate, all that were compared
    ranked : list of Candidate, the cheapest of an equipment and a model each that reach the target,
        simulated, by the time they take; empty if none does
    """

    kind, document = PLAN, PlanDocument
    size = FULL, 95.0

    question: Question
    seed: int
    replicates: int
    candidates: list[Candidate]
    ranked: list[Candidate] = field(default_factory=list)

    @property
    def name(self) -> str:  # type: ignore[override]
        """Name of the sensor."""
        return self.question.sheet.name

    @property
    def first(self) -> Candidate:
        """The recommended candidate: by hand if that reaches the target, else with the robot."""
        return min(self.ranked, key=lambda c: c.equipment.name != "gravity")

    def best(self, equipment: str = "") -> Candidate | None:
        """The most accurate candidate, of all or with one equipment, however long it takes."""
        chosen = [c for c in self.candidates if equipment in ("", c.equipment.name)]
        return most_accurate(self.question, chosen)

    @property
    def exit_status(self) -> int:  # type: ignore[override]
        """1 if nothing reaches the accuracy."""
        return 0 if self.ranked else 1

    @property
    def state(self) -> str:
        """Whether a calibration reaches the accuracy: reached or unreachable."""
        return "reached" if self.ranked else "unreachable"

    @property
    def verdict(self) -> str:
        """What to do, in one line."""
        return wording.part_lines("answer", self)[0]

    @cached_property
    def calibrations(self) -> list[PlannedCalibration]:
        """The cheapest calibrations that reach the accuracy, by rank."""
        return [PlannedCalibration.of(self.question, c, i) for i, c in enumerate(self.ranked, 1)]

    def to_frame(self) -> pd.DataFrame:
        """Return the cheapest calibrations that reach the accuracy, by rank; angles are in mgon."""
        import pandas as pd  # slow to import, and not needed for what is printed

        rows = [one.model_dump() for one in self.calibrations]
        return pd.DataFrame(rows, columns=[*PlannedCalibration.model_fields]).set_index("rank")

    def draw(self, ax: Axes) -> None:
        """Draw the tilt error left over the time in the field."""
        from accelstudy.planning.figure import draw_plan  # Matplotlib is slow to import

        draw_plan(ax, self)

    def write(self, folder: Path, place: Path) -> None:
        """Write what `accelstudy plan` does; raises `InputError` if nothing is reached."""
        # Slow to import, and not needed for what is printed.
        from accelstudy.drawing.saving import save
        from accelstudy.drawing.style import DPI, in_style, new_figure
        from accelstudy.planning.design import write_scheme

        if not self.ranked:
            raise InputError(self.verdict)
        first = self.first
        directions = first.scheme.directions
        if first.search is not None:
            directions = directions[field_order(first.search.task, directions)]
        origin = f"accelstudy plan, seed {self.seed}", directions, {"made_by": "accelstudy plan"}
        write_scheme(folder / "positions.yaml", "plan", "of plan", *origin)
        with in_style():
            figure = new_figure(*self.size)
            self.draw(figure.subplots())
        for name in ("plan.svg", "plan.png"):
            save(figure, folder / name, "Plan", DPI)
        super().write(folder, place)

    def tell(self, place: Path | None) -> None:
        """Print the answer, the table and the assumptions."""
        if not self.ranked:
            show(self.verdict)
            return
        answer, reasons, assumptions = (
            "\n".join(wording.part_lines(part, self))
            for part in ("answer", "reasons", "assumptions")
        )
        table = "\n".join(wording.table_lines(self))
        show(answer)
        say(f"\n{table}\n\n{reasons}\n\n{assumptions}\n")
        if place is None:
            say("--out FOLDER writes the positions, the table and the figure.")
        else:
            say(f"positions, table and figure: {place}")


def most_accurate(question: Question, chosen: Sequence[Candidate]) -> Candidate | None:
    """The candidate that leaves least; None of none."""
    return min(chosen, key=lambda c: question.accuracy(c.tilt), default=None)
