"""Verbs on a campaign and on its calibration."""

from __future__ import annotations

from os import PathLike
from typing import TYPE_CHECKING, Annotated, Any

from accelstudy.basics.arguments import path_of
from accelstudy.basics.bounds import SIGMA_READING, TIME, Range
from accelstudy.basics.progress import stage, warn
from accelstudy.verbs import kinds
from accelstudy.verbs.kinds import Quantity, si, verb

if TYPE_CHECKING:
    import pandas as pd

    from accelstudy import Calibration, Campaign, Diagnosis, Log
    from accelstudy.campaign.calibration.leveling import Leveling


@verb
def calibrate(
    campaign: Campaign | str | PathLike[str],
    *,
    model: kinds.ModelName = "bias-scale-nonorthogonality",
    approach: kinds.UsualApproach = None,
    prior: kinds.TypeFile = None,
) -> Calibration:
    """Calibrate a campaign and report on it.

    The folder of results gets report.html for you, calibration.json for `apply`, `export` and
    programs, positions.parquet and figures. Parameters are in the axes frd (forward, right, down),
    whatever the axes of the log are.

    Parameters
    ----------
    campaign : Campaign or path
        Folder of the campaign.

    Raises
    ------
    InputError
        If the campaign does not determine the model, or a name is unknown.

    Examples
    --------
        accelstudy calibrate my-campaign --out calibrated
    """
    from accelstudy.campaign.calibration.result import Calibration
    from accelstudy.verbs.inputs import campaign_path, fit_of

    fit = fit_of(campaign, model, approach, prior)
    return Calibration(fit, source=campaign_path(campaign))


@verb
def read_calibration(path: str | PathLike[str]) -> Calibration:
    """Read a calibration.json.

    Parameters
    ----------
    path : path
        The file, or the folder that has it.

    Raises
    ------
    InputError
        If there is no such file, or it is not a calibration.
    """
    from accelstudy.campaign.calibration.result import Calibration
    from accelstudy.campaign.calibration.sensor_calibration import read_calibration as read

    document = read(path_of("path", path)).document
    return Calibration(None, document.model_dump(by_alias=True))


@verb
def check_sigmas(
    campaign: Campaign | str | PathLike[str],
    *,
    model: kinds.ModelName = "bias-scale-nonorthogonality",
    approach: kinds.UsualApproach = None,
    replicates: Annotated[int, Range(2, 10**9)] = 2000,
    seed: kinds.Seed = 1,
) -> pd.DataFrame:
    """Check the sigmas of a calibration by simulation.

    The campaign is simulated with the noise from which its sigmas were computed. So the check finds
    whether the adjustment turns that noise into the right sigmas, and not whether the noise is
    right.

    Parameters
    ----------
    campaign : Campaign or path
        Folder of the campaign.
    replicates : int
        Simulated campaigns.

    Returns
    -------
    DataFrame
        A row per parameter, in the units that people read: parameter, unit, estimate, sigma (as the
        adjustment claims it), sd_empirical with its 95 % interval, bias, ratio (sigma over
        sd_empirical) and n_converged. What such a check can find is said in ``attrs["legend"]``.

    Examples
    --------
        accelstudy check-sigmas my-campaign --replicates 500
    """
    from accelstudy.campaign.calibration.sigma_check import check_sigmas as check
    from accelstudy.campaign.calibration.wording import sentences
    from accelstudy.verbs.inputs import fit_of

    fit = fit_of(campaign, model, approach)
    table = check(fit, replicates, seed)
    meaning = "sigma: as the adjustment claims it; ratio: sigma / sd_empirical."
    table.attrs["legend"] = f"{meaning}\n{sentences(fit, 'finds')[0]}"
    return table


@verb
def apply(
    calibration: Calibration | str | PathLike[str],
    log: Log | str | PathLike[str] | pd.DataFrame,
    *,
    columns: kinds.Columns = None,
    time: kinds.Time = None,
    time_unit: kinds.TimeUnit = None,
    rate: kinds.Rate = None,
    variable: kinds.Variable = None,
    unit: kinds.Unit = None,
    frame: kinds.Frame = None,
    start: Annotated[Quantity | None, si("s", TIME.least, TIME.most)] = None,
    sigma: Annotated[Quantity | None, si("m/s^2", 0.0, SIGMA_READING.most)] = None,
) -> pd.DataFrame:
    """Apply a calibration to a log and level with it.

    The log is read as that of the campaign was; `columns` and the like say what is different. The
    output has the columns of the log, and beside them the calibrated force, roll and pitch with
    their sigmas, in the axes of the log. The new cells of a row that cannot be corrected stay
    empty. Where the x axis is so near the vertical that the sigmas of roll and pitch do not hold,
    near_pole is true.

    Some effects depend on the time since the calibration session began. The first row is taken for
    that moment. This is right for the log of the session itself, and for a warm-up if the log
    begins when the sensor is switched on. For a log that begins later give `start`. A drift is
    known in its session only; later rows are corrected by the drift at its end. Hysteresis and
    settling depend on the previous position, which a log does not contain; they are not corrected.

    Parameters
    ----------
    calibration : Calibration or path
        A calibration.json.
    log : Log or path or DataFrame
        Any log that `accelstudy import` reads.
    time_unit : str
        Unit of the time: s, ms, us or ns.
    unit : str
        Unit of the readings: m/s^2, g, mg or counts.
    frame : str
        Where x, y, z point: frd, flu, rfu … [default: that of the calibration]
    start : float in s, or str with a unit
        Seconds from the start of the calibration session to the first row. [default: 0]
    sigma : float in m/s², or str with a unit
        Sd of a reading, m/s². [default: as within the holds of the campaign]

    Returns
    -------
    DataFrame
        The columns of the log, the calibrated force in m/s², roll and pitch in the unit that the
        names say, and their sigmas; a DataFrame keeps its index. Warnings stand in
        ``attrs["warnings"]``.

    Examples
    --------
        accelstudy apply calibrated/calibration.json calibration.csv --out leveled.csv
    """
    keywords: dict[str, Any] = {**locals()}
    result = level_log(**keywords)
    table = result.to_frame()
    table.attrs["warnings"] = list(result.warnings)
    return table


def level_log(calibration: Any, log: Any, **keywords: Any) -> Leveling:
    """Level a log by the keywords of `apply`, checked."""
    from accelstudy.campaign.calibration.leveling import level
    from accelstudy.campaign.calibration.sensor_calibration import sensor_of
    from accelstudy.campaign.importing.settings import settings_of

    sigma, start = keywords["sigma"], keywords["start"]
    return level(sensor_of(calibration), log, settings_of(keywords).layout, sigma, start)


@verb
def export(calibration: Calibration | str | PathLike[str], *, form: str = "c") -> str:
    """Print a calibration in a form that a device takes.

    c is a header in C99 with the function accel_calibrate. It takes the reading and, where effects
    depend on them, temperature, time and vibration. A model with an effect that depends on the
    previous position is refused.

    matrix is M in force = M · (x, y, z, 1), for a model that depends on the force alone, and
    linearly.

    px4 is a parameter file for PX4: an offset, a scale and a polynomial of the temperature for each
    axis, closest to the calibration over all attitudes. A warning says what PX4 cannot express, and
    the errors of roll and pitch that this leaves.

    Readings and forces are in the axes of the log.

    Parameters
    ----------
    calibration : Calibration or path
        A calibration.json.
    form : str
        Form: c, c-double, matrix or px4.

    Returns
    -------
    str
        Text of a file.

    Examples
    --------
        accelstudy export calibrated/calibration.json --form c
    """
    from accelstudy.campaign.calibration.export import export as write
    from accelstudy.campaign.calibration.sensor_calibration import sensor_of

    text, warnings = write(sensor_of(calibration), form)
    for warning in warnings:
        warn(warning)
    return text


@verb
def diagnose(
    campaign: Campaign | str | PathLike[str],
    *,
    model: kinds.ModelName = "bias-scale-nonorthogonality",
    approach: kinds.UsualApproach = None,
    prior: kinds.TypeFile = None,
    seed: kinds.Seed = 1,
) -> Diagnosis:
    """Find what a sensor model lacks to explain a campaign.

    Missing effects, wrong noise and gross errors are distinguished. What is missing is added to the
    model, and tested on positions that were not used to find it.

    Parameters
    ----------
    campaign : Campaign or path
        Folder of the campaign.

    Raises
    ------
    InputError
        If the campaign does not determine the model, or a name is unknown.

    Examples
    --------
        accelstudy diagnose my-campaign --out diagnosed
    """
    from accelstudy.diagnosis import pipeline
    from accelstudy.diagnosis.report.output import Diagnosis
    from accelstudy.verbs.inputs import campaign_path, resolve

    # The diagnosis, not the reader, looks for wrong units and axes.
    inputs = resolve(campaign, model, approach, prior, plausible=False)
    with stage("search for what is missing"):
        result = pipeline.diagnose(*inputs, seed=seed)
    return Diagnosis(result, campaign_path(campaign))
