"""Verbs on several calibrations or campaigns: of one sensor over time, or of one type."""

from __future__ import annotations

import os
from collections.abc import Sequence
from datetime import date
from os import PathLike
from typing import TYPE_CHECKING, Annotated

from accelstudy.basics.arguments import paths_of
from accelstudy.basics.bounds import Range
from accelstudy.verbs import kinds
from accelstudy.verbs.kinds import verb

if TYPE_CHECKING:
    from accelstudy import Batch, Calibration, Campaign, History, Lot


@verb
def compare(
    first: Calibration | str | PathLike[str],
    second: Calibration | str | PathLike[str],
    *,
    tilt_range: kinds.Tilt = kinds.TILT_RANGE,
) -> History:
    """Test whether a sensor changed between two calibrations.

    The congruence test of deformation analysis takes all parameters with both covariance matrices;
    if it rejects, the parameters that changed are named, with one level for all tests together. The
    change is also given in roll and pitch. Both calibrations have to be of one model. If both
    campaigns have a date, the older one comes first.

    The folder of results gets report.html, history.json and a figure.

    Parameters
    ----------
    first : Calibration or path
        The older calibration.json.
    second : Calibration or path
        The newer one.
    tilt_range : float in rad, or str with a unit
        Tilts over which the change of roll and pitch is taken.

    Raises
    ------
    InputError
        If they are of different models, or their readings were converted differently, or both are
        one file.

    Examples
    --------
        accelstudy compare spring/calibration.json autumn/calibration.json --out both
    """
    from accelstudy.campaign.calibration.sensor_calibration import sensor_of
    from accelstudy.epochs.history import History, dates_of

    paths_of((first, second), "calibration", os.path.exists)
    sensors = sensor_of(first, "first"), sensor_of(second, "second")
    # The range is in SI by `verb`.
    return History(sensors, dates_of(sensors, (), ("first", "second")), float(tilt_range))


@verb
def history(
    calibrations: Sequence[Calibration | str | PathLike[str]],
    *,
    dates: Sequence[Annotated[str | date, kinds.DATE]] = (),
    tilt_accuracy: kinds.Accuracy | None = None,
    tilt_range: kinds.Tilt = kinds.TILT_RANGE,
    confidence: kinds.Share = "95%",
) -> History:
    """Say how a sensor changes over time.

    The congruence test says what changed. For each parameter there is a rate with its interval, and
    the scatter from session to session, as by switching the sensor off and on. All tests together
    have one level. All calibrations have to be of one model; of two, the result is that of
    `compare`.

    With `tilt_accuracy` the result says how long the last calibration is good enough, and what a
    new one would gain.

    The folder of results gets report.html, history.json and a figure.

    Parameters
    ----------
    calibrations : sequence of Calibration or path
        calibration.json files of one sensor, their folders, or patterns; three or more for rates
        and scatter.
    dates : sequence of str or date
        Date of a calibration, as 2026-03-01 or 2026-03-01T14:00; one for each, in their order.
        [default: those of the campaigns]
    tilt_accuracy : float in rad, or str with a unit
        Ask how long the last calibration stays this accurate in roll and pitch, as 10mgon.
    tilt_range : float in rad, or str with a unit
        Tilts over which roll and pitch are compared, and at which the accuracy is wanted.
    confidence : float or str
        Probability with which it stays so.

    Raises
    ------
    InputError
        If they are fewer than two, of one date, or of different models.

    Examples
    --------
        accelstudy history spring/calibration.json autumn/calibration.json
            winter/calibration.json --date 2025-04-01 --date 2025-10-01 --date 2026-01-15 --out
            years
    """
    from accelstudy.campaign.calibration.sensor_calibration import sensor_of
    from accelstudy.epochs.history import History, check_different, dates_of

    calibrations = paths_of(calibrations, "calibration", os.path.exists)
    sensors, names = [sensor_of(one) for one in calibrations], [*map(str, calibrations)]
    check_different(sensors, names)
    dated = dates_of(sensors, dates, names)
    accuracy = None if tilt_accuracy is None else float(tilt_accuracy)  # in SI by `verb`
    return History(sensors, dated, float(tilt_range), accuracy, float(confidence))


@verb
def lot(
    campaigns: Sequence[Campaign | str | PathLike[str]],
    *,
    model: kinds.ModelName = "bias-scale-nonorthogonality",
    approach: kinds.UsualApproach = None,
    seed: kinds.Seed = 1,
    cores: Annotated[int, Range(1, 10_000)] = 1,
) -> Lot:
    """Say what the model of sensors of one type lacks.

    The campaigns may differ in positions, columns and approach. Effects that are too small for one
    campaign show in many: the lot says whether anything is missing, with one level for all tests
    together, in how many of the sensors, how large it is, and which sensors are odd.

    The folder of results gets report.html, lot.json, a figure, a calibration.json of each sensor
    with all that the model lacks, and type.yaml: the model of the type for `--model`, what these
    sensors tell of the next one for `--prior`, and a data sheet for `plan --sensor`.

    Parameters
    ----------
    campaigns : sequence of Campaign or path
        Folders of campaigns, one per sensor, or patterns such as 'sensor-*'.
    cores : int
        Processes that work at once; the results do not depend on their number.

    Raises
    ------
    InputError
        If fewer than two campaigns can be judged, or a name is unknown.

    Examples
    --------
        accelstudy lot sensor-1 sensor-2 sensor-3 --out lot
    """
    from accelstudy.lots.output import Lot
    from accelstudy.verbs.inputs import as_campaign, model_and_approach

    measured = [as_campaign(one) for one in paths_of(campaigns, "sensor", os.path.isdir)]
    return Lot.of(measured, *model_and_approach(model, approach), seed, cores)


@verb
def batch(
    campaigns: Sequence[Campaign | str | PathLike[str]],
    *,
    model: kinds.ModelName = "bias-scale-nonorthogonality",
    approach: kinds.UsualApproach = None,
) -> Batch:
    """Calibrate many campaigns, each by itself.

    A campaign that cannot be calibrated is named, and the others go on.

    The folder of results gets report.html with an overview, a table of the campaigns and one of
    their parameters, and in each/NAME what `accelstudy calibrate` writes of a campaign.

    Parameters
    ----------
    campaigns : sequence of Campaign or path
        Folders of campaigns, or patterns such as 'campaigns/*'.

    Raises
    ------
    InputError
        If none can be calibrated, or a name is unknown.

    Examples
    --------
        accelstudy batch sensor-1 sensor-2 --out batch
    """
    from accelstudy.campaign.batch import Batch
    from accelstudy.verbs.inputs import model_and_approach

    return Batch(
        paths_of(campaigns, "campaign", os.path.isdir), *model_and_approach(model, approach)
    )
