"""From the holds of a log to a campaign, with all that a user should know of the import."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.units import display_unit, to_display
from accelstudy.basics.wording import counted, short_list
from accelstudy.campaign.gross_errors.recognition import check_plausible
from accelstudy.campaign.header import LogLayout, Place
from accelstudy.campaign.importing.detection import Holds
from accelstudy.campaign.importing.names import thermometers
from accelstudy.campaign.importing.noise import shown, steps_text
from accelstudy.campaign.importing.recording import AXES, SDS, Log, Recording
from accelstudy.campaign.importing.settings import ImportSettings
from accelstudy.campaign.importing.sources import LogFile
from accelstudy.campaign.session import Campaign
from accelstudy.sensors.conversion import Conversion, conversion_of

if TYPE_CHECKING:
    from accelstudy.campaign.reference_log import ReferenceLog

Array = NDArray[np.float64]

MAX_ACROSS_RATIO = 1.5
"""Noise across gravity, as a multiple of that along it, from which on a warning says that the
sensor turns within its holds."""

MIN_ROUNDING_RATIO = 0.1
"""Sigma of rounding over that of noise, from which on the resolution is told and kept."""


def campaign_of_holds(
    log: Recording, holds: Holds, beside: ReferenceLog | None = None
) -> tuple[Campaign, Holds]:
    """Make the campaign of the holds of one sensor.

    Its notes say how the log was read and what was found in it.

    Parameters
    ----------
    log : Recording
    holds : Holds
    beside : ReferenceLog, optional, of a sensor on the same plate, whose angles the campaign gets

    Returns
    -------
    campaign : Campaign
    holds : Holds, without those that the reference does not cover
    """
    first, settings = log.first, log.first.layout
    assert isinstance(settings, ImportSettings)
    gravity = settings.gravity.value_mps2
    if beside is not None:
        holds, records = beside.average(log, holds, gravity)
    left_out = dict(holds.left_out)
    warnings = [*holds.warnings, *_doubts(holds, gravity)]
    notes = [*_recognised(log)]
    if settings.frame != "frd":
        notes.append(
            f"axes: {settings.frame} in the log, turned to frd (forward, right, down) here"
        )
    settings, offset = _with_offset(settings, holds)
    if offset.any():
        given = ", ".join(f"{x:.0f}" for x in settings.offset or ())
        notes.append(f"offset: {given} counts, from the positions, as none was given")
    several = len(log.parts) > 1
    if several:
        of_each = "each as a whole one position"
        if holds.size is None:
            of_each = (
                "with the longest hold of each as one position; what is before and after it does "
                "not count"
            )
        untold = "" if log.timed else "; the times of the files do not tell that of a position"
        notes.append(f"files: {len(log.parts)}, {of_each}{untold}")
        for i, part in enumerate(log.parts, 1):
            if i not in holds.parts:
                warnings.append(f"{part.path}: no static hold; position {i} is missing")
    warnings += log.warnings()
    table, forces = holds.table, holds.means - offset
    columns: dict[str, Any] = {}
    if (holds.size is None or "time" in first.places) and (not several or log.timed):
        columns["time"] = ((table["t0"] + table["t1"]) / 2).to_numpy()
    for name in log.conditions:
        if table[name].notna().all():
            columns[name] = table[name].to_numpy()
        else:
            hold = table.index[table[name].isna()][0]
            warnings.append(f"hold {hold} has no {name}; the column is left out")
    if beside is not None:
        used = ~table.index.isin([*left_out])
        of_reference, poles, note = beside.angles(log, forces, records, used, gravity)
        columns |= of_reference
        why = "the x axis of the reference is too near to the vertical for a roll"
        warnings += [f"hold {n} left out: {why}" for n in table.index[poles]]
        warnings += beside.unused(first)
        left_out = {**dict.fromkeys(table.index[poles].tolist(), why), **left_out}
        notes.append(note)
    campaign = imported_campaign(
        log.path,
        settings,
        forces,
        positions=table.index.to_numpy(),
        sigma_force=holds.noise.sigma,
        sigma_dof=float(round(holds.noise.dof)),
        resolution=holds.windows.steps if _rounds(holds) else None,
        n_samples=table["n"].to_numpy(),
        sd=np.column_stack([table[name] for name in SDS]),
        log=_layout_of(settings, first),
        notes=tuple(_lines(holds, notes)),
        warnings=tuple(warnings),
        **columns,
    )
    return campaign.without(left_out), holds


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


def _recognised(recording: Recording) -> Iterator[str]:
    """How the columns of a log were taken."""
    log = recording.first
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


def imported_campaign(
    path: LogFile, settings: ImportSettings, forces: Array, **columns: Any
) -> Campaign:
    """Make a campaign of forces (n, 3) in m/s², in forward, right, down, as the settings say.

    Raises
    ------
    InputError
        If the forces are nowhere near gravity, or the robot's angles are in another unit.
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
