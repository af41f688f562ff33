"""Verbs before a calibration: how much is needed, and where."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from os import PathLike
from typing import TYPE_CHECKING, Annotated

from accelstudy.basics import bounds
from accelstudy.basics.arguments import path_of
from accelstudy.basics.bounds import Range
from accelstudy.basics.progress import stage
from accelstudy.basics.units import GON, MGON, STANDARD_GRAVITY, InputQuantity
from accelstudy.verbs import kinds
from accelstudy.verbs.kinds import Names, Quantity, angle, verb

if TYPE_CHECKING:
    from accelstudy import Advice, Campaign, DataSheet, Design, Plan, Simulation

DAY = 86400.0
"""s"""
Duration = Annotated[Quantity, InputQuantity("s", 0.01, DAY)]
MovingTime = Annotated[Quantity, InputQuantity("s", most=3600.0)]
Sigma = Annotated[Quantity, InputQuantity("m/s^2", 1e-9, 10.0)]
RobotSigma = Annotated[Quantity, angle(1e-6 * MGON, 10 * GON)]
HalfTurn = Annotated[Quantity, angle(-200 * GON, 200 * GON)]
QuarterTurn = Annotated[Quantity, angle(-100 * GON, 100 * GON)]


@verb
def plan(
    *,
    tilt_accuracy: Annotated[Quantity, angle(1e-4 * MGON, 100 * GON)],
    tilt_range: Annotated[Quantity, angle(0.1 * GON, 90 * GON)] = kinds.TILT_RANGE,
    sensor: kinds.SensorName | None = None,
    sigma: Sigma | None = None,
    history: kinds.File | None = None,
    equipment: str = "both",
    confidence: Annotated[float | str, kinds.SHARE_OR_RMS] = "rms",
    holds: Duration | Sequence[Duration] = (),
    max_time: Duration | None = None,
    max_positions: Annotated[int, Range(4, 400)] = 200,
    replicates: Annotated[int, Range(20, 1_000_000)] = 200,
    seed: kinds.Seed = 1,
    moving_time: MovingTime = "20s",
    robot_moving_time: MovingTime = "10s",
    robot_setup_time: Annotated[Quantity, InputQuantity("s", most=DAY)] = "30min",
    robot_sigma: RobotSigma = "3.2mgon",
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
    confidence : float or str
        What must reach the accuracy: the rms, or both angles in so many calibrations, as 95%.
    holds : float in s, or str with a unit, or several
        Duration of a position, as 10s; may be repeated. [default: 5 s to 120 s; 10 s for `sigma`]
    max_time : float in s, or str with a unit
        Longest time in the field, as 20min.
    max_positions : int
        Largest number of positions.
    replicates : int
        Simulated calibrations of each candidate at the top.
    moving_time : float in s, or str with a unit
        Time from position to position by hand.
    robot_moving_time : float in s, or str with a unit
        Time from position to position with the robot.
    robot_setup_time : float in s, or str with a unit
        Time to mount the sensor on the robot.
    robot_sigma : float in rad, or str with a unit
        Sd of the robot's roll and pitch.

    Raises
    ------
    InputError
        If a quantity or a name is wrong, or not one of `sigma` and `sensor` is given.

    Examples
    --------
        accelstudy plan --tilt-accuracy 10mgon --tilt-range 30gon --sigma 2mm/s2
    """
    keywords = {**locals()}
    from accelstudy.planning.answer import plan_for

    return plan_for(**keywords)


@verb
def find_positions(
    *,
    model: kinds.ModelName = "bias-scale-nonorthogonality",
    approach: kinds.ApproachName = "robot",
    positions: Annotated[int, Range(1, 300)] = 24,
    sigma: Sigma = "2mm/s^2",
    robot_sigma: RobotSigma = "3.2mgon",
    gravity_sigma: Annotated[Quantity, InputQuantity("m/s^2")] = "0",
    criterion: str = "I",
    tilt_range: Annotated[Quantity, angle(GON / 10, 100 * GON)] = kinds.TILT_RANGE,
    after: kinds.SchemeName | None = None,
    attitudes: Annotated[str, Names("attitudes", "accelstudy.design.spaces:SPACES", True)] = "all",
    roll: tuple[HalfTurn, HalfTurn] | None = None,
    pitch: tuple[QuarterTurn, QuarterTurn] | None = None,
    pole_distance: Annotated[Quantity, angle(0.0, 100 * GON)] | None = None,
    seed: kinds.Seed = 1,
    starts: Annotated[int, Range(1, 1000)] = 8,
) -> Design:
    """Find the best positions for a calibration.

    The result is a scheme, a YAML file: configurations and commands take its path wherever they
    take the name of a scheme. The order of the positions keeps the turns between them small, with
    the last position near the first.

    Parameters
    ----------
    positions : int
        Number of positions.
    sigma : float in m/s², or str with a unit
        Sd of a position's mean.
    robot_sigma : float in rad, or str with a unit
        Sd of the robot's roll and pitch.
    gravity_sigma : float in m/s², or str with a unit
        Sd of the value of gravity; 0 holds it fixed.
    criterion : str
        I: variance of roll and pitch; D: determinant of the parameters' covariance matrix; A: mean
        variance of the parameters; minimax: variance of the worse of roll and pitch.
    tilt_range : float in rad, or str with a unit
        Largest tilt at which the calibrated sensor is used.
    after : str
        Scheme that has been measured already.
    attitudes : str
        Attitudes to choose from: all; cube: on faces, edges and corners; hand: in steps of 30° that
        an eye can judge; or a scheme, such as a file of those that are allowed.
    roll : two of float in rad, or str with a unit
        Least and largest roll.
    pitch : two of float in rad, or str with a unit
        Least and largest pitch.
    pole_distance : float in rad, or str with a unit
        Least angle to the vertical x axis, where roll is undefined.
    starts : int
        Number of random sets from which the search starts.

    Raises
    ------
    InputError
        If a name or a value is wrong, or no such positions determine the model.

    Examples
    --------
        accelstudy design --positions 12 --tilt-range 30gon --out my-scheme.yaml
        accelstudy simulate-campaign --scheme my-scheme.yaml --out designed-campaign
    """
    keywords = {**locals()}
    from accelstudy.planning.design import Design

    return Design.of(**keywords)


@verb
def advise(
    campaign: Campaign | str | PathLike[str],
    *,
    tilt_accuracy: kinds.Accuracy,
    tilt_range: kinds.Tilt = kinds.TILT_RANGE,
    approach: kinds.UsualApproach = None,
    model: kinds.ModelName = "bias-scale-nonorthogonality",
    prior: kinds.TypeFile = None,
    attitudes: Annotated[
        str | None, Names("attitudes", "accelstudy.sequential.choice:SETS", True)
    ] = None,
    pole_distance: Annotated[Quantity, angle(0.0, 2.0)] | None = None,
    max_roll: Annotated[Quantity, angle(0.0, 4.0)] | None = None,
    max_pitch: Annotated[Quantity, angle(0.0, 4.0)] | None = None,
) -> Advice:
    """Say in a session where to go next, and when to stop.

    The positions so far are calibrated and judged as `calibrate` does. The advice says which
    parameters are not determined yet, which positions contradict the others, and the tilt error so
    far.

    The tilt error is an rms over all calibrations that the noise could have given. If the noise is
    known, about half of them leave more than this in roll or in pitch.

    Parameters
    ----------
    campaign : Campaign or path
        Folder of the session. It has a campaign.yaml; positions.csv may have few positions or none,
        or not exist yet.
    tilt_accuracy : float in rad, or str with a unit
        Rms of roll and of pitch to reach, as 10mgon or 0.01deg.
    tilt_range : float in rad, or str with a unit
        Largest tilt at which the accuracy is wanted.
    attitudes : str
        Attitudes to choose from: cube (faces, edges, corners), grid (roll and pitch in steps of 25
        gon) or a scheme. [default: cube, with a robot grid]
    pole_distance : float in rad, or str with a unit
        Least angle between the x axis and the vertical. [default: none]
    max_roll : float in rad, or str with a unit
        Largest roll, either way. [default: any]
    max_pitch : float in rad, or str with a unit
        Largest pitch, either way. [default: any]

    Raises
    ------
    InputError
        If no positions can determine the model, or a name or a value is wrong.

    Examples
    --------
        accelstudy advise my-campaign --tilt-accuracy 10mgon --tilt-range 30gon
    """
    keywords = {**locals()}
    from accelstudy.campaign.format import read_campaign
    from accelstudy.sequential.advisor import advise_session
    from accelstudy.verbs.inputs import as_campaign, campaign_path

    place = campaign_path(keywords.pop("campaign"))
    session = as_campaign(campaign) if place is None else read_campaign(place, running=True)
    return advise_session(session, place, **keywords)


@verb
def simulate(
    model: str | PathLike[str] | Sequence[str | PathLike[str]],
    scheme: str | PathLike[str] | Sequence[str | PathLike[str]],
    approach: str | Sequence[str],
    *,
    sigma: Sigma | Sequence[Sigma],
    robot_sigma: RobotSigma = "3.2mgon",
    gravity: kinds.Gravity = STANDARD_GRAVITY,
    truth: Annotated[Mapping[str, float | str] | None, kinds.pairs("b_x=5mg,s_y=200ppm")] = None,
    replicates: Annotated[int, Range(2, bounds.REPLICATES.most)] = 1000,
    seed: kinds.Seed = 1,
) -> Simulation:
    """Simulate the calibrations of one set-up, or of every combination of several.

    A study of the workflow with the same cells, noise and seed gives the same numbers. Effects that
    need times or temperatures of holds take a study, whose configuration has `holds`.

    Parameters
    ----------
    model, scheme, approach : str or path, or several
        A name or a file.
    sigma : float in m/s², or str with a unit, or several
        Noise of the mean of a position.
    robot_sigma : float in rad, or str with a unit
        Sd of the robot's roll and pitch.
    gravity : float in m/s², or str with a unit
        Local gravity.
    truth : mapping of str to float, or str with a unit
        True values of parameters; 0 if omitted. Of several models each has those that are its own.
    replicates : int
        Calibrations of each set-up.

    Raises
    ------
    InputError
        If a name or a value is wrong, or the positions do not determine any of the models.
    """
    keywords = {**locals()}
    from accelstudy.study.result import Simulation

    return Simulation.of(**keywords)


@verb
def data_sheet(
    source: str | PathLike[str],
    *,
    columns: kinds.Columns = None,
    time: kinds.Time = None,
    time_unit: kinds.TimeUnit = None,
    rate: kinds.Rate = None,
    variable: kinds.Variable = None,
    unit: kinds.Unit = None,
    scale: kinds.Scale = None,
    settings: kinds.File | None = None,
) -> DataSheet:
    """Make a data sheet of a sensor from a log or a campaign.

    White noise, bias instability and random walk come from the Allan deviation of the log; of a
    campaign only the noise of its positions is known. You can add values of the maker to the file,
    which `accelstudy plan --sensor` takes.

    Parameters
    ----------
    source : path
        A log in which the sensor rests, the longer the better, or the folder of a campaign.
    settings : path
        YAML file with these settings, as for an import.

    Raises
    ------
    InputError
        If the source cannot be read, or tells too little.

    Examples
    --------
        accelstudy data-sheet log.csv --rate 100 --columns fx=0,fy=1,fz=2 --out my-sensor.yaml
    """
    keywords = {**locals()}
    from accelstudy.campaign.importing.settings import settings_of
    from accelstudy.data_sheets.measured import sheet_of_campaign, sheet_of_log

    path = path_of("source", keywords.pop("source"))
    with stage("Allan deviation"):
        if path.is_dir():
            return sheet_of_campaign(path)
        return sheet_of_log(path, settings_of(keywords))
