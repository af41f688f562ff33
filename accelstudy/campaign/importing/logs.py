"""From raw logs to campaigns, with all that a user should know of the import."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.errors import InputError
from accelstudy.basics.units import MGON, UNITS, display_unit, to_display
from accelstudy.campaign.format import write_campaign
from accelstudy.campaign.gross_errors.recognition import check_plausible
from accelstudy.campaign.header import LogLayout, Place
from accelstudy.campaign.importing.detection import Holds, find_blocks, find_holds
from accelstudy.campaign.importing.formats import open_source
from accelstudy.campaign.importing.names import thermometers
from accelstudy.campaign.importing.noise import sigma_text, steps_text
from accelstudy.campaign.importing.recording import SDS, Recording, SensorLog, read_log
from accelstudy.campaign.importing.settings import ImportSettings, named_after
from accelstudy.campaign.importing.sources import LogFile, Source
from accelstudy.campaign.importing.windows import usual_window
from accelstudy.campaign.session import Campaign
from accelstudy.sensors.conversion import Conversion, conversion_of

if TYPE_CHECKING:
    from accelstudy.campaign.reference_log import ReferenceLog

Array = NDArray[np.float64]
Imported = tuple[Campaign, Holds | None]
"""A campaign, and the holds that it was made of; None of a table of means."""

TEMPLATE = "campaign/importing/logs.txt.j2"
MAX_ACROSS_RATIO = 1.5
"""Noise across gravity, as a multiple of that along it, from which on a warning says that the
sensor turns within its holds."""
ANGLES = ("roll", "pitch")
MEANS = ("n_samples", *SDS, "temperature", "vibration", *ANGLES, "yaw")
"""Columns that a table of means may have, besides its forces and its time."""
_YEARS = 1e8  # s; no session lasts for years, so later times count from 1970
MIN_ROUNDING_RATIO = 0.1
"""Sigma of rounding over that of noise, from which on the resolution is told and kept."""


def import_log(
    path: LogFile | Sequence[LogFile],
    settings: ImportSettings | None = None,
    reference: ReferenceLog | None = None,
) -> Imported:
    """Find the static holds of the sensor in a log, or in logs of one position each.

    If the settings say so, it is a table of means instead.

    Parameters
    ----------
    path : raw logs, see `read_log`; if there are several, the longest hold of each is
        its one position
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
    paths = [path] if isinstance(path, LogFile) else path
    settings, several = settings or ImportSettings(), len(paths) > 1
    _check_kinds(len(paths), settings, reference)
    settings = named_after(settings, paths)
    files = [open_source(path, settings.variable) for path in paths]
    if settings.means:
        return _campaign_of_means(files[0], settings), None
    untimed = several or settings.block is not None
    log = Recording([read_log(file, settings, untimed=untimed) for file in files])
    if settings.block is not None or (several and _whole_files(log, settings)):
        holds = find_blocks(log, settings)
    else:
        holds = find_holds(log, settings, one_each=several)
    return _campaign_of_holds(holds, reference)


def write_imported(
    campaign: Campaign, holds: Holds | None, folder: Path, figure: bool = True
) -> None:
    """Write a campaign and, of a log, a figure that shows its holds: segmentation.svg and .png."""
    write_campaign(campaign, folder)
    if figure and holds is not None:
        # Matplotlib takes longer to import than a log of usual length to read.
        from accelstudy.campaign.importing import segmentation_figure
        from accelstudy.drawing.saving import save_all

        offset = holds.means[0] - campaign.with_left_out.forces[0]
        draw = {"segmentation": lambda: segmentation_figure.draw_segmentation(holds, offset)}
        save_all(draw, folder)


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
    if settings.rate_hz is None and any("time" not in part.places for part in log.parts):
        return True
    window = settings.window_s or usual_window(log)
    least = window + 2 * settings.trim_s + settings.shortest_s
    return max(log.lengths) * log.step < least


# --- A table of means ----------------------------------------------------------------------------


def _campaign_of_means(file: Source, settings: ImportSettings) -> Campaign:
    """Campaign of a table of means, a row for each position; a MATLAB array may have columns.

    With `robot` roll, pitch and perhaps yaw are the robot's angles, in the convention of the frame.
    The campaign has a sigma if the table has numbers of samples and their standard deviations: that
    of white noise, since a table of means does not say more.
    """
    wanted = [*(["time"] if settings.time is not None else []), *MEANS]
    log = read_log(file, settings, conditions=wanted, untimed=True)
    settings, frame = cast(ImportSettings, log.layout), log.layout.axes
    rows, warnings = _rows_of_means(log, settings)
    columns: dict[str, Any] = {}
    if "n_samples" in rows:
        columns["n_samples"] = n_samples = np.round(rows["n_samples"]).astype(int)
        if np.any(n_samples < 1):
            raise InputError(f"{file}: column n_samples: must be positive")
    if {*SDS} <= rows.keys():
        sd = frame.to_frd_order(np.column_stack([rows[k] for k in SDS]) * abs(log.conversion.scale))
        columns["sd"] = sd
        if np.any(sd < 0):
            raise InputError(f"{file}: columns sd_fx, sd_fy, sd_fz: must not be negative")
        if "n_samples" in columns and np.any(sd > 0):
            columns["sigma_force"] = float(np.sqrt(np.mean(sd**2 / n_samples[:, None])))
            warnings.append("sigma of a mean assumes white noise; coloured noise makes it larger")
    columns |= {k: rows[k] for k in ("time", "temperature", "vibration") if k in rows}
    if settings.robot is not None:
        unit, signs = UNITS["rad"][settings.robot.unit], frame.signs
        angles = np.column_stack([rows[key] for key in ANGLES]) * signs[:2]
        columns |= {"angles": angles * unit, "sigma_angle": settings.robot.angle_sigma_mgon * MGON}
        if "yaw" in rows:
            columns["yaw"] = rows["yaw"] * unit * signs[2]
    # Logs of the sensor have the unit and the axes of the table, but not its columns.
    layout = settings.model_dump(include={"unit", "scale", "offset", "frame"}, exclude_none=True)
    sigma = sigma_text(columns["sigma_force"]) if "sigma_force" in columns else "unknown"
    note = f"{len(log.forces)} positions; sigma of a mean: {sigma}"
    columns |= {"log": LogLayout.model_validate(layout), "notes": (note,)}
    return _campaign(file.path, settings, log.forces, warnings=tuple(warnings), **columns)


def _rows_of_means(log: SensorLog, settings: ImportSettings) -> tuple[dict[str, Array], list[str]]:
    """Columns of the rows without those that are not used, and warnings about these."""
    rows, warnings = dict(log.rows), []
    angles = [key for key in (*ANGLES, "yaw") if key in rows]
    if settings.robot is not None:
        for missing in (key for key in ANGLES if key not in angles):
            raise InputError(
                f"{log.path}: which column is the robot's {missing}? Name it by "
                f"`columns` {missing}=..."
            )
    elif angles:
        warnings.append(
            f"columns {', '.join(angles)} are left out; `robot_sigma` takes them for the robot's"
        )
        rows = {key: values for key, values in rows.items() if key not in angles}
    if not len(log.forces):
        raise InputError(f"{log.path}: no row of numbers")
    for row in np.flatnonzero(np.isnan([*rows.values()]).any(axis=0)):
        key = next(key for key in log.lacking(int(row)) if key in rows)
        raise InputError(f"{log.path}: {log.describe(int(row), key)}, not a usable number")
    if "time" in log.places and abs(log.start) < _YEARS:
        rows["time"] = rows["time"] + log.start
    return rows, warnings


# --- The campaign of holds ------------------------------------------------------------------------


def _campaign_of_holds(holds: Holds, reference: ReferenceLog | None) -> Imported:
    """Make the campaign of the holds of one sensor; its notes say how the log was read.

    Holds that the reference does not cover are neither in the campaign nor in the holds.
    """
    log, settings, note = holds.log, holds.log.first.layout, ""
    assert isinstance(settings, ImportSettings)
    gravity = settings.gravity.value_mps2
    settings, offset = _with_offset(settings, holds)
    columns: dict[str, Any] = {}
    if reference is not None:
        holds, columns, note = reference.angles_for(holds, offset, gravity)
    table, noise = holds.table, holds.noise
    rounded = noise.rounding > MIN_ROUNDING_RATIO * noise.accuracy.allan
    timed = holds.size is None or "time" in log.first.places
    if timed and (len(log.parts) == 1 or log.timed):
        columns["time"] = ((table["t0"] + table["t1"]) / 2).to_numpy()
    known = [name for name in log.conditions if table[name].notna().all()]
    columns |= {name: table[name].to_numpy() for name in known}
    campaign = _campaign(
        log.path,
        settings,
        holds.means - offset,
        positions=table.index.to_numpy(),
        sigma_force=noise.sigma,
        sigma_dof=float(round(noise.dof)),
        resolution=holds.windows.steps if rounded else None,
        n_samples=table["n"].to_numpy(),
        sd=table[[*SDS]].to_numpy(),
        log=_layout_of(settings, log.first),
        notes=tuple(_notes(holds, settings, bool(offset.any()), note, rounded)),
        warnings=tuple(_warnings(holds, gravity)),
        **columns,
    )
    return campaign.without(holds.left_out), holds


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
    scale = conversion_of("counts", settings.scale).scale
    offset = np.round(settings.axes.from_frd(center) / scale)
    settings = settings.model_copy(update={"offset": offset.tolist()})
    return settings, settings.axes.to_frd(offset * scale)


def _campaign(path: LogFile, settings: ImportSettings, forces: Array, **columns: Any) -> Campaign:
    """Make a campaign of forces (n, 3) in m/s², in forward, right, down, as the settings say.

    Forces nowhere near gravity, or angles of a robot in another unit, are an error.
    """
    nominal = None
    if settings.unit == "counts":
        conversion = conversion_of(settings.unit, settings.scale, settings.offset)
        scale = settings.axes.to_frd_order(conversion.scale) * settings.axes.signs
        nominal = Conversion(scale, settings.axes.to_frd_order(conversion.offset))
    campaign = Campaign(
        **{
            "name": settings.name,
            "positions": np.arange(1, len(forces) + 1),
            "forces": forces,
            "gravity": settings.gravity.value_mps2,
            "sigma_gravity": settings.gravity.sigma_mps2,
            "unit": settings.unit,
            "sensor": settings.sensor,
            "nominal": nominal,
            "full_range": settings.range_mps2,
            **columns,
        }
    )
    angle_unit = "gon" if settings.robot is None else settings.robot.unit
    doubts = check_plausible(campaign, f"{path}", angle_unit)
    return replace(campaign, warnings=(*campaign.warnings, *doubts))


def _layout_of(settings: LogLayout, log: SensorLog) -> LogLayout:
    """How a log was read, with all its columns, by name if it has names."""

    def column(key: str) -> Place:
        place = log.places[key]
        name = log.source.names[place]
        return name if log.source.named and name and log.source.names.count(name) == 1 else place

    layout = settings.model_dump(include=set(LogLayout.model_fields))
    time = column("time") if "time" in log.places else None
    columns = {key: column(key) for key in log.places if key not in ("time", "nanoseconds")}
    return LogLayout.model_validate({**layout, "columns": columns, "time": time})


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
        dated=log.places.get("time") in log.source.dates,
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
    noise, parts = holds.noise, holds.log.parts
    turned = ""
    if noise.across > MAX_ACROSS_RATIO * noise.accuracy.allan:
        turned = f"{to_display(noise.across / gravity, 'rad'):.0f} {display_unit('rad')}"
    numbered = enumerate(parts, 1) if len(parts) > 1 else ()
    unknown = {name: holds.table[name].isna() for name in holds.log.conditions}
    return _lines(
        "warnings",
        holds,
        holds.log,
        missing=[(i, part) for i, part in numbered if i not in holds.table.index],
        turned=turned,
        lost=[(holds.table.index[lost][0], name) for name, lost in unknown.items() if lost.any()],
        sigma_text=sigma_text,
    )


def _lines(part: str, *content: Any, **named: Any) -> list[str]:
    """Say a part of the template; who reads logs without saying anything loads no templates."""
    from accelstudy.pages import render_lines

    return render_lines(TEMPLATE, part, *content, **named)
