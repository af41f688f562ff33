"""From raw logs to campaigns, with all that a user should know of the import."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from accelstudy.basics.arguments import tidy
from accelstudy.basics.bounds import SIGMA_FORCE
from accelstudy.basics.errors import InputError
from accelstudy.basics.units import MGON, UNITS, display_unit, to_display
from accelstudy.basics.wording import comma_list, short_list
from accelstudy.campaign.gross_errors.recognition import check_plausible
from accelstudy.campaign.header import LogLayout
from accelstudy.campaign.importing.columns import ANGLES, AXES, MEANS, SDS, thermometers
from accelstudy.campaign.importing.holds import Holds, find_blocks, find_holds, shortest_rest
from accelstudy.campaign.importing.log import AnyLog, Log, join, read_log
from accelstudy.campaign.importing.noise import sigma_text, steps_text
from accelstudy.campaign.importing.settings import ImportSettings
from accelstudy.campaign.session import Campaign
from accelstudy.leveling.angles import usual_norm

if TYPE_CHECKING:
    from accelstudy.campaign.reference_log import ReferenceLog

Imported = tuple[Campaign, Holds | None]
"""A campaign, and the holds that it was made of; None of a table of means."""

MAX_ACROSS_RATIO = 1.5
"""Noise across gravity, as a multiple of that along it, from which on a warning says that the
sensor turns within its holds."""
LONGEST_STEP = 3600.0
"""s between the rows of a table of means, on average, from which on its unit of time is doubted."""
_YEARS = 1e8  # s; no session lasts for years, so later times count from 1970
_ON_EARTH = 9.76, 9.84
"""Gravity, m/s², with some room: from the highest mountain on the equator to the poles."""
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
    log : raw logs, see `read_log`; if there are several, the longest hold of each is its one
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
    settings = settings or ImportSettings()
    _check_kinds(len(logs), settings, reference)
    more = MEANS if settings.means else ()
    read = [read_log(one, settings.layout, more=more) for one in logs]
    for each in read:
        each.check_units(each.conditions)
    if settings.means:
        return _campaign_of_means(read[0], settings), None
    if len(logs) == 1 and settings.block is None:
        read[0].check_timed()
    joined = join(read)
    in_blocks = settings.block is not None or (len(logs) > 1 and _are_short(joined, settings))
    holds = _with_offset((find_blocks if in_blocks else find_holds)(joined, settings))
    return _campaign_of_holds(holds, settings, reference)


def _check_kinds(files: int, settings: ImportSettings, reference: ReferenceLog | None) -> None:
    """Check that it is said in one way what a position is."""
    kinds = {
        "several files": files > 1,
        "`block`": settings.block is not None,
        "`means`": settings.means,
        "`reference_log`": reference is not None,
    }
    if len(ways := [kind for kind, chosen in kinds.items() if chosen]) > 1:
        raise InputError(
            f"{comma_list(ways)} do not go together: a position is a hold of a log, with a "
            "reference or without, or a file, or a block, or a row of means"
        )
    if settings.robot_sigma is not None and not settings.means:
        raise InputError("`robot_sigma`: the robot's angles go with a table of means (`means`)")


def _are_short(log: Log, settings: ImportSettings) -> bool:
    """Whether files of one position each have no rate, or all are too short to find a hold in."""
    if not all(part.timed for part in log.parts):
        return True
    longest = max(len(part.whole_samples) for part in log.parts) * log.step
    return longest < shortest_rest(log, settings)


# --- A table of means ----------------------------------------------------------------------------


def _campaign_of_means(log: Log, settings: ImportSettings) -> Campaign:
    """Campaign of a table of means, a row for each position; a MATLAB array may have columns.

    With `robot_sigma` roll, pitch and perhaps yaw are the robot's angles, in the convention of the
    frame. The campaign has a sigma if the table has numbers of samples and their standard
    deviations: that of white noise, since a table of means does not say more.
    """
    robot, frame, warnings = settings.robot_sigma, log.layout.axes, []
    rows = log.samples.assign(**{key: log.column(key) for key in MEANS if key in log.places})
    angles = [key for key in ANGLES if key in rows]
    for missing in (key for key in ANGLES[:2] if robot is not None and key not in angles):
        raise InputError(
            f"{log.path}: which column is the robot's {missing}? Name it by `columns` {missing}=..."
        )
    if angles and robot is None:
        warnings.append(
            f"columns {', '.join(angles)} are left out; `robot_sigma` takes them for the robot's"
        )
        rows = rows.drop(columns=angles)
    if "time" not in log.settings:
        rows = rows.drop(columns="time")
    if not len(rows):
        raise InputError(f"{log.path}: no row of numbers")
    for row in np.flatnonzero(rows.isna().any(axis=1)).tolist():
        key = next(key for key in log.unreadable(row) if key in rows)
        raise InputError(f"{log.path}: {log.describe(row, key)}, not a usable number")
    columns = {key: rows[key].to_numpy() for key in (*log.conditions, "n_samples") if key in rows}
    if "time" in rows:
        columns["time"] = rows["time"].to_numpy() + (log.start if abs(log.start) < _YEARS else 0.0)
    sigma = None
    if {*SDS} <= {*rows}:
        sd = frame.to_frd_order(rows[[*SDS]].to_numpy() * abs(log.layout.conversion.scale))
        columns["sd"] = sd
        n_samples = columns.get("n_samples", np.zeros(1))
        if np.all(n_samples > 0) and np.any(sd > 0):
            sigma = float(np.sqrt(np.mean(sd**2 / n_samples[:, None])))
            warnings.append("sigma of a mean assumes white noise; coloured noise makes it larger")
    if robot is not None:
        factor = UNITS["rad"][settings.robot_unit]
        turned = rows[angles].to_numpy() * factor * frame.signs[: len(angles)]
        columns["angles"] = turned[:, :2]
        if "yaw" in angles:
            columns["yaw"] = turned[:, 2]
    # Logs of the sensor have the unit and the axes of the table, but not its columns.
    shared = log.layout.model_dump(include={"unit", "scale", "offset", "frame"}, exclude_none=True)
    header = _header(log, settings) | {
        "sensor_noise": None if sigma is None else {"sigma_mps2": sigma},
        "robot": None if robot is None else {"angle_sigma_mgon": tidy(robot / MGON)},
        "log": LogLayout.model_validate(shared),
    }
    if robot is not None and "yaw" not in angles:
        warnings.append(
            "without the robot's yaw a base that is not level looks like noise; a column yaw, or "
            "`columns` yaw=NAME, tells it"
        )
    if "time" in rows and (step := float(np.ptp(rows["time"])) / len(rows)) > LONGEST_STEP:
        unit = log.layout.time_unit
        warnings.append(
            f"rows are {step / 3600:.3g} h apart on average; is `time_unit` {unit} right?"
        )
    shown = "unknown" if sigma is None else sigma_text(sigma)
    notes = (_columns_note(log, settings), f"{len(rows)} positions; sigma of a mean: {shown}")
    campaign = Campaign.of(header, check=False, forces=log.forces, **columns)
    return _checked(replace(campaign, notes=notes, warnings=tuple(warnings)), log, settings)


def _columns_note(log: Log, settings: ImportSettings) -> str:
    """Say what a table of means was taken for."""
    taken = [key if key == name else f"{key} from {name}" for key, name in log.used.items()]
    angles = f", angles in {settings.robot_unit}" if settings.robot_sigma is not None else ""
    return (
        f"columns: {', '.join(taken)}; forces in {log.layout.unit}{angles}, axes {log.layout.frame}"
        + (f"; not used: {short_list(log.unused)}" if log.unused else "")
    )


# --- The campaign of holds -----------------------------------------------------------------------


def _with_offset(holds: Holds) -> Holds:
    """Take an unknown offset of counts, as the positions tell it, off a log and its holds.

    A center that is near zero is the bias of the sensor, and no offset.
    """
    log, center = holds.log, holds.noise.center
    layout, scale = log.layout, log.layout.conversion.scale
    unknown = (layout.unit, layout.offset) == ("counts", None) and holds.noise.directed
    if not unknown or np.linalg.norm(center) <= usual_norm(holds.means - center) / 2:
        return holds
    counts = np.round(layout.axes.from_frd(center) / scale)
    zero, samples, table = layout.axes.to_frd(counts * scale), log.samples, holds.table.copy()
    for each in (samples, table):
        each[[*AXES]] -= zero
    layout = layout.model_copy(update={"offset": counts.tolist()})
    log = replace(log, layout=layout, samples=samples)
    return replace(holds, log=log, table=table, noise=replace(holds.noise, center=center - zero))


def _campaign_of_holds(
    holds: Holds, settings: ImportSettings, reference: ReferenceLog | None
) -> Imported:
    """Make the campaign of the holds of one sensor; its notes say how the log was read.

    Holds that the reference does not cover are neither in the campaign nor in the holds.
    """
    log, columns, sensor, note = holds.log, dict[str, Any](), None, ""
    if reference is not None:
        angles_for = reference.angles_for(holds, settings.gravity)
        holds, columns["angles"], sensor, note = angles_for
    table, noise = holds.table, holds.noise
    rounded = noise.rounding > MIN_ROUNDING_RATIO * noise.accuracy.allan
    if log.has_one_clock and ("time" in log.places or holds.size is None):
        columns["time"] = ((table["t0"] + table["t1"]) / 2).to_numpy()
    known = [name for name in log.conditions if table[name].notna().all()]
    columns |= {name: table[name].to_numpy() for name in known}
    stated = {"sigma_mps2": noise.sigma, "degrees_of_freedom": max(1.0, float(round(noise.dof)))}
    header = _header(log, settings) | {
        # Readings that never change within a hold do not show their noise, and those in a wrong
        # unit are refused by their size.
        "sensor_noise": stated if SIGMA_FORCE.least <= noise.sigma <= SIGMA_FORCE.most else None,
        "resolution_mps2": holds.windows.steps.tolist() if rounded else None,
        "reference": sensor,
    }
    columns |= {"forces": holds.means, "sd": table[[*SDS]].to_numpy()}
    columns |= {"positions": table.index.to_numpy(), "n_samples": table["n"].to_numpy()}
    notes, warnings = _notes(holds, note, rounded), _warnings(holds, settings.gravity)
    campaign = replace(Campaign.of(header, check=False, **columns), notes=notes, warnings=warnings)
    return _checked(campaign, log, settings).without(holds.left_out), holds


def _header(log: Log, settings: ImportSettings) -> dict[str, Any]:
    """Header of a campaign, as the settings say.

    Without a name it has that of the file without endings, or of the folder of several files.
    """
    layout = log.layout
    name = Path(log.path.stem).stem if log.path.suffix == ".gz" else log.path.stem
    if len(log.parts) > 1:
        name = log.path.absolute().parent.name or name
    nominal = None
    if layout.unit == "counts":
        frame, conversion = layout.axes, layout.conversion
        scale = frame.to_frd_order(conversion.scale) * frame.signs
        offset = frame.to_frd_order(conversion.offset)
        nominal = {"scale": scale.tolist(), "offset": offset.tolist()}
    return {
        "name": settings.name or name,
        "sensor": settings.sensor,
        "unit": layout.unit,
        "nominal": nominal,
        "gravity": {"value_mps2": settings.gravity, "sigma_mps2": settings.gravity_sigma},
        "range_mps2": settings.range,
        "log": layout,
    }


def _checked(campaign: Campaign, log: Log, settings: ImportSettings) -> Campaign:
    """Refuse a wrong unit, and what no campaign can have; add what is doubtful."""
    doubts = check_plausible(campaign, f"{log.path}", settings.robot_unit)
    given = "gravity" in settings.model_fields_set
    note = f"gravity: {campaign.gravity:.9g} m/s²{'' if given else ', as none was given'}"
    least, most = _ON_EARTH
    if not least <= campaign.gravity <= most:
        doubts.append(
            f"a gravity of {campaign.gravity:.9g} m/s² is that of no place on Earth, from {least} "
            f"to {most}; check `gravity`"
        )
    notes, warnings = (*campaign.notes, note), (*campaign.warnings, *doubts)
    return replace(campaign.check_holds(log.path), notes=notes, warnings=warnings)


# --- What is said of it --------------------------------------------------------------------------


def _lines(*given: Any, **more: Any) -> tuple[str, ...]:
    from accelstudy.pages import render_lines  # not needed where nothing is said

    return tuple(render_lines("campaign/importing/logs.txt.j2", *given, sigma=sigma_text, **more))


def _notes(holds: Holds, reference: str, rounded: bool) -> tuple[str, ...]:
    """How a log was read, and what was found in it, a line each."""
    log = holds.log
    return _lines(
        "notes",
        holds,
        log,
        used={"time": "", "temperature": "", **log.layout.columns, **log.used},
        heat=[log.raw.labels[place] for place in thermometers(log.raw.names)],
        reference=reference,
        seconds=np.ptp(log.time),
        steps=steps_text(holds.windows.steps) if rounded else "",
    )


def _warnings(holds: Holds, gravity: float) -> tuple[str, ...]:
    """What the user should know of a log and its holds, a line each."""
    noise, parts, table = holds.noise, holds.log.parts, holds.table
    turned = ""
    if noise.across > MAX_ACROSS_RATIO * noise.accuracy.allan:
        turned = f"{to_display(noise.across / gravity, 'rad'):.0f} {display_unit('rad')}"
    unknown = {name: table[name].isna() for name in holds.log.conditions}
    return _lines(
        "warnings",
        holds,
        holds.log,
        missing=[(i, p) for i, p in enumerate(parts, 1) if parts[1:] and i not in table.index],
        turned=turned,
        shortened=noise.accuracy.duration < 0.99 * table["n"].median() * holds.log.step,
        lost=[(table.index[lost][0], name) for name, lost in unknown.items() if lost.any()],
    )
