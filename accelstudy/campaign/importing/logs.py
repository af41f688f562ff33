"""From raw logs to campaigns, with all that a user should know of the import."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.errors import InputError
from accelstudy.basics.units import display_unit, to_display
from accelstudy.basics.wording import counted, short_list
from accelstudy.campaign.format import write_campaign
from accelstudy.campaign.gross_errors.recognition import check_plausible
from accelstudy.campaign.header import LogLayout, Place
from accelstudy.campaign.importing.detection import Holds, find_blocks, find_holds
from accelstudy.campaign.importing.formats import open_source
from accelstudy.campaign.importing.means import read_means
from accelstudy.campaign.importing.names import thermometers
from accelstudy.campaign.importing.noise import shown, steps_text
from accelstudy.campaign.importing.recording import AXES, SDS, Log, Recording, read_log
from accelstudy.campaign.importing.settings import ImportSettings, named_after
from accelstudy.campaign.importing.sources import LogFile
from accelstudy.campaign.importing.windows import usual_window
from accelstudy.campaign.session import Campaign
from accelstudy.sensors.conversion import Conversion, conversion_of

if TYPE_CHECKING:
    from accelstudy.campaign.reference_log import ReferenceLog

Array = NDArray[np.float64]
Imported = tuple[Campaign, Holds | None]
"""A campaign, and the holds that it was made of; None of a table of means."""

MAX_ACROSS_RATIO = 1.5
"""Noise across gravity, as a multiple of that along it, from which on a warning says that the
sensor turns within its holds."""
MIN_ROUNDING_RATIO = 0.1
"""Sigma of rounding over that of noise, from which on the resolution is told and kept."""


def import_log(path: LogFile, settings: ImportSettings | None = None) -> Imported:
    """Import a log of one sensor or a table of means; see `import_sensors`."""
    settings = settings or ImportSettings()
    if settings.sensors:
        raise InputError("sensors: several sensors make several campaigns; only one fits here")
    return import_sensors([path], settings)[""]


def import_sensors(
    paths: Sequence[LogFile], settings: ImportSettings, reference: ReferenceLog | None = None
) -> dict[str, Imported]:
    """Find the static holds of the sensors in a log, or in logs of one position each.

    If the settings say so, it is a table of means instead.

    Parameters
    ----------
    paths : raw logs, see `read_log`; if there are several, the longest hold of each is
        its one position
    settings : ImportSettings
    reference : ReferenceLog, optional, of a calibrated sensor on the same plate, whose roll and
        pitch the campaigns get

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
    _check_kinds(len(paths), settings, reference)
    settings = named_after(settings, paths)
    files = [open_source(path, settings.variable, settings.delimiter) for path in paths]
    if settings.means:
        told, forces, columns = read_means(files[0], settings)
        return {"": (_campaign(paths[0], told, forces, **columns), None)}
    of_sensors, several = _settings_of_sensors(settings), len(paths) > 1
    untimed = several or settings.block is not None
    parts = {
        name: [read_log(file, each, untimed=untimed) for file in files]
        for name, each in of_sensors.items()
    }
    logs = {
        name: Recording(own, [parts[other] for other in parts if other != name])
        for name, own in parts.items()
    }
    if settings.block is not None or (
        several and any(_whole_files(log, settings) for log in logs.values())
    ):
        found = [find_blocks(log, of_sensors[name]) for name, log in logs.items()]
    else:
        found = find_holds([*logs.values()], settings, one_each=several)
    return {
        name: _campaign_of_holds(holds, reference) for name, holds in zip(logs, found, strict=True)
    }


def write_imported(
    campaign: Campaign, holds: Holds | None, folder: Path, figure: bool = True
) -> None:
    """Write a campaign and, of a log, a figure that shows its holds: segmentation.svg and .png."""
    write_campaign(campaign, folder)
    if figure and holds is not None:
        # Matplotlib takes longer to import than a log of usual length to read.
        from accelstudy.campaign.importing import segmentation_figure
        from accelstudy.drawing.saving import save_all
        from accelstudy.drawing.style import DPI

        offset = holds.means[0] - campaign.whole.forces[0]
        draw = {"segmentation": lambda: segmentation_figure.draw_segmentation(holds, offset)}
        save_all(draw, folder, DPI)


# --- Kinds of logs -------------------------------------------------------------------------------


def _check_kinds(
    files: int, settings: ImportSettings, reference: ReferenceLog | None = None
) -> None:
    """Check that means, blocks, several files, several sensors and a reference go together."""
    means, block = settings.means, settings.block is not None
    placed = settings.sensors and {*AXES} & settings.columns.keys()
    for wrong, text in (
        (means and reference, "a table of means (`means`) has no holds in time: leave out "
         "`reference_log`"),
        (means and (files > 1 or settings.sensors), "a table of means is one file of one sensor"),
        (means and block, "a table of means (`means`) has a row for each position, no block "
         "(`block`)"),
        (settings.robot and not means, "robot (`robot_sigma`): its angles go with a table of means "
         "(`means`)"),
        (placed, "columns: fx, fy and fz stand in sensors (`sensors`) already"),
        (reference and (block or files > 1), "`reference_log` goes with one log that has a time, "
         "not with several files or `block`"),
        (block and files > 1, f"a log of blocks (`block`) is one file, not {files}"),
    ):  # fmt: skip
        if wrong:
            raise InputError(text)


def _settings_of_sensors(settings: ImportSettings) -> dict[str, ImportSettings]:
    """Settings of each sensor, as if it were the only one."""
    if not settings.sensors:
        return {"": settings}
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


def _whole_files(log: Recording, settings: ImportSettings) -> bool:
    """Whether files of one position each have no rate, or all are too short to find a hold in."""
    if settings.rate_hz is None and any("time" not in part.places for part in log.parts):
        return True
    window = settings.window_s or usual_window(log)
    least = window + 2 * settings.trim_s + settings.shortest_s
    return max(log.lengths) * log.step < least


# --- The campaign --------------------------------------------------------------------------------


def _campaign_of_holds(holds: Holds, reference: ReferenceLog | None) -> Imported:
    """Make the campaign of the holds of one sensor; its notes say how the log was read.

    Holds that the reference does not cover are neither in the campaign nor in the holds.
    """
    log, settings = holds.log, holds.log.first.layout
    assert isinstance(settings, ImportSettings)
    gravity, beside = settings.gravity.value_mps2, None
    settings, offset = _with_offset(settings, holds)
    if reference is not None:
        beside = reference.angles_for(holds, offset, gravity)
        holds = beside.holds
    table, forces, left_out = holds.table, holds.means - offset, dict(holds.left_out)
    several = len(log.parts) > 1
    warnings = [*holds.warnings, *_doubts(holds, gravity)]
    for i, part in enumerate(log.parts, 1):
        if several and i not in holds.table.index:
            warnings.append(f"{part.path}: no static hold; position {i} is missing")
    warnings += log.warnings()
    columns: dict[str, Any] = {}
    if (holds.size is None or "time" in log.first.places) and (not several or log.timed):
        columns["time"] = ((table["t0"] + table["t1"]) / 2).to_numpy()
    for name in log.conditions:
        if table[name].notna().all():
            columns[name] = table[name].to_numpy()
        else:
            hold = table.index[table[name].isna()][0]
            warnings.append(f"hold {hold} has no {name}; the column is left out")
    notes = [*_taken(holds, settings, offset)]
    if beside is not None:
        columns |= beside.columns
        warnings += beside.warnings
        left_out = {**beside.left_out, **left_out}
        notes.append(beside.note)
    campaign = _campaign(
        log.path,
        settings,
        forces,
        positions=table.index.to_numpy(),
        sigma_force=holds.noise.sigma,
        sigma_dof=float(round(holds.noise.dof)),
        resolution=holds.windows.steps if _rounds(holds) else None,
        n_samples=table["n"].to_numpy(),
        sd=np.column_stack([table[name] for name in SDS]),
        log=_layout_of(settings, log.first),
        notes=tuple(_lines(holds, notes)),
        warnings=tuple(warnings),
        **columns,
    )
    return campaign.without(left_out), holds


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
        scale = settings.axes.rearranged(conversion.scale) * settings.axes.signs
        nominal = Conversion(scale, settings.axes.rearranged(conversion.offset))
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


def _layout_of(settings: LogLayout, log: Log) -> LogLayout:
    """How a log was read, with all its columns, by name if it has names."""

    def column(key: str) -> Place:
        place = log.places[key]
        name = log.source.names[place]
        return name if log.source.named and name and log.source.names.count(name) == 1 else place

    layout = settings.model_dump(include=set(LogLayout.model_fields))
    time = column("time") if "time" in log.places else None
    columns = {key: column(key) for key in log.places if key not in ("time", "nanoseconds")}
    return LogLayout.model_validate({**layout, "columns": columns, "time": time})


# --- What is said of it --------------------------------------------------------------------------


def _lines(holds: Holds, notes: list[str]) -> Iterator[str]:
    """What was found in a log, in lines; `notes` say how it was read."""
    accuracy, noise, step = holds.noise.accuracy, holds.noise, holds.log.step
    counts = holds.table["n"]
    mean, lengths = f"{accuracy.duration:.1f} s", counts * step
    time = holds.log.time[holds.windows.centred]
    log = f"log: {time[-1] - time[0]:.1f} s at {1 / step:.6g} per second"
    found = f"holds: {len(counts)}, of {lengths.min():.1f} to {lengths.max():.1f} s"
    if holds.size is not None:
        mean = f"{accuracy.duration / step:.0f} samples"
        each = mean if counts.min() == counts.max() else f"{counts.min()} to {counts.max()}"
        log = f"log: {counts.sum()} samples"
        found = f"blocks: {len(counts)}, of {each}, each a position"
    yield log
    yield from notes
    yield f"threshold: {holds.threshold.sd:.3g} m/s², {holds.threshold.reason}"
    yield found
    if holds.left_out:
        each = ", ".join(f"{n} ({why})" for n, why in sorted(holds.left_out.items()))
        kind = "hold" if holds.size is None else "block"
        yield f"left out: {counted(len(holds.left_out), kind)}: {each}"
    yield (
        f"sigma of a mean over {mean}: {shown(accuracy.allan)} (Allan), "
        f"{shown(accuracy.white)} if the noise were white; ratio {accuracy.ratio:.2f}"
    )
    if _rounds(holds):
        yield (
            f"quantisation: readings in steps of {steps_text(holds.windows.steps)}; rounding "
            f"leaves {shown(noise.rounding)} in a mean, however long the hold; together "
            f"{shown(noise.sigma)}"
        )


def _rounds(holds: Holds) -> bool:
    """Whether rounding to the steps of the readings counts beside the noise of a mean."""
    return holds.noise.rounding > MIN_ROUNDING_RATIO * holds.noise.accuracy.allan


def _taken(holds: Holds, settings: ImportSettings, offset: Array) -> Iterator[str]:
    """How a log was read: its columns, axes and files, and an offset that was found."""
    recording, log = holds.log, holds.log.first
    names = [name if log.source.named else f"column {name}" for name in log.source.names]
    used = {key: names[place] for key, place in log.places.items()}
    sensors = (recording.parts, *recording.others)
    taken = {place for logs in sensors for place in logs[0].places.values()}
    unused = [name for place, name in enumerate(names) if place not in taken]
    forces = ", ".join(used[axis] for axis in AXES)
    time = f"time from {used['time']}, " if "time" in used else ""
    if time and log.places["time"] not in log.source.dates:
        time = f"time from {used['time']} ({log.layout.time_unit}), "
    conditions = "".join(f", {key} from {used[key]}" for key in log.conditions)
    yield (
        f"columns: {time}forces from {forces} ({log.layout.unit}){conditions}"
        + (f"; not used: {short_list(unused)}" if unused else "")
    )
    if "temperature" not in used and (heat := thermometers(log.source.names)):
        each = short_list([names[place] for place in heat])
        yield f"temperature: which of {each}, in °C? Give `columns` temperature=NAME"
    yield from log.source.notes
    if settings.frame != "frd":
        yield f"axes: {settings.frame} in the log, turned to frd (forward, right, down) here"
    if offset.any():
        given = ", ".join(f"{x:.0f}" for x in settings.offset or ())
        yield f"offset: {given} counts, from the positions, as none was given"
    if len(recording.parts) > 1:
        of_each = "each as a whole one position"
        if holds.size is None:
            of_each = (
                "with the longest hold of each as one position; what is before and after it does "
                "not count"
            )
        untold = (
            "" if recording.timed else "; the times of the files do not tell that of a position"
        )
        yield f"files: {len(recording.parts)}, {of_each}{'' if recording.timed else untold}"


def _doubts(holds: Holds, gravity: float) -> Iterator[str]:
    """What the user should know about the accuracy of the mean over a typical hold."""
    noise, accuracy = holds.noise, holds.noise.accuracy
    if not noise.directed:
        yield (
            "the norms of the means differ too much for specific forces (is an offset missing?); "
            "sigma is taken over all axes"
        )
    elif noise.across > MAX_ACROSS_RATIO * accuracy.allan:
        turned = f"{to_display(noise.across / gravity, 'rad'):.0f} {display_unit('rad')}"
        yield (
            f"across gravity the means vary by {shown(noise.across)}, more than along it: the "
            f"sensor turns by some {turned} within holds"
        )
    if accuracy.slope is not None:
        known, whole = f"{accuracy.tau:.2g} s", f"{accuracy.duration:.2g} s of a hold"
        if holds.size is not None:
            known = f"{accuracy.tau / holds.log.step:.0f} samples"
            whole = f"{holds.size} of a block"
        yield (
            f"the Allan deviation is known up to {known}, and extrapolated from there to the "
            f"{whole} with slope {accuracy.slope:.2f}"
        )
