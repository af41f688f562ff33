"""Verbs that make campaigns and logs, of files or of a simulation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from os import PathLike
from typing import TYPE_CHECKING, Annotated

from accelstudy.basics import bounds
from accelstudy.basics.arguments import path_of
from accelstudy.basics.bounds import Range
from accelstudy.basics.units import GON, STANDARD_GRAVITY
from accelstudy.verbs import kinds
from accelstudy.verbs.kinds import Quantity, angle, si, verb

if TYPE_CHECKING:
    import pandas as pd

    from accelstudy import Campaign, Log

SIGMA = si("m/s^2", bounds.SIGMA_FORCE.least, bounds.SIGMA_FORCE.most)
INTERVAL = si("s", bounds.INTERVAL.least, bounds.INTERVAL.most)
Seconds = Annotated[Quantity | None, si("s", 1e-9, 1e6)]
RobotSigma = Annotated[Quantity, angle(0, 100 * GON)]
Ends = tuple[float, float] | str


@verb
def read_log(
    log: str | PathLike[str] | pd.DataFrame,
    *,
    columns: kinds.Columns = None,
    time: kinds.Time = None,
    time_unit: kinds.TimeUnit = None,
    rate: kinds.Rate = None,
    variable: kinds.Variable = None,
    unit: kinds.Unit = None,
    scale: kinds.Scale = None,
    offset: kinds.Offset = None,
    frame: kinds.Frame = None,
) -> Log:
    """Read a log, with what is said of it.

    Parameters
    ----------
    log : path or DataFrame
        Text (CSV or columns, perhaps .gz), MATLAB, Parquet, a bag of ROS 1 or 2 (extra ros) or a
        ULog of PX4 (extra px4); a table in memory, of which an index of dates is the time.

    Returns
    -------
    Log
        Its raw table is `raw.content`, of Arrow, and `samples` is a DataFrame in SI. `find_holds`
        and `apply` take it.

    Raises
    ------
    InputError
        If there is no such file, or a value is wrong.
    """
    keywords = {**locals()}
    from accelstudy.campaign.importing.log import read_log
    from accelstudy.campaign.importing.settings import settings_of

    return read_log(log, settings_of(keywords).layout)


@verb
def find_holds(
    log: Log | str | PathLike[str] | pd.DataFrame | Sequence[str | PathLike[str]],
    *,
    columns: kinds.Columns = None,
    time: kinds.Time = None,
    time_unit: kinds.TimeUnit = None,
    rate: kinds.Rate = None,
    variable: kinds.Variable = None,
    unit: kinds.Unit = None,
    scale: kinds.Scale = None,
    offset: kinds.Offset = None,
    range: Annotated[Quantity | None, si("m/s^2", 1e-9, 1e6)] = None,
    frame: kinds.Frame = None,
    threshold: Annotated[Quantity | None, SIGMA] = None,
    window: Seconds = None,
    trim: Annotated[Quantity | None, si("s", 0, 1e6)] = None,
    shortest: Seconds = None,
    exclude: str | Sequence[str] = (),
    block: Annotated[int, Range(4, 10**9)] | None = None,
    means: bool = False,
    robot_sigma: RobotSigma | None = None,
    robot_unit: str | None = None,
    reference_log: kinds.File | None = None,
    reference: kinds.File | None = None,
    reference_columns: Annotated[Mapping[str, str | int] | str | None, kinds.COLUMNS] = None,
    reference_offset: Annotated[Quantity | None, si("s", -1e12, 1e12)] = None,
    name: str | None = None,
    gravity: kinds.Gravity | None = None,
    settings: kinds.File | None = None,
) -> Campaign:
    """Make a campaign of a raw log: find its static holds.

    The sensor is at rest where the sd of the readings is near the noise floor of the log, or below
    `threshold`.

    With `reference_log` and `reference` a calibrated sensor on the same plate takes the place of a
    robot: it gives roll and pitch of each hold. The times of both logs must be of the same clock.

    The command draws segmentation.png, which shows the holds with their numbers.

    Parameters
    ----------
    log : Log or path or DataFrame, or several paths
        Text (CSV or columns, perhaps .gz), MATLAB, Parquet, a bag of ROS 1 or 2 (extra ros) or a
        ULog of PX4 (extra px4). Of several files, a folder or a pattern, each file is one position.
    range : float in m/s², or str with a unit
        Measuring range, ±, as 8g.
    threshold : float in m/s², or str with a unit
        Largest sd at rest, m/s². [default: from the log]
    window : float in s, or str with a unit
        Seconds over which rest is judged. [default: 1; of a slow log 9 samples]
    trim : float in s, or str with a unit
        Seconds cut from both ends of a hold. [default: 0.2]
    shortest : float in s, or str with a unit
        Shortest hold, s, without its ends. [default: 1]
    exclude : str, or several
        Holds to leave out, and why: 13:moved or 13,14:moved.
    block : int
        Samples of each position, in a log without the moves between them.
    means : bool
        The log is a table with the mean of each hold.
    robot_sigma : float in rad, or str with a unit
        Sd of the robot's roll and pitch, as 3.2mgon.
    robot_unit : str
        Unit of the robot's angles: gon, deg, rad. [default: gon]
    reference_log : path
        Raw log of a calibrated sensor on the same plate.
    reference : path
        The calibration.json of that sensor.
    reference_columns : mapping or str
        Columns of that log: fx=a,fy=b,fz=c,time=t. [default: as in the log of its calibration]
    reference_offset : float in s, or str with a unit
        Seconds to add to the times of that log. [default: 0; without times both logs begin
        together]
    name : str
        Name of the campaign. [default: that of the file]
    gravity : float in m/s², or str with a unit
        Local gravity, m/s². [default: 9.80665]
    settings : path
        YAML file with settings; options take precedence.

    Returns
    -------
    Campaign
        `notes` says what was found and assumed, `warnings` what may be wrong.

    Raises
    ------
    InputError
        If the log cannot be read, has no holds, or a setting is wrong.

    Examples
    --------
        accelstudy import calibration.csv --out my-campaign
        accelstudy import log.csv --out by-number --rate 100 --columns fx=0,fy=1,fz=2
        accelstudy import calibration.csv --out beside --reference-log ref.csv --reference
            calibrated/calibration.json
    """
    keywords = {**locals()}
    from accelstudy.campaign.log_import import LogImport

    return LogImport.of(**keywords).campaign


@verb
def public(name: str, *, folder: kinds.File = "resources/public") -> Campaign:
    """Make a campaign of public data.

    A download is checked by its sha256.

    Parameters
    ----------
    name : str
        Name of the data; `accelstudy catalogue public-data` lists them.
    folder : path
        Where the file is, in any subfolder, or is downloaded to.

    Examples
    --------
        accelstudy public xsens-mti --out xsens
    """
    from accelstudy.campaign.log_import import LogImport

    return LogImport.of_public(name, folder).campaign


@verb
def read_campaign(folder: str | PathLike[str], *, plausible: bool = True) -> Campaign:
    """Read a campaign from its folder; see `accelstudy.campaign.format.read_campaign`.

    Parameters
    ----------
    folder : path
    plausible : bool
        Whether data that cannot be right, as of wrong units, is refused; `diagnose` tells what is
        wrong with it, too.
    """
    from accelstudy.campaign.format import read_campaign as read_folder

    return read_folder(path_of("folder", folder), plausible=plausible)


@verb
def write_campaign(
    campaign: Campaign,
    folder: str | PathLike[str],
    *,
    force: kinds.Force = False,
    plausible: bool = True,
) -> None:
    """Write the folder of a campaign, which the commands take.

    Parameters
    ----------
    campaign : Campaign
        Its `warnings` are not written.
    folder : path
        Made if it is not there.
    plausible : bool
        Whether data that cannot be right is refused, as by `read_campaign`.
    """
    from accelstudy.campaign.format import write_campaign as write_folder
    from accelstudy.files.outputs import CAMPAIGN

    with CAMPAIGN.place(path_of("folder", folder), force=force) as part:
        write_folder(campaign, part, plausible=plausible)


@verb
def simulate_campaign(
    *,
    name: str | None = None,
    seed: kinds.Seed = 1,
    scheme: kinds.SchemeName = "mclaren-24",
    repeats: Annotated[int, bounds.POSITIONS] = 1,
    repeat_first: Annotated[int, Range(0, bounds.POSITIONS.most)] = 0,
    order: str = "scheme",
    approach: kinds.ApproachName = "robot",
    model: kinds.ModelName = "bias-scale-nonorthogonality",
    effects: kinds.EffectName | Sequence[kinds.EffectName] = (),
    size: Annotated[Quantity, si("1", bounds.SIZE.least, bounds.SIZE.most)] = 1,
    noise_effects: kinds.NoiseEffectName | Sequence[kinds.NoiseEffectName] = (),
    sigma: Annotated[Quantity, SIGMA] = "2mm/s^2",
    sigma_known: bool = True,
    robot_sigma: RobotSigma = "3.2mgon",
    gravity: kinds.Gravity = STANDARD_GRAVITY,
    interval: Annotated[Quantity | None, INTERVAL] = "60s",
    temperature: Annotated[Ends | None, kinds.numbers("two numbers, as 20:40", ":", 2)] = None,
    temperature_order: str = "linear",
    vibration: Annotated[Ends | None, kinds.numbers("two numbers, as 0:1", ":", 2)] = None,
    yaw: str = "none",
    n_samples: Annotated[int, bounds.SAMPLES] | None = None,
) -> Campaign:
    """Simulate a campaign with effects of your choice.

    Noise effects are possible, too; `accelstudy effects` lists both. Parameters that are not given
    are drawn at random, from the seed. The truth is `truth` of the campaign; the command writes it
    to --truth and nowhere else.

    Parameters
    ----------
    name : str
        Name of the campaign. [default: that of its folder, or simulated]
    scheme : str
        Positions; `accelstudy schemes` lists them.
    repeats : int
        How often the scheme is measured.
    repeat_first : int
        First holds that are measured again at the end.
    order : str
        Order of the holds: scheme or random.
    effects : str, or several
        An effect beside the model, as 'warm_up(tau=400)' or, with its parameters in SI,
        'thermal_bias: 0.004, -0.002, 0.001'; an effect that the model has is replaced.
    size : float
        Factor of the typical size of each effect of `effects` without parameters.
    noise_effects : str, or several
        A noise effect, as 'heavy_tails(nu=3)'.
    sigma : float in m/s², or str with a unit
        Sd of a position's mean.
    sigma_known : bool
        Whether the campaign states its noise.
    robot_sigma : float in rad, or str with a unit
        Sd of the robot's roll and pitch.
    gravity : float in m/s², or str with a unit
        Local gravity.
    interval : float in s, or str with a unit
        Time between holds; none leaves it out.
    temperature : two of float, or str
        First and last temperature, °C, as 20:40.
    temperature_order : str
        Course of the temperature: linear, ABBA or random.
    vibration : two of float, or str
        Lowest and highest rms, m/s², as 0:1.
    yaw : str
        Yaw of the holds: none or random.
    n_samples : int
        Samples of a hold; adds the columns of their number and their sds.

    Returns
    -------
    Campaign
        With the truth as `truth`.

    Raises
    ------
    InputError
        If a name is unknown or a value is wrong.

    Examples
    --------
        accelstudy simulate-campaign --out blind --truth truth.yaml --effect "warm_up(tau=400)"
    """
    settings = {**locals()}
    from accelstudy.campaign.simulated import simulate_campaign as simulate

    return simulate({**settings, "name": name or "simulated"})
