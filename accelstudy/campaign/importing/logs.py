"""The way from raw logs to campaigns, stage by stage."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Protocol

import numpy as np

from accelstudy.basics.errors import InputError
from accelstudy.campaign.format import write_campaign
from accelstudy.campaign.header import LogLayout
from accelstudy.campaign.importing.blocks import segment_blocks
from accelstudy.campaign.importing.holds import DetectedHolds, detected_holds
from accelstudy.campaign.importing.making import ImportReport, campaign_of_holds
from accelstudy.campaign.importing.means import import_means
from accelstudy.campaign.importing.opening import open_source
from accelstudy.campaign.importing.recording import (
    AXES,
    Log,
    LogSeries,
    Recording,
    open_log,
    told_by_names,
)
from accelstudy.campaign.importing.segments import Segment, segment_logs
from accelstudy.campaign.importing.settings import (
    ImportSettings,
    Selection,
    named_after,
    parse_selection,
)
from accelstudy.campaign.importing.sources import LogFile, Source
from accelstudy.campaign.importing.windows import Windows, samples_in, threshold_of, usual_window
from accelstudy.campaign.session import Campaign
from accelstudy.files.reading import overlay


class TellsAngles(Protocol):
    """A sensor beside those of the logs, as `accelstudy.campaign.beside` has it."""

    def averaged(
        self, log: Log, holds: DetectedHolds, gravity: float
    ) -> tuple[DetectedHolds, list[Segment]]:
        """Average its log in the holds; without those that it does not cover."""

    def beside(
        self, campaign: Campaign, report: ImportReport, segments: list[Segment], log: Log
    ) -> tuple[Campaign, ImportReport]:
        """Give a campaign roll and pitch of its holds."""


def log_of(path: LogFile, settings: ImportSettings, untimed: bool = False) -> Log:
    """Open a log by the settings; see `open_log` for `untimed`."""
    source = open_source(path, settings.variable, settings.delimiter)
    settings = as_its_format(settings, source)
    return open_layout(path, settings, source, untimed or settings.block is not None)


def open_layout(path: LogFile, layout: LogLayout, source: Source, untimed: bool = False) -> Log:
    """Open a log by its layout; see `open_log` for `untimed`."""
    return open_log(
        path,
        columns=layout.columns,
        time=layout.time,
        rate=layout.rate_hz,
        untimed=untimed,
        unit=layout.unit,
        scale=layout.scale,
        offset=layout.offset,
        time_unit=layout.time_unit,
        variable=layout.variable,
        delimiter=layout.delimiter,
        frame=layout.axes,
        source=source,
    )


def as_its_format(settings: ImportSettings, source: Source) -> ImportSettings:
    """Settings with what the format of a log says, where they do not say it."""
    given = settings.model_dump(exclude_unset=True)
    own = {**told_by_names(source, settings.columns, settings.time)}
    if "rate_hz" in given:
        own.pop("time", None)
    return ImportSettings.model_validate(overlay(own, given))


def import_log(
    path: LogFile, settings: ImportSettings | None = None
) -> tuple[Campaign, ImportReport]:
    """Import a log of one sensor or, if the settings say so, a table of means; see `import_all`."""
    ((campaign, report),) = import_all([path], settings or ImportSettings()).values()
    return campaign, report


def import_all(
    paths: Sequence[LogFile],
    settings: ImportSettings,
    beside: TellsAngles | None = None,
) -> dict[str, tuple[Campaign, ImportReport]]:
    """Import a table of means, or find the static holds of logs; see `import_sensors`."""
    if not settings.means:
        return import_sensors(paths, settings, beside)
    if beside is not None:
        raise InputError(
            "a table of means (--means) has no holds in time: leave out --reference-log"
        )
    if len(paths) > 1 or settings.sensors:
        raise InputError("a table of means is one file of one sensor")
    if settings.block is not None:
        raise InputError(
            "a table of means (--means) has a row for each position, no block (--block)"
        )
    return {"": import_means(paths[0], settings)}


def import_sensors(
    paths: Sequence[LogFile],
    settings: ImportSettings,
    beside: TellsAngles | None = None,
) -> dict[str, tuple[Campaign, ImportReport]]:
    """Find the static holds of the sensors in a log, or in logs of one position each.

    Parameters
    ----------
    paths : raw logs, see `open_log`; if there are several, the longest hold of each is
        its one position
    settings : ImportSettings
    beside : TellsAngles, optional, a calibrated sensor on the same plate, whose roll and pitch the
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
    chosen = _settings_of_sensors(named_after(settings, paths))
    if beside is not None and (settings.block is not None or len(paths) > 1):
        raise InputError(
            "--reference-log goes with one log that has a time, not with several files or --block"
        )
    if settings.block is not None:
        if len(paths) > 1:
            raise InputError(f"a log of blocks (--block) is one file, not {len(paths)}")
        return _import_blocks(paths, chosen)
    logs = _turned_together({name: _recording(paths, each) for name, each in chosen.items()})
    chosen = {name: as_its_format(each, _source(logs[name])) for name, each in chosen.items()}
    if any(isinstance(log, LogSeries) and _whole_files(log, settings) for log in logs.values()):
        return _import_blocks(paths, chosen)
    detected = find_joint_holds(
        list(logs.values()),
        window=settings.window_s,
        threshold=settings.threshold_mps2,
        trim=settings.trim_s,
        shortest=settings.shortest_s,
        full_range=_full_range(settings),
        selection=parse_selection(settings.exclude, settings.join),
        one_each=len(paths) > 1,
    )
    result = {}
    for (name, each), holds in zip(chosen.items(), detected, strict=True):
        if beside is None:
            result[name] = campaign_of_holds(paths, each, logs[name], holds)
            continue
        log, g = _parts(logs[name])[0], each.gravity.value_mps2
        covered, segments = beside.averaged(log, holds, g)
        made = campaign_of_holds(paths, each, log, covered)
        result[name] = beside.beside(*made, segments, log)
    return result


def _import_blocks(
    paths: Sequence[LogFile], chosen: Mapping[str, ImportSettings]
) -> dict[str, tuple[Campaign, ImportReport]]:
    """Make each block of so many samples, or each of several files, a position of each sensor."""
    result = {}
    for name, each in chosen.items():
        log = _recording(paths, each)
        each = as_its_format(each, _source(log))
        selection = parse_selection(each.exclude, each.join)
        if "time" not in _parts(log)[0].places and (selection.spans or selection.joined_spans):
            raise InputError(f"{log.path}: has no time; name blocks by their numbers, as 13:moved")
        windows, threshold, blocks = segment_blocks(
            log, each.block, each.threshold_mps2, _full_range(each)
        )
        window = windows.width * log.step
        holds = detected_holds(windows, threshold, blocks, selection, window, 0.0, 0.0)
        result[name] = campaign_of_holds(paths, each, log, holds)
    return result


def _whole_files(log: LogSeries, settings: ImportSettings) -> bool:
    """Whether files of one position each have no rate, or all are too short to find a hold in."""
    if settings.rate_hz is None and any("time" not in part.places for part in log.parts):
        return True
    window = settings.window_s or usual_window(log)
    least = window + 2 * settings.trim_s + settings.shortest_s
    return all(len(part.samples.time) * log.step < least for part in log.parts)


def find_joint_holds(
    logs: Sequence[Recording],
    *,
    window: float | None = None,
    threshold: float | None = None,
    trim: float = 0.2,
    shortest: float = 1.0,
    full_range: float = np.inf,
    selection: Selection | None = None,
    one_each: bool = False,
) -> list[DetectedHolds]:
    """Find the static holds of sensors that were turned together.

    The sensors are on one body. So a hold is where all of them rest, and has the same number for
    all.

    Parameters
    ----------
    logs : sequence of Recording, one for each sensor, of simultaneous samples
    window : float, s, length of the sliding window, see `usual_window`; a hold begins and ends half
        a window inside the samples at rest
    threshold : float, m/s², standard deviation of a window up to which it is at rest; chosen from
        the data of each sensor if omitted
    trim : float, s, cut off in addition at both ends of a hold
    shortest : float, s, least length of what is left
    full_range : float, m/s², the sensors measure ± this
    selection : Selection, holds that a person leaves out or joins
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
    window = window or usual_window(logs[0])
    width = samples_in(logs[0], window)
    windows = [Windows(log, width) for log in logs]
    thresholds = [threshold_of(each, threshold) for each in windows]
    segmentations = segment_logs(windows, thresholds, trim, shortest, full_range, one_each)
    selection = selection or Selection()
    return [
        detected_holds(*each, selection, window, trim, shortest)
        for each in zip(windows, thresholds, segmentations, strict=True)
    ]


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
    beside: TellsAngles | None = None,
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
    campaigns = import_all(paths, settings, beside)
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
        raise InputError("robot (--robot-sigma): its angles go with a table of means (--means)")
    if not settings.sensors:
        return {"": settings}
    if set(AXES) & set(settings.columns):
        raise InputError("columns: fx, fy and fz stand in sensors (--sensor) already")
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


def _recording(paths: Sequence[LogFile], settings: ImportSettings) -> Log | LogSeries:
    parts = [log_of(path, settings, untimed=len(paths) > 1) for path in paths]
    if len(parts) == 1:
        return parts[0]
    return LogSeries([replace(part, lively=False) for part in parts])


def _turned_together(logs: dict[str, Log | LogSeries]) -> dict[str, Log | LogSeries]:
    """Logs of sensors in one file, of which a row that lacks a reading of one is no row of any."""
    result = dict(logs)
    for name, log in logs.items() if len(logs) > 1 else ():
        parts = []
        for i, part in enumerate(_parts(log)):
            others = {other: _parts(logs[other])[i].places for other in logs if other != name}
            beside = {f"{other}: {axis}": at[axis] for other, at in others.items() for axis in AXES}
            parts.append(replace(part, beside=beside))
        result[name] = LogSeries(parts) if isinstance(log, LogSeries) else parts[0]
    return result


def _parts(log: Log | LogSeries) -> Sequence[Log]:
    return log.parts if isinstance(log, LogSeries) else [log]


def _source(log: Log | LogSeries) -> Source:
    return _parts(log)[0].source


def _full_range(settings: ImportSettings) -> float:
    """Range of the sensor; infinite if it is unknown, or if the offset of counts is."""
    if settings.range_mps2 is None or (settings.unit == "counts" and settings.offset is None):
        return np.inf
    return settings.range_mps2
