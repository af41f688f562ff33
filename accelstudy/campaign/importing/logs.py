"""The way from raw logs to campaigns, stage by stage."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from accelstudy.basics.errors import InputError
from accelstudy.campaign.format import write_campaign
from accelstudy.campaign.importing.blocks import segment_blocks
from accelstudy.campaign.importing.holds import DetectedHolds, detected_holds
from accelstudy.campaign.importing.making import ImportReport, campaign_of_holds
from accelstudy.campaign.importing.means import import_means
from accelstudy.campaign.importing.recording import AXES, Recording, read_log
from accelstudy.campaign.importing.segments import segment_logs
from accelstudy.campaign.importing.settings import ImportSettings, Span, named_after
from accelstudy.campaign.importing.sources import LogFile
from accelstudy.campaign.importing.windows import Windows, samples_in, usual_window
from accelstudy.campaign.session import Campaign

if TYPE_CHECKING:
    from accelstudy.campaign.beside import Beside


def import_log(
    path: LogFile, settings: ImportSettings | None = None
) -> tuple[Campaign, ImportReport]:
    """Import a log of one sensor or a table of means; see `import_sensors`."""
    ((campaign, report),) = import_sensors([path], settings or ImportSettings()).values()
    return campaign, report


def import_sensors(
    paths: Sequence[LogFile],
    settings: ImportSettings,
    beside: Beside | None = None,
) -> dict[str, tuple[Campaign, ImportReport]]:
    """Find the static holds of the sensors in a log, or in logs of one position each.

    If the settings say so, it is a table of means instead.

    Parameters
    ----------
    paths : raw logs, see `read_log`; if there are several, the longest hold of each is
        its one position
    settings : ImportSettings
    beside : Beside, optional, a calibrated sensor on the same plate, whose roll and pitch the
        campaigns get

    Returns
    -------
    dict
        For each sensor, by its name ("" if the settings name none), the campaign and a report. The
        campaign has one position for each hold. Its `sigma_force` takes into account that samples
        are not independent: it is the Allan deviation over a typical hold. It is taken along
        gravity only, since a sensor that settles makes the force drift across it.

    Raises
    ------
    InputError
        If a log cannot be read or has no static hold.
    """
    if settings.means:
        return {"": _import_means(paths, settings, beside)}
    chosen = _settings_of_sensors(named_after(settings, paths))
    if beside is not None and (settings.block is not None or len(paths) > 1):
        raise InputError(
            "`reference_log` goes with one log that has a time, not with several files or `block`"
        )
    if settings.block is not None:
        if len(paths) > 1:
            raise InputError(f"a log of blocks (`block`) is one file, not {len(paths)}")
        return _import_blocks(paths, chosen)
    logs = _turned_together({name: _recording(paths, each) for name, each in chosen.items()})
    if len(paths) > 1 and any(_whole_files(log, settings) for log in logs.values()):
        return _import_blocks(paths, chosen)
    detected = find_joint_holds(list(logs.values()), settings, one_each=len(paths) > 1)
    result = {}
    for (name, log), holds in zip(logs.items(), detected, strict=True):
        if beside is None:
            result[name] = campaign_of_holds(log, holds)
            continue
        covered, segments = beside.averaged(log, holds, settings.gravity.value_mps2)
        result[name] = beside.beside(*campaign_of_holds(log, covered), segments, log)
    return result


def _import_means(
    paths: Sequence[LogFile], settings: ImportSettings, beside: Beside | None
) -> tuple[Campaign, ImportReport]:
    if beside is not None:
        raise InputError(
            "a table of means (`means`) has no holds in time: leave out `reference_log`"
        )
    if len(paths) > 1 or settings.sensors:
        raise InputError("a table of means is one file of one sensor")
    if settings.block is not None:
        raise InputError(
            "a table of means (`means`) has a row for each position, no block (`block`)"
        )
    return import_means(paths[0], settings)


def _import_blocks(
    paths: Sequence[LogFile], chosen: Mapping[str, ImportSettings]
) -> dict[str, tuple[Campaign, ImportReport]]:
    """Make each block of so many samples, or each of several files, a position of each sensor."""
    result = {}
    for name, each in chosen.items():
        log = _recording(paths, each)
        named = [*(which for which, _ in each.left_out), *each.joined]
        if "time" not in log.first.places and any(isinstance(which, Span) for which in named):
            raise InputError(f"{log.path}: has no time; name blocks by their numbers, as 13:moved")
        result[name] = campaign_of_holds(log, detected_holds(segment_blocks(log, each), each))
    return result


def _whole_files(log: Recording, settings: ImportSettings) -> bool:
    """Whether files of one position each have no rate, or all are too short to find a hold in."""
    if settings.rate_hz is None and any("time" not in part.places for part in log.parts):
        return True
    window = settings.window_s or usual_window(log)
    least = window + 2 * settings.trim_s + settings.shortest_s
    return all(len(part.samples.time) * log.step < least for part in log.parts)


def find_joint_holds(
    logs: Sequence[Recording], settings: ImportSettings, one_each: bool = False
) -> list[DetectedHolds]:
    """Find the static holds of sensors that were turned together.

    The sensors are on one body. So a hold is where all of them rest, and has the same number for
    all. It begins and ends half a window inside the samples at rest.

    Parameters
    ----------
    logs : sequence of Recording, one for each sensor, of simultaneous samples
    settings : ImportSettings, of which those of the holds count
    one_each : bool, whether the logs have several recordings with one position each: the longest
        hold, which gets the number of the recording

    Returns
    -------
    list of DetectedHolds
        For each sensor; a hold in which one sensor is saturated is missing for that one only.

    Raises
    ------
    InputError
        If a log cannot be read, is shorter than a window, nothing in it is at rest, or the sensor
        was never still.
    """
    width = samples_in(logs[0], settings.window_s or usual_window(logs[0]))
    windows = [Windows(log, width) for log in logs]
    return [detected_holds(each, settings) for each in segment_logs(windows, settings, one_each)]


def import_to(
    folder: str | Path, path: LogFile, settings: ImportSettings
) -> tuple[Campaign, ImportReport]:
    """Import a file of one sensor and write the campaign to a folder; see `import_each`."""
    if settings.sensors:
        raise InputError("sensors: several sensors make several campaigns; only one fits here")
    return import_each({"": Path(folder)}, [path], settings)[""]


def import_each(
    folders: Mapping[str, Path],
    paths: Sequence[LogFile],
    settings: ImportSettings,
    figure: bool = True,
    beside: Beside | None = None,
) -> dict[str, tuple[Campaign, ImportReport]]:
    """Import logs, or a table of means, and write the campaigns to folders.

    With `figure`, the folder of a log also gets segmentation.svg and .png, which show its holds.

    Parameters
    ----------
    folders : mapping of the names of the sensors to folders; "" where the settings name none
    paths, settings, beside : as of `import_sensors`
    figure : bool

    Raises
    ------
    InputError
        If a file cannot be read or makes no campaign, or a folder cannot be written.
    """
    campaigns = import_sensors(paths, settings, beside)
    for name, (campaign, report) in campaigns.items():
        write_campaign(campaign, folders[name])
        if figure and report.holds is not None:
            from accelstudy.campaign.importing.segmentation_figure import render_segmentation

            files = (folders[name] / f"segmentation.{kind}" for kind in ("svg", "png"))
            render_segmentation(report.holds, *files)
    return campaigns


def _settings_of_sensors(settings: ImportSettings) -> dict[str, ImportSettings]:
    """Settings of each sensor, as if it were the only one."""
    if settings.robot is not None:
        raise InputError("robot (`robot_sigma`): its angles go with a table of means (`means`)")
    if not settings.sensors:
        return {"": settings}
    if set(AXES) & set(settings.columns):
        raise InputError("columns: fx, fy and fz stand in sensors (`sensors`) already")
    return {
        name: settings.model_copy(
            update={
                "columns": {**dict(zip(AXES, places, strict=True)), **settings.columns},
                "name": f"{settings.name}-{name}",
                "sensor": settings.sensor or name,
            }
        )
        for name, places in settings.sensors.items()
    }


def _recording(paths: Sequence[LogFile], settings: ImportSettings) -> Recording:
    several = len(paths) > 1
    parts = [read_log(path, settings, untimed=several or bool(settings.block)) for path in paths]
    return Recording([replace(part, lively=not several) for part in parts])


def _turned_together(logs: dict[str, Recording]) -> dict[str, Recording]:
    """Logs of sensors in one file, of which a row that lacks a reading of one is no row of any."""
    result = {}
    for name, log in logs.items():
        parts = []
        for i, part in enumerate(log.parts):
            others = {other: logs[other].parts[i].places for other in logs if other != name}
            beside = {f"{other}: {axis}": at[axis] for other, at in others.items() for axis in AXES}
            parts.append(replace(part, beside=beside))
        result[name] = Recording(parts)
    return result
