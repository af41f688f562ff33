"""What the import of logs and of tables of means have in common: a campaign and a report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.errors import InputError
from accelstudy.basics.wording import counted
from accelstudy.campaign.files.checks import likely_fault
from accelstudy.campaign.files.header import LogLayout, Place
from accelstudy.campaign.files.session import Campaign
from accelstudy.campaign.holds.allan import MeanAccuracy
from accelstudy.campaign.holds.detected import DetectedHolds
from accelstudy.campaign.importing.settings import ImportSettings
from accelstudy.campaign.logs.sources import Source
from accelstudy.leveling.angles import usual_norm
from accelstudy.sensors.conversion import Conversion, conversion_of
from accelstudy.sensors.plausibility import LARGEST

Array = NDArray[np.float64]


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

    @property
    def sigma_allan(self) -> float | None:
        """Standard deviation of a mean from the Allan deviation, m/s²; None without a log."""
        return None if self.accuracy is None else self.accuracy.allan

    @property
    def ratio(self) -> float | None:
        """Factor by which the assumption of white noise is too optimistic."""
        return None if self.accuracy is None else self.accuracy.ratio

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
