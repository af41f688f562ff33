"""The settings of `accelstudy import`, and what every import makes: a campaign and a report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from accelstudy.basics.errors import InputError
from accelstudy.basics.units import STANDARD_GRAVITY
from accelstudy.basics.wording import counted
from accelstudy.campaign.checks import likely_fault
from accelstudy.campaign.header import LogLayout, Place
from accelstudy.campaign.importing.allan import MeanAccuracy
from accelstudy.campaign.importing.detection import DetectedHolds
from accelstudy.campaign.importing.segments import Selection, parse_selection
from accelstudy.campaign.importing.sources import Source
from accelstudy.campaign.session import Campaign
from accelstudy.files.reading import overlay, read_layer
from accelstudy.files.validation import (
    Gravity,
    NotNegative,
    PathName,
    Positive,
    SigmaAngle,
    SigmaGravity,
    checked,
)
from accelstudy.leveling.angles import usual_norm
from accelstudy.sensors.conversion import Conversion, conversion_of
from accelstudy.sensors.plausibility import LARGEST

Array = NDArray[np.float64]

_LARGE = Field(le=1e6)


class GravitySettings(BaseModel):
    """Gravity where the sensor was."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    value_mps2: Gravity = Field(STANDARD_GRAVITY, description="local gravity, m/s²")
    sigma_mps2: SigmaGravity = Field(0.0, description="its standard deviation; 0 holds it fixed")


class RobotSettings(BaseModel):
    """The robot whose angles a table of means has."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    angle_sigma_mgon: SigmaAngle = Field(description="standard deviation of roll and of pitch")
    unit: Literal["gon", "deg", "rad"] = Field("gon", description="unit of the angles in the table")


class ImportSettings(LogLayout):
    """How a log is read, and what the campaign gets from it; the keys of a settings file."""

    means: bool = Field(False, description="the file is a table of means already")
    name: str | None = Field(None, description="name of the campaign; that of the file if absent")
    sensor: str | None = Field(None, description="what was calibrated")
    sensors: dict[PathName, Annotated[list[Place], Field(min_length=3, max_length=3)]] = Field(
        {}, description="several sensors of one log: name, and columns of its x, y, z"
    )
    gravity: GravitySettings = GravitySettings()
    robot: RobotSettings | None = Field(None, description="with means: the robot's angles")
    range_mps2: Annotated[Positive, _LARGE] | None = Field(
        None, description="the sensor measures ± this"
    )
    window_s: Positive = Field(1.0, description="length of the sliding window")
    threshold_mps2: Annotated[Positive, _LARGE] | None = Field(
        None, description="sd of a window at rest; chosen from the data if absent"
    )
    trim_s: NotNegative = Field(0.2, description="cut from both ends of a hold")
    shortest_s: Positive = Field(1.0, description="shortest hold")
    exclude: list[str] = Field(
        [], description="holds to leave out, as 13:moved or 120s-135s:somebody passed"
    )
    join: list[str] = Field([], description="holds that are one, as 4,5 or 120s-135s")

    @property
    def selection(self) -> Selection:
        """Holds that are left out or joined."""
        return parse_selection(self.exclude, self.join)


def parse_settings(content: Mapping[str, Any], source: str = "settings") -> ImportSettings:
    """Check settings; raise `InputError` with one line that names the source and the key."""
    settings = checked(ImportSettings, content, source)
    try:
        parse_selection(settings.exclude, settings.join)
    except InputError as error:
        raise InputError(f"{source}: {error}") from None
    return settings


def read_settings(
    path: str | Path | None, given: Mapping[str, Any] | None = None
) -> ImportSettings:
    """Settings from a YAML file, overlaid with `given`."""
    content = read_layer(path) if path is not None else {}
    return parse_settings(overlay(content, given or {}), str(path or "options"))


def imported_campaign(
    paths: Sequence[str | Path], settings: ImportSettings, forces: Array, **columns: Any
) -> Campaign:
    """Make a campaign of forces (n, 3) in m/s², in forward, right, down, as the settings say.

    Raises
    ------
    InputError
        If the forces are nowhere near gravity; it names the options that would mend that.
    """
    conversion = conversion_of(settings.unit, settings.scale, settings.offset)
    frame = settings.axes
    raw = conversion.from_si(frame.from_frd(forces))
    nominal = None
    if settings.unit == "counts":
        scale = frame.rearranged(conversion.scale) * frame.signs
        nominal = Conversion(scale, frame.rearranged(conversion.offset))
    _check_size(paths[0], settings, raw, forces)
    return Campaign(
        **{
            "name": settings.name or default_name(paths),
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


def _check_size(path: str | Path, settings: ImportSettings, raw: Array, forces: Array) -> None:
    """Check that forces are roughly as large as gravity; the error names the options to change."""
    gravity, unit = settings.gravity.value_mps2, settings.unit
    norm, given = usual_norm(forces), usual_norm(raw)
    fault = likely_fault(given, norm, unit, gravity)
    if fault is None:
        return
    at_rest = f"{path}: at rest the forces are about {given:.3g} {unit}"
    if fault == "gravity":
        raise InputError(
            f"{at_rest}, which does not fit a gravity of {gravity:g} m/s²; give --gravity"
        )
    if fault == "counts":
        raise InputError(f"{at_rest}: these look like counts; give --unit counts and --scale")
    if fault != "unknown":
        raise InputError(f"{at_rest}: these look like {fault}; give --unit {fault}")
    advice = "--scale and --offset" if unit == "counts" else "--unit or --columns"
    converted = f", by --scale and --offset {norm:.3g} m/s²," if unit == "counts" else ","
    raise InputError(f"{at_rest}{converted} which is nowhere near gravity; give other {advice}")


def far_from_gravity(settings: ImportSettings, forces: Array) -> list[str]:
    """Warn if forces (n, 3), m/s², at rest differ from gravity by more than a scale error can."""
    norm, gravity = usual_norm(forces), settings.gravity.value_mps2
    share = norm / gravity - 1
    if abs(share) <= LARGEST["scale"]:
        return []
    options = "--scale and --offset" if settings.unit == "counts" else "--unit"
    return [
        f"at rest the forces are about {norm:.3g} m/s², {100 * abs(share):.0f} % "
        f"{'more' if share > 0 else 'less'} than gravity, {gravity:g} m/s²: no accelerometer is so "
        f"far off; check {options}, and --gravity"
    ]


def layout_of(settings: LogLayout, source: Source, places: Mapping[str, int]) -> LogLayout:
    """How a log was read, with all its columns, by name if it has names."""

    def column(key: str) -> Place:
        place = places[key]
        name = source.names[place]
        return name if source.named and name and source.names.count(name) == 1 else place

    layout = settings.model_dump(include=set(LogLayout.model_fields))
    time = column("time") if "time" in places else None
    columns = {key: column(key) for key in places if key != "time"}
    return LogLayout.model_validate({**layout, "columns": columns, "time": time})


def default_name(paths: Sequence[str | Path]) -> str:
    """Name of a campaign: the name of its file without endings, or of the folder of its files."""
    path = Path(paths[0])
    if len(paths) > 1:
        return path.absolute().parent.name or path.stem
    return Path(path.stem).stem if path.suffix == ".gz" else path.stem


@dataclass(frozen=True)
class ImportReport:
    """The report of an import.

    Attributes
    ----------
    n_holds : int
    accuracy : MeanAccuracy, of the mean of a typical hold; None from a table of means
    sigma_white : float, m/s², sd of a mean if the noise were white; None if unknown
    holds : DetectedHolds, None from a table of means
    notes : tuple of str, assumptions of the import
    warnings : tuple of str
    """

    n_holds: int
    accuracy: MeanAccuracy | None
    sigma_white: float | None
    holds: DetectedHolds | None
    notes: tuple[str, ...]
    warnings: tuple[str, ...]

    def lines(self) -> list[str]:
        """Return the report as lines of text."""
        if self.holds is None or self.accuracy is None:
            sigma = "unknown" if self.sigma_white is None else shown(self.sigma_white)
            return [f"{self.n_holds} positions; sigma of a mean: {sigma}", *self.notes]
        holds, accuracy = self.holds, self.accuracy
        lengths, edges = holds.n_samples * holds.step, holds.envelope.edges
        lines = [
            f"log: {edges[-1] - edges[0]:.1f} s at {1 / holds.step:.6g} per second",
            *self.notes,
            f"threshold: {holds.threshold.sd:.3g} m/s², {holds.threshold.reason}",
            f"holds: {len(holds)}, of {lengths.min():.1f} to {lengths.max():.1f} s",
        ]
        if holds.left_out:
            each = ", ".join(f"{n} ({why})" for n, why in sorted(holds.left_out.items()))
            lines.append(f"left out: {counted(len(holds.left_out), 'hold')}: {each}")
        return [
            *lines,
            f"sigma of a mean over {accuracy.duration:.1f} s: {shown(accuracy.allan)} (Allan), "
            f"{shown(accuracy.white)} if the noise were white; ratio {accuracy.ratio:.2f}",
        ]


def shown(sigma: float) -> str:
    """Standard deviation of a force, m/s², for people."""
    return f"{1e3 * sigma:.3g} mm/s²"
