"""Verbs before a calibration: how much is needed, and where."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from accelstudy.basics.bounds import Range
from accelstudy.planning.quantities import EQUIPMENT, MOST_POSITIONS, QUANTITIES, REPLICATES
from accelstudy.verbs.kinds import File, Quantity, SchemeName, Seed, SensorName, Share, verb

if TYPE_CHECKING:
    from accelstudy.api.plans import Plan

Hold = Annotated[Quantity, QUANTITIES["hold"]]


@verb
def plan(
    *,
    tilt_accuracy: Annotated[Quantity, QUANTITIES["tilt_accuracy"]],
    tilt_range: Annotated[Quantity, QUANTITIES["tilt_range"]] = "30gon",
    sensor: SensorName | None = None,
    sigma: Annotated[Quantity, QUANTITIES["sigma"]] | None = None,
    history: File | None = None,
    equipment: str = "both",
    reference: File | None = None,
    confidence: Annotated[float | str, Share(rms=True)] = "rms",
    holds: Hold | Sequence[Hold] = (),
    schemes: SchemeName | Sequence[SchemeName] = (),
    max_time: Annotated[Quantity, QUANTITIES["max_time"]] | None = None,
    max_positions: Annotated[int, Range(*MOST_POSITIONS)] = 200,
    replicates: Annotated[int, Range(*REPLICATES)] = 200,
    seed: Seed = 1,
    moving_time: Annotated[Quantity, QUANTITIES["moving_time"]] = "20s",
    robot_moving_time: Annotated[Quantity, QUANTITIES["robot_moving_time"]] = "10s",
    robot_setup_time: Annotated[Quantity, QUANTITIES["robot_setup_time"]] = "30min",
    robot_accuracy: Annotated[Quantity, QUANTITIES["robot_accuracy"]] = "3.2mgon",
) -> Plan:
    """Find the cheapest calibration for a tilt accuracy.

    Models, schemes, numbers of positions and durations are compared by linear theory, and those at
    the top are simulated. The sensor is `sensor` or, if only its noise is known, `sigma`. If
    nothing reaches the accuracy, one line says what would be reachable, and the exit status of the
    command is 1.

    Parameters
    ----------
    tilt_accuracy : float in rad, or str with a unit
        Accuracy wanted of roll and of pitch, as 10mgon or 0.01deg.
    tilt_range : float in rad, or str with a unit
        Largest tilt at which the sensor is used.
    sensor : str
        A data sheet that comes with accelstudy, a YAML file like it, or the folder of a campaign.
    sigma : float in m/s², or str with a unit
        Noise of the mean of a position, as 2mm/s2, if no more is known of the sensor.
    history : path
        A history.json of this sensor: drift and switch-on scatter of its bias.
    equipment : str
        Positions by hand, with gravity alone, or with a robot that tells roll and pitch: gravity,
        robot or both.
    reference : path or "alike"
        Compare with a calibrated sensor beside it, too: its calibration.json, or alike, for one of
        the same type.
    confidence : float or str
        What must reach the accuracy: the rms, or both angles in so many calibrations, as 95%.
    holds : float in s, or str with a unit, or several
        Duration of a position, as 10s; may be repeated. [default: 1 s to 120 s; 10 s for `sigma`]
    schemes : str, or several
        One more to compare: a name, or a file of `accelstudy design`; may be repeated.
    max_time : float in s, or str with a unit
        Longest time in the field, as 20min.
    max_positions : int
        Largest number of positions.
    replicates : int
        Simulated calibrations of each candidate at the top.
    seed : int
        Seed of all random numbers.
    moving_time : float in s, or str with a unit
        Time from position to position by hand.
    robot_moving_time : float in s, or str with a unit
        Time from position to position with the robot.
    robot_setup_time : float in s, or str with a unit
        Time to mount the sensor on the robot.
    robot_accuracy : float in rad, or str with a unit
        Standard deviation of the robot's roll and pitch.

    Raises
    ------
    InputError
        If a quantity or a name is wrong, or not one of `sigma` and `sensor` is given.
    """
    from accelstudy.api.plans import Plan
    from accelstudy.basics.errors import UnknownNameError
    from accelstudy.basics.progress import begin
    from accelstudy.data_sheets.measured import with_history
    from accelstudy.planning.answer import answer
    from accelstudy.planning.question import question_of

    if equipment not in EQUIPMENT:
        raise UnknownNameError("equipment", equipment, EQUIPMENT)
    asked: dict[str, Any] = {  # which `verb` has checked
        "tilt_accuracy": tilt_accuracy,
        "tilt_range": tilt_range,
        "sigma": sigma,
        "confidence": confidence,
        "max_time": max_time,
        "moving_time": moving_time,
        "robot_moving_time": robot_moving_time,
        "robot_setup_time": robot_setup_time,
        "robot_accuracy": robot_accuracy,
        "holds": holds,
        "schemes": schemes,
    }
    question = question_of(
        **asked,
        sensor=sensor,
        equipment=equipment,
        reference=None if reference is None else str(reference),
        max_positions=max_positions,
    )
    if history is not None:
        question = replace(question, sheet=with_history(question.sheet, Path(history)))
    begin("comparing calibrations, which takes some seconds ...")
    return Plan(answer(question, seed, replicates))
