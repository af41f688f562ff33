"""From raw logs to campaigns."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.errors import InputError
from accelstudy.basics.units import display_unit, to_display
from accelstudy.campaign.format import write_campaign
from accelstudy.campaign.importing.allan import MeanAccuracy, accuracy_of_mean
from accelstudy.campaign.importing.columns import AXES
from accelstudy.campaign.importing.detection import DetectedHolds, find_joint_holds
from accelstudy.campaign.importing.means import import_means
from accelstudy.campaign.importing.recording import Log, LogSeries, Recording, open_log
from accelstudy.campaign.importing.settings import (
    ImportReport,
    ImportSettings,
    default_name,
    far_from_gravity,
    imported_campaign,
    layout_of,
    shown,
)
from accelstudy.campaign.session import Campaign
from accelstudy.sensors.conversion import conversion_of

Array = NDArray[np.float64]

TURNING = 1.5
"""Noise across gravity, as a multiple of that along it, from which on a warning says that the
sensor turns within its holds."""


def log_of(path: str | Path, settings: ImportSettings) -> Log:
    """Open a log by the settings."""
    return open_log(
        path,
        columns=settings.columns,
        time=settings.time,
        rate=settings.rate_hz,
        unit=settings.unit,
        scale=settings.scale,
        offset=settings.offset,
        time_unit=settings.time_unit,
        variable=settings.variable,
        frame=settings.axes,
    )


def import_log(
    path: str | Path, settings: ImportSettings | None = None
) -> tuple[Campaign, ImportReport]:
    """Import a log of one sensor or, if the settings say so, a table of means; see `import_all`."""
    ((campaign, report),) = import_all([path], settings or ImportSettings()).values()
    return campaign, report


def import_all(
    paths: Sequence[str | Path], settings: ImportSettings
) -> dict[str, tuple[Campaign, ImportReport]]:
    """Import a table of means, or find the static holds of logs; see `import_sensors`."""
    if not settings.means:
        return import_sensors(paths, settings)
    if len(paths) > 1 or settings.sensors:
        raise InputError("a table of means is one file of one sensor")
    return {"": import_means(paths[0], settings)}


def import_sensors(
    paths: Sequence[str | Path], settings: ImportSettings
) -> dict[str, tuple[Campaign, ImportReport]]:
    """Find the static holds of the sensors in a log, or in logs of one position each.

    Parameters
    ----------
    paths : files with raw logs, see `open_log`; if there are several, the longest hold of each is
        its one position
    settings : ImportSettings

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
    chosen = _settings_of_sensors(settings, default_name(paths))
    logs = {name: _recording(paths, each) for name, each in chosen.items()}
    detected = find_joint_holds(
        list(logs.values()),
        window=settings.window_s,
        threshold=settings.threshold_mps2,
        trim=settings.trim_s,
        shortest=settings.shortest_s,
        full_range=_full_range(settings),
        selection=settings.selection,
        one_each=len(paths) > 1,
    )
    return {
        name: _campaign(paths, each, logs[name], holds)
        for (name, each), holds in zip(chosen.items(), detected, strict=True)
    }


def import_to(
    folder: str | Path, path: str | Path, settings: ImportSettings, figure: bool = True
) -> tuple[Campaign, ImportReport]:
    """Import a file of one sensor and write the campaign to a folder; see `import_each`."""
    if settings.sensors:
        raise InputError("sensors: several sensors make several campaigns; only one fits here")
    return import_each({"": Path(folder)}, [path], settings, figure)[""]


def import_each(
    folders: Mapping[str, Path],
    paths: Sequence[str | Path],
    settings: ImportSettings,
    figure: bool = True,
) -> dict[str, tuple[Campaign, ImportReport]]:
    """Import logs, or a table of means, and write the campaigns to folders.

    With `figure`, the folder of a log also gets segmentation.svg and .png, which show its holds.

    Parameters
    ----------
    folders : mapping of the names of the sensors to folders; "" where the settings name none
    paths, settings : as of `import_sensors`
    figure : bool

    Raises
    ------
    InputError
        If a file cannot be read or makes no campaign, or a folder cannot be written.
    """
    campaigns = import_all(paths, settings)
    for name, (campaign, report) in campaigns.items():
        write_campaign(campaign, folders[name])
        if figure and report.holds is not None:
            from accelstudy.campaign.importing.segmentation_figure import render_segmentation

            files = (folders[name] / f"segmentation.{kind}" for kind in ("svg", "png"))
            render_segmentation(report.holds, *files)
    return campaigns


def _settings_of_sensors(settings: ImportSettings, default: str) -> dict[str, ImportSettings]:
    """Settings of each sensor, as if it were the only one; `default` names a campaign."""
    if settings.robot is not None:
        raise InputError("robot: its angles go with a table of means (--means)")
    if not settings.sensors:
        return {"": settings}
    if set(AXES) & set(settings.columns):
        raise InputError("columns: fx, fy and fz stand in sensors (--sensor) already")
    return {
        name: settings.model_copy(
            update={
                "columns": {**dict(zip(AXES, places, strict=True)), **settings.columns},
                "name": f"{settings.name or default}-{name}",
                "sensor": settings.sensor or name,
            }
        )
        for name, places in settings.sensors.items()
    }


def _recording(paths: Sequence[str | Path], settings: ImportSettings) -> Recording:
    parts = [log_of(path, settings) for path in paths]
    if len(parts) == 1:
        return parts[0]
    return LogSeries([replace(part, lively=False) for part in parts])


def _campaign(
    paths: Sequence[str | Path], settings: ImportSettings, log: Recording, holds: DetectedHolds
) -> tuple[Campaign, ImportReport]:
    """Make the campaign of the holds of one sensor, and its report."""
    accuracy, warnings = _accuracy(holds, settings.gravity.value_mps2)
    notes = [] if settings.frame == "frd" else [_frame_note(settings)]
    forces = holds.mean
    if settings.unit == "counts" and settings.offset is None:
        settings, offset, note = _with_offset(settings, holds)
        forces, holds = forces - offset, replace(holds, envelope=holds.envelope.less(offset))
        notes += note
    first, time = log, (holds.t0 + holds.t1) / 2
    if isinstance(log, LogSeries):
        first = log.parts[0]
        notes.append(
            f"files: {len(log.parts)}, with the longest hold of each as one position; what is "
            "before and after it does not count"
            + ("" if log.timed else "; the times of the files do not tell that of a position")
        )
        missing = [i for i in range(1, len(paths) + 1) if i not in holds.segments]
        warnings += [f"{paths[i - 1]}: no static hold; position {i} is missing" for i in missing]
    assert isinstance(first, Log)
    columns = {}
    for name, values in holds.conditions.items():
        if np.isfinite(values).all():
            columns[name] = values
        else:
            hold = holds.number[np.argmin(np.isfinite(values))]
            warnings.append(f"hold {hold} has no {name}; the column is left out")
    warnings += far_from_gravity(settings, forces)
    campaign = imported_campaign(
        paths,
        settings,
        forces,
        positions=holds.number,
        sigma_force=accuracy.allan,
        n_samples=holds.n_samples,
        sd=holds.of_each("sd"),
        slope=holds.of_each("slope"),
        sd_slope=holds.slope_sigmas(),
        time=None if isinstance(log, LogSeries) and not log.timed else time,
        log=layout_of(settings, first.source, first.places),
        warnings=tuple(warnings),
        **columns,
    ).without(holds.left_out)
    report = ImportReport(
        len(holds), accuracy, float(accuracy.white), holds, tuple(notes), tuple(warnings)
    )
    return campaign, report


def _accuracy(holds: DetectedHolds, gravity: float) -> tuple[MeanAccuracy, list[str]]:
    """How well the mean over a typical hold is known, and warnings about the holds."""
    noise, typical = holds.noise, int(np.median(holds.n_samples[holds.used]))

    def accuracy_in(channels: slice) -> MeanAccuracy:
        sd = float(np.sqrt(np.mean(noise.sd[channels] ** 2)))
        return accuracy_of_mean(noise.allan.channels(channels), typical * holds.step, sd, typical)

    accuracy = accuracy_in(noise.of_sensor)
    warnings = list(holds.warnings)
    if not noise.directed:
        warnings.append(
            "the norms of the means differ too much for specific forces (is an offset missing?); "
            "sigma is taken over all axes"
        )
    elif (across := accuracy_in(slice(1, 3)).allan) > TURNING * accuracy.allan:
        turned = f"{to_display(across / gravity, 'rad'):.0f} {display_unit('rad')}"
        warnings.append(
            f"across gravity the means vary by {shown(across)}, more than along it: the sensor "
            f"turns by some {turned} within holds"
        )
    if accuracy.slope is not None:
        warnings.append(
            f"the Allan deviation is known up to {accuracy.tau:.2g} s, and extrapolated from there "
            f"to the {accuracy.duration:.2g} s of a hold with slope {accuracy.slope:.2f}"
        )
    return accuracy, warnings


def _with_offset(
    settings: ImportSettings, holds: DetectedHolds
) -> tuple[ImportSettings, Array, list[str]]:
    """Offset of counts, from the positions, unless it is zero apart from the sensor's bias.

    Returns
    -------
    settings : ImportSettings, with the offset
    offset : (3,) array, m/s², in forward, right, down; zero if the settings stay
    notes : list of str
    """
    noise, frame = holds.noise, settings.axes
    if not (noise.directed and np.linalg.norm(noise.center) > holds.radius / 2):
        return settings, np.zeros(3), []
    scale = conversion_of("counts", settings.scale).scale
    offset = np.round(frame.from_frd(noise.center) / scale)
    note = (
        f"offset: {', '.join(f'{x:.0f}' for x in offset)} counts, from the positions, as none was "
        "given"
    )
    settings = settings.model_copy(update={"offset": offset.tolist()})
    return settings, frame.to_frd(offset * scale), [note]


def _full_range(settings: ImportSettings) -> float:
    """Range of the sensor; infinite if it is unknown, or if the offset of counts is."""
    if settings.range_mps2 is None or (settings.unit == "counts" and settings.offset is None):
        return np.inf
    return settings.range_mps2


def _frame_note(settings: ImportSettings) -> str:
    return f"axes: {settings.frame} in the log, turned to frd (forward, right, down) here"
