"""From raw logs to campaigns, with all that a user should know of the import."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.bounds import SIGMA_FORCE
from accelstudy.basics.errors import InputError
from accelstudy.basics.units import UNITS, display_unit, to_display
from accelstudy.campaign.gross_errors.recognition import check_plausible
from accelstudy.campaign.header import LogLayout, Place
from accelstudy.campaign.importing.columns import SDS, thermometers
from accelstudy.campaign.importing.holds import Holds, find_blocks, find_holds
from accelstudy.campaign.importing.log import AnyLog, Log, open_log
from accelstudy.campaign.importing.noise import sigma_text, steps_text
from accelstudy.campaign.importing.recording import Recording
from accelstudy.campaign.importing.settings import ImportSettings
from accelstudy.campaign.importing.windows import usual_window
from accelstudy.campaign.session import Campaign

if TYPE_CHECKING:
    from accelstudy.campaign.reference_log import ReferenceLog

Array = NDArray[np.float64]
Imported = tuple[Campaign, Holds | None]
"""A campaign, and the holds that it was made of; None of a table of means."""

MAX_ACROSS_RATIO = 1.5
"""Noise across gravity, as a multiple of that along it, from which on a warning says that the
sensor turns within its holds."""
ANGLES = ("roll", "pitch", "yaw")
MEANS = ("n_samples", *SDS, "temperature", "vibration", *ANGLES)
"""Columns that a table of means may have, besides its forces and its time."""
_YEARS = 1e8  # s; no session lasts for years, so later times count from 1970
MIN_ROUNDING_RATIO = 0.1
"""Sigma of rounding over that of noise, from which on the resolution is told and kept."""


def import_log(
    log: AnyLog | Sequence[AnyLog],
    settings: ImportSettings | None = None,
    reference: ReferenceLog | None = None,
) -> Imported:
    """Find the static holds of the sensor in a log, or in logs of one position each.

    If the settings say so, it is a table of means instead.

    Parameters
    ----------
    log : raw logs, see `open_log`; if there are several, the longest hold of each is its one
        position
    settings : ImportSettings
    reference : ReferenceLog, optional, of a calibrated sensor on the same plate, whose roll and
        pitch the campaign gets

    Returns
    -------
    campaign : Campaign
        It has one position for each hold. Its `sigma_force` takes into account that samples are
        not independent: it is the Allan deviation over a typical hold. It is taken along gravity
        only, since a sensor that settles makes the force drift across it. Its `notes` and
        `warnings` tell of the import.
    holds : Holds, or None of a table of means

    Raises
    ------
    InputError
        If a log cannot be read or has no static hold.
    """
    logs = cast(Sequence[AnyLog], log if isinstance(log, list | tuple) else [log])
    settings, several = settings or ImportSettings(), len(logs) > 1
    _check_kinds(len(logs), settings, reference)
    if settings.means:
        wanted = [*(["time"] if settings.time is not None else []), *MEANS]
        means = open_log(logs[0], settings.layout, wanted=wanted, untimed=True)
        return _campaign_of_means(means, settings.with_layout(means.layout)), None
    untimed = several or settings.block is not None
    recording = Recording([open_log(one, settings.layout, untimed=untimed) for one in logs])
    settings = settings.with_layout(recording.first.layout)
    if settings.block is not None or (several and _whole_files(recording, settings)):
        holds = find_blocks(recording, settings)
    else:
        holds = find_holds(recording, settings, one_each=several)
    return _campaign_of_holds(holds, settings, reference)


# --- Kinds of logs -------------------------------------------------------------------------------


def _check_kinds(files: int, settings: ImportSettings, reference: ReferenceLog | None) -> None:
    """Check that means, blocks, several files and a reference go together."""
    means, block = settings.means, settings.block is not None
    for wrong, text in (
        (means and reference, "a table of means (`means`) has no holds in time: leave out "
         "`reference_log`"),
        (means and files > 1, "a table of means is one file of one sensor"),
        (means and block, "a table of means (`means`) has a row for each position, no block "
         "(`block`)"),
        (settings.robot and not means, "robot (`robot_sigma`): its angles go with a table of means "
         "(`means`)"),
        (reference and (block or files > 1), "`reference_log` goes with one log that has a time, "
         "not with several files or `block`"),
        (block and files > 1, f"a log of blocks (`block`) is one file, not {files}"),
    ):  # fmt: skip
        if wrong:
            raise InputError(text)


def _whole_files(log: Recording, settings: ImportSettings) -> bool:
    """Whether files of one position each have no rate, or all are too short to find a hold in."""
    if not all(part.timed for part in log.parts):
        return True
    window = settings.window_s or usual_window(log)
    return max(log.lengths) * log.step < window + 2 * settings.trim_s + settings.shortest_s


# --- A table of means ----------------------------------------------------------------------------


def _campaign_of_means(log: Log, settings: ImportSettings) -> Campaign:
    """Campaign of a table of means, a row for each position; a MATLAB array may have columns.

    With `robot` roll, pitch and perhaps yaw are the robot's angles, in the convention of the frame.
    The campaign has a sigma if the table has numbers of samples and their standard deviations: that
    of white noise, since a table of means does not say more.
    """
    robot, angles = settings.robot, [key for key in ANGLES if key in log.conditions]
    for missing in (key for key in ANGLES[:2] if robot and key not in angles):
        raise InputError(
            f"{log.path}: which column is the robot's {missing}? Name it by `columns` {missing}=..."
        )
    rows, frame, warnings = log.samples, log.layout.axes, []
    if angles and robot is None:
        warnings.append(
            f"columns {', '.join(angles)} are left out; `robot_sigma` takes them for the robot's"
        )
        rows = rows.drop(columns=angles)
    if not len(rows):
        raise InputError(f"{log.path}: no row of numbers")
    for row in np.flatnonzero(rows.isna().any(axis=1)).tolist():
        key = next(key for key in log.lacking(row) if key in rows)
        raise InputError(f"{log.path}: {log.describe(row, key)}, not a usable number")
    columns: dict[str, Any] = {
        key: rows[key].to_numpy() for key in ("temperature", "vibration") if key in rows
    }
    sigma = None
    if "time" in log.places:
        columns["time"] = rows["time"].to_numpy() + (log.start if abs(log.start) < _YEARS else 0.0)
    if "n_samples" in rows:
        columns["n_samples"] = n_samples = np.round(rows["n_samples"].to_numpy()).astype(int)
        if np.any(n_samples < 1):
            raise InputError(f"{log.path}: column n_samples: must be positive")
    if {*SDS} <= {*rows}:
        sd = frame.to_frd_order(rows[[*SDS]].to_numpy() * abs(log.layout.conversion.scale))
        columns["sd"] = sd
        if np.any(sd < 0):
            raise InputError(f"{log.path}: columns {', '.join(SDS)}: must not be negative")
        if "n_samples" in columns and np.any(sd > 0):
            sigma = float(np.sqrt(np.mean(sd**2 / n_samples[:, None])))
            warnings.append("sigma of a mean assumes white noise; coloured noise makes it larger")
    if robot is not None:
        turned = rows[angles].to_numpy() * UNITS["rad"][robot.unit] * frame.signs[: len(angles)]
        columns["angles"] = turned[:, :2]
        if "yaw" in angles:
            columns["yaw"] = turned[:, 2]
    # Logs of the sensor have the unit and the axes of the table, but not its columns.
    shared = log.layout.model_dump(include={"unit", "scale", "offset", "frame"}, exclude_none=True)
    header = _header(log, settings, LogLayout.model_validate(shared))
    header["sensor_noise"] = None if sigma is None else {"sigma_mps2": sigma}
    header["robot"] = robot and {"angle_sigma_mgon": robot.angle_sigma_mgon}
    campaign = Campaign.of(header, forces=log.forces, **columns)
    told = "unknown" if sigma is None else sigma_text(sigma)
    notes = (f"{len(rows)} positions; sigma of a mean: {told}",)
    return _checked(replace(campaign, notes=notes, warnings=tuple(warnings)), log, settings)


# --- The campaign of holds ------------------------------------------------------------------------


def _campaign_of_holds(
    holds: Holds, settings: ImportSettings, reference: ReferenceLog | None
) -> Imported:
    """Make the campaign of the holds of one sensor; its notes say how the log was read.

    Holds that the reference does not cover are neither in the campaign nor in the holds.
    """
    log, note = holds.log, ""
    columns: dict[str, Any] = {}
    sensor = None
    gravity = settings.gravity.value_mps2
    settings, offset = _with_offset(settings, holds)
    if reference is not None:
        holds, columns["angles"], sensor, note = reference.angles_for(holds, offset, gravity)
    table, noise = holds.table, holds.noise
    rounded = noise.rounding > MIN_ROUNDING_RATIO * noise.accuracy.allan
    timed = holds.size is None or "time" in log.first.places
    if timed and (len(log.parts) == 1 or log.timed):
        columns["time"] = ((table["t0"] + table["t1"]) / 2).to_numpy()
    known = [name for name in log.conditions if table[name].notna().all()]
    columns |= {name: table[name].to_numpy() for name in known}
    layout = _layout_of(settings, log.first)
    header = _header(log.first, settings, layout, several=len(log.parts) > 1)
    stated = {"sigma_mps2": noise.sigma, "degrees_of_freedom": max(1.0, float(round(noise.dof)))}
    header |= {
        # Readings that never change within a hold do not show their noise.
        "sensor_noise": stated if noise.sigma >= SIGMA_FORCE.least else None,
        "resolution_mps2": holds.windows.steps.tolist() if rounded else None,
        "reference": sensor,
    }
    campaign = Campaign.of(
        header,
        positions=table.index.to_numpy(),
        forces=holds.means - offset,
        n_samples=table["n"].to_numpy(),
        sd=table[[*SDS]].to_numpy(),
        **columns,
    )
    campaign = replace(
        campaign,
        notes=tuple(_notes(holds, settings, bool(offset.any()), note, rounded)),
        warnings=tuple(_warnings(holds, gravity)),
    )
    return _checked(campaign, log.first, settings).without(holds.left_out), holds


def _with_offset(settings: ImportSettings, holds: Holds) -> tuple[ImportSettings, Array]:
    """Offset of counts, from the positions, unless it is zero apart from the sensor's bias.

    Returns
    -------
    settings : ImportSettings, with the offset
    offset : (3,) array, m/s², in forward, right, down; zero if the settings stay
    """
    center, wanted = holds.noise.center, settings.unit == "counts" and settings.offset is None
    if not (wanted and holds.noise.directed and np.linalg.norm(center) > holds.radius / 2):
        return settings, np.zeros(3)
    scale = holds.log.first.layout.conversion.scale
    offset = np.round(settings.axes.from_frd(center) / scale)
    settings = settings.model_copy(update={"offset": offset.tolist()})
    return settings, settings.axes.to_frd(offset * scale)


def _header(
    log: Log, settings: ImportSettings, layout: LogLayout, several: bool = False
) -> dict[str, Any]:
    """Header of a campaign, as the settings say.

    Without a name it has that of the file without endings, or of the folder of several files.
    """
    name = Path(log.path.stem).stem if log.path.suffix == ".gz" else log.path.stem
    if several:
        name = log.path.absolute().parent.name or name
    nominal = None
    if settings.unit == "counts":
        frame, conversion = settings.axes, settings.conversion
        scale = frame.to_frd_order(conversion.scale) * frame.signs
        offset = frame.to_frd_order(conversion.offset)
        nominal = {"scale": scale.tolist(), "offset": offset.tolist()}
    return {
        "name": settings.name or name,
        "sensor": settings.sensor,
        "unit": settings.unit,
        "nominal": nominal,
        "gravity": settings.gravity.model_dump(),
        "range_mps2": settings.range_mps2,
        "log": layout,
    }


def _checked(campaign: Campaign, log: Log, settings: ImportSettings) -> Campaign:
    """Refuse forces nowhere near gravity and angles in another unit; add what is doubtful."""
    angle_unit = "gon" if settings.robot is None else settings.robot.unit
    doubts = check_plausible(campaign, f"{log.path}", angle_unit)
    return replace(campaign, warnings=(*campaign.warnings, *doubts))


def _layout_of(settings: ImportSettings, log: Log) -> LogLayout:
    """How a log was read, with all its columns, by name if it has names."""

    def column(key: str) -> Place:
        place = log.places[key]
        name = log.source.names[place]
        return name if log.source.named and name and log.source.names.count(name) == 1 else place

    layout = settings.model_dump(include={*LogLayout.model_fields})
    time = column("time") if "time" in log.places else None
    columns = {key: column(key) for key in log.places if key not in ("time", "nanoseconds")}
    return LogLayout.model_validate({**layout, "columns": columns, "time": time})


# --- What is said of it --------------------------------------------------------------------------


def _lines(*given: Any, **more: Any) -> list[str]:
    from accelstudy.pages import render_lines  # not needed where nothing is said

    return render_lines("campaign/importing/logs.txt.j2", *given, **more)


def _notes(
    holds: Holds, settings: ImportSettings, offset: bool, reference: str, rounded: bool
) -> list[str]:
    """How a log was read, and what was found in it, a line each."""
    log = holds.log.first
    names = [name if log.source.named else f"column {name}" for name in log.source.names]
    time = holds.log.time[holds.windows.centred]
    return _lines(
        "notes",
        holds,
        settings,
        used={"time": "", "temperature": ""} | {key: names[i] for key, i in log.places.items()},
        unused=[name for place, name in enumerate(names) if place not in log.places.values()],
        heat=[names[place] for place in thermometers(log.source.names)],
        offset=offset,
        reference=reference,
        seconds=time[-1] - time[0],
        steps=steps_text(holds.windows.steps) if rounded else "",
        sigma_text=sigma_text,
    )


def _warnings(holds: Holds, gravity: float) -> list[str]:
    """What the user should know of a log and its holds, a line each."""
    noise, parts, index = holds.noise, holds.log.parts, holds.table.index
    turned = ""
    if noise.across > MAX_ACROSS_RATIO * noise.accuracy.allan:
        turned = f"{to_display(noise.across / gravity, 'rad'):.0f} {display_unit('rad')}"
    unknown = {name: holds.table[name].isna() for name in holds.log.conditions}
    return _lines(
        "warnings",
        holds,
        holds.log,
        missing=[(i, part) for i, part in enumerate(parts, 1) if parts[1:] and i not in index],
        turned=turned,
        lost=[(index[lost][0], name) for name, lost in unknown.items() if lost.any()],
        sigma_text=sigma_text,
    )
