"""Plans of a program."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import pandas as pd

from accelstudy.api.given import axes_of, quantity, table_html
from accelstudy.basics.errors import InputError, UnknownNameError
from accelstudy.data_sheets import of_sigma
from accelstudy.planning.answer import Answer, answer
from accelstudy.planning.figure import draw_plan
from accelstudy.planning.output import plan_table
from accelstudy.planning.quantities import QUANTITIES
from accelstudy.planning.question import Equipment, Question, equipment_of, get_sensor
from accelstudy.planning.wording import answer_lines, unreachable

if TYPE_CHECKING:
    from matplotlib.axes import Axes

EQUIPMENT = ("gravity", "robot", "both")


@dataclass(frozen=True, repr=False)
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
        return table_html("Plan", self.verdict, self.table[columns])

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
        ax = axes_of(ax)
        draw_plan(ax, self.answer)
        return ax


def plan(
    *,
    tilt_accuracy: float | str,
    sigma: float | str | None = None,
    sensor: str | None = None,
    equipment: str = "both",
    confidence: float | None = None,
    holds: Sequence[float | str] = (),
    schemes: Sequence[str] = (),
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
    confidence : float, share of the calibrations that must reach the accuracy; None for the rms
    holds : durations of a hold that are tried, in s or with a unit
    schemes : names or files of further schemes
    max_positions, replicates, seed : int
    quantities
        In SI or with a unit: ``tilt_range``, ``max_time``, ``moving_time``, ``robot_moving_time``,
        ``robot_setup_time``, ``robot_accuracy``; see ``accelstudy plan --help``.

    Raises
    ------
    InputError
        If a quantity or a name is wrong, or not one of `sigma` and `sensor` is given.
    """
    if (sensor is None) == (sigma is None):
        raise InputError(
            "plan: give the sensor by --sensor, or its noise by --sigma"
            + (", not both" if sensor else "")
        )
    if equipment not in EQUIPMENT:
        raise UnknownNameError("equipment", equipment, EQUIPMENT)
    for key in quantities:
        if key not in QUANTITIES:
            raise UnknownNameError("quantity", key, QUANTITIES)

    def value(name: str) -> float:
        given = QUANTITIES[name]
        return quantity(name, quantities.get(name, given.usual), given)

    question = Question(
        quantity("tilt_accuracy", tilt_accuracy, QUANTITIES["tilt_accuracy"]),
        value("tilt_range"),
        get_sensor(str(sensor))
        if sigma is None
        else of_sigma(quantity("sigma", sigma, QUANTITIES["sigma"])),
        equipment_of(
            equipment,
            Equipment("gravity", value("moving_time"), 0.0),
            Equipment("robot", value("robot_moving_time"), value("robot_setup_time")),
        ),
        confidence,
        tuple(sorted({quantity("holds", hold, QUANTITIES["hold"]) for hold in holds})),
        value("robot_accuracy"),
        math.inf if quantities.get("max_time") is None else value("max_time"),
        max_positions,
        tuple(schemes),
    )
    return Plan(answer(question, seed, replicates))
