"""Plans of a program."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd

from accelstudy.api.given import (
    drawing,
    each,
    for_programs,
    names,
    path_of,
    quantity,
    whole,
)
from accelstudy.basics import bounds
from accelstudy.basics.bounds import Range
from accelstudy.basics.errors import UnknownNameError
from accelstudy.drawing.style import FULL
from accelstudy.pages.notebook import notebook_html
from accelstudy.planning.answer import Answer, answer
from accelstudy.planning.figure import draw_plan
from accelstudy.planning.output import plan_table
from accelstudy.planning.quantities import MOST_POSITIONS, QUANTITIES, REPLICATES
from accelstudy.planning.question import confidence_of, question_of
from accelstudy.planning.wording import answer_lines, unreachable

if TYPE_CHECKING:
    from matplotlib.axes import Axes

EQUIPMENT = ("gravity", "robot", "both")
_MORE = (
    "tilt_range",
    "max_time",
    "moving_time",
    "robot_moving_time",
    "robot_setup_time",
    "robot_accuracy",
)


_OPTIONAL = ("sigma", "max_time")


@dataclass(frozen=True, eq=False, repr=False)
class Plan:
    """The cheapest calibrations for a tilt accuracy.

    Attributes
    ----------
    answer : accelstudy.planning.answer.Answer, all of it
    """

    answer: Answer

    def __repr__(self) -> str:
        return f"Plan({self.verdict!r})"

    def _repr_html_(self) -> str:
        columns = ["equipment", "model", "scheme", "n_positions", "hold_s", "minutes"]
        return notebook_html("Plan", self.verdict, self.table[columns])

    @property
    def verdict(self) -> str:
        """What to do, in one line."""
        return answer_lines(self.answer)[0] if self.answer.ranked else unreachable(self.answer)

    @property
    def compared(self) -> pd.DataFrame:
        """All calibrations that were compared, with their units in the names of the columns."""
        return plan_table(self.answer)

    @property
    def table(self) -> pd.DataFrame:
        """The cheapest calibrations that reach the accuracy, by rank."""
        return self.compared.dropna(subset="rank").set_index("rank").sort_index()

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the tilt error left over the time in the field."""
        with drawing(ax, FULL, 95) as ax:
            draw_plan(ax, self.answer)
        return ax


@for_programs
def plan(
    *,
    tilt_accuracy: float | str,
    sigma: float | str | None = None,
    sensor: str | None = None,
    equipment: str = "both",
    confidence: float | str | None = None,
    holds: float | str | Sequence[float | str] = (),
    schemes: str | Sequence[str] = (),
    reference: str | Path | None = None,
    max_positions: int = 200,
    replicates: int = 200,
    seed: int = 1,
    **quantities: Any,
) -> Plan:
    """Find the cheapest calibration for a tilt accuracy.

    Parameters
    ----------
    tilt_accuracy : float in rad or str with a unit, of roll and of pitch
    sigma : float in m/s² or str with a unit, of the mean of a position
    sensor : str, instead of `sigma`: a data sheet, a YAML file, or the folder of a campaign
    equipment : "gravity", "robot" or "both"
    confidence : float or str, share of the calibrations that must reach the accuracy, 0.95 or
        "95%"; None for the rms
    holds : durations of a hold that are tried, in s or with a unit
    schemes : names or files of further schemes
    reference : path of the calibration.json of a sensor beside it, or "alike"
    max_positions, replicates, seed : int
    quantities
        In SI or with a unit: ``tilt_range``, ``max_time``, ``moving_time``, ``robot_moving_time``,
        ``robot_setup_time``, ``robot_accuracy``; see ``accelstudy plan --help``.

    Raises
    ------
    InputError
        If a quantity or a name is wrong, or not one of `sigma` and `sensor` is given.
    """
    if equipment not in EQUIPMENT:
        raise UnknownNameError("equipment", equipment, EQUIPMENT)
    for key in quantities:
        if key not in _MORE:
            raise UnknownNameError("quantity", key, _MORE)
    given = {"tilt_accuracy": tilt_accuracy, "sigma": sigma}
    given |= {key: QUANTITIES[key].usual or None for key in _MORE} | quantities
    in_si: dict[str, Any] = dict.fromkeys(_OPTIONAL) | {
        key: quantity(key, value, QUANTITIES[key])
        for key, value in given.items()
        if value is not None or key not in _OPTIONAL
    }
    question = question_of(
        **in_si,
        sensor=None if sensor is None else str(path_of("sensor", sensor)),
        equipment=equipment,
        confidence=None if confidence is None else confidence_of(str(confidence)),
        holds=[quantity("holds", hold, QUANTITIES["hold"]) for hold in each(holds)],
        schemes=names("schemes", schemes),
        reference=None if reference is None else str(path_of("reference", reference)),
        max_positions=whole("max_positions", max_positions, Range(*MOST_POSITIONS)),
    )
    whole("seed", seed, bounds.SEED)
    whole("replicates", replicates, Range(*REPLICATES))
    return Plan(answer(question, seed, replicates))
