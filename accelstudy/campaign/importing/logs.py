"""The way from raw logs to campaigns, stage by stage."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from accelstudy.basics.errors import InputError
from accelstudy.campaign.format import write_campaign
from accelstudy.campaign.importing.detection import Holds, find_blocks, find_holds
from accelstudy.campaign.importing.making import campaign_of_holds
from accelstudy.campaign.importing.means import import_means
from accelstudy.campaign.importing.recording import AXES, Recording, read_log
from accelstudy.campaign.importing.settings import ImportSettings, named_after
from accelstudy.campaign.importing.sources import LogFile
from accelstudy.campaign.importing.windows import usual_window
from accelstudy.campaign.session import Campaign

if TYPE_CHECKING:
    from accelstudy.campaign.reference_log import ReferenceLog


def import_log(
    path: LogFile, settings: ImportSettings | None = None
) -> tuple[Campaign, Holds | None]:
    """Import a log of one sensor or a table of means; see `import_sensors`."""
    return import_sensors([path], settings or ImportSettings())[""]


def import_sensors(
    paths: Sequence[LogFile], settings: ImportSettings, beside: ReferenceLog | None = None
) -> dict[str, tuple[Campaign, Holds | None]]:
    """Find the static holds of the sensors in a log, or in logs of one position each.

    If the settings say so, it is a table of means instead.

    Parameters
    ----------
    paths : raw logs, see `read_log`; if there are several, the longest hold of each is
        its one position
    settings : ImportSettings
    beside : ReferenceLog, optional, of a calibrated sensor on the same plate, whose roll and pitch
        the campaigns get

    Returns
    -------
    dict
        For each sensor, by its name ("" if the settings name none), the campaign and its holds,
        None of a table of means. The campaign has one position for each hold. Its `sigma_force`
        takes into account that samples are not independent: it is the Allan deviation over a
        typical hold. It is taken along gravity only, since a sensor that settles makes the force
        drift across it. Its `notes` and `warnings` tell of the import.

    Raises
    ------
    InputError
        If a log cannot be read or has no static hold.
    """
    several, block = len(paths) > 1, settings.block
    if settings.means:
        if beside is not None:
            raise InputError(
                "a table of means (`means`) has no holds in time: leave out `reference_log`"
            )
        if several or settings.sensors:
            raise InputError("a table of means is one file of one sensor")
        if block is not None:
            raise InputError(
                "a table of means (`means`) has a row for each position, no block (`block`)"
            )
        return {"": (import_means(paths[0], settings), None)}
    of_sensors = _settings_of_sensors(named_after(settings, paths))
    if beside is not None and (block is not None or several):
        raise InputError(
            "`reference_log` goes with one log that has a time, not with several files or `block`"
        )
    if block is not None and several:
        raise InputError(f"a log of blocks (`block`) is one file, not {len(paths)}")
    untimed = several or block is not None
    parts = {
        name: [read_log(path, each, untimed=untimed) for path in paths]
        for name, each in of_sensors.items()
    }
    logs = {
        name: Recording(own, [parts[other] for other in parts if other != name])
        for name, own in parts.items()
    }
    if block is not None or (several and any(_whole_files(log, settings) for log in logs.values())):
        found = [find_blocks(log, of_sensors[name]) for name, log in logs.items()]
    else:
        found = find_holds([*logs.values()], settings, one_each=several)
    return {
        name: campaign_of_holds(log, holds, beside)
        for (name, log), holds in zip(logs.items(), found, strict=True)
    }


def _whole_files(log: Recording, settings: ImportSettings) -> bool:
    """Whether files of one position each have no rate, or all are too short to find a hold in."""
    if settings.rate_hz is None and any("time" not in part.places for part in log.parts):
        return True
    window = settings.window_s or usual_window(log)
    least = window + 2 * settings.trim_s + settings.shortest_s
    return bool(np.all(np.bincount(log.part) * log.step < least))


def import_to(
    folder: str | Path, path: LogFile, settings: ImportSettings
) -> tuple[Campaign, Holds | None]:
    """Import a file of one sensor and write the campaign to a folder; see `import_each`."""
    if settings.sensors:
        raise InputError("sensors: several sensors make several campaigns; only one fits here")
    return import_each({"": Path(folder)}, [path], settings)[""]


def import_each(
    folders: Mapping[str, Path],
    paths: Sequence[LogFile],
    settings: ImportSettings,
    figure: bool = True,
    beside: ReferenceLog | None = None,
) -> dict[str, tuple[Campaign, Holds | None]]:
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
    for name, (campaign, holds) in campaigns.items():
        write_campaign(campaign, folders[name])
        if figure and holds is not None:
            # Matplotlib takes longer to import than a log of usual length to read.
            from accelstudy.campaign.importing import segmentation_figure
            from accelstudy.drawing.saving import save_all
            from accelstudy.drawing.style import DPI

            offset = holds.means[0] - campaign.whole.forces[0]
            draw = partial(segmentation_figure.draw_segmentation, holds, offset)
            save_all({"segmentation": draw}, folders[name], DPI)
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
