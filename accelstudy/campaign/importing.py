"""From a raw log, or a table of means, to a campaign."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, StrictInt, StrictStr, ValidationError

from accelstudy.campaign.allan import MeanAccuracy, accuracy_of_mean
from accelstudy.campaign.format import Campaign, write_campaign
from accelstudy.campaign.holds import Holds, find_holds
from accelstudy.campaign.log_files import open_source
from accelstudy.campaign.logs import (
    AXES,
    TIME_UNITS,
    Log,
    conversion,
    locate,
    open_log,
    read_columns,
)
from accelstudy.errors import InputError, UnknownNameError
from accelstudy.study.config.errors import first_error
from accelstudy.study.config.layers import overlay, read_layer
from accelstudy.study.config.types import (
    Finite,
    Gravity,
    NotNegative,
    OneOrMore,
    Positive,
    Rate,
    SigmaGravity,
)
from accelstudy.units import MGON, STANDARD_GRAVITY

Array = NDArray[np.float64]
Place = Annotated[StrictInt, Field(ge=0)] | StrictStr

MEANS = (*AXES, "n_samples", "sd_fx", "sd_fy", "sd_fz")
"""Columns that a table of means may have, besides its time."""
TURNING = 1.5
"""Noise across over noise along gravity from which on the sensor is said to turn in its holds."""


class _Block(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class GravitySettings(_Block):
    """Gravity where the sensor was."""

    value_mps2: Gravity = Field(STANDARD_GRAVITY, description="local gravity, m/s²")
    sigma_mps2: SigmaGravity = Field(0.0, description="its standard deviation; 0 holds it fixed")


class ImportSettings(_Block):
    """How a log is to be read; the keys of a settings file."""

    means: bool = Field(False, description="the file is a table of means already")
    name: str | None = Field(None, description="name of the campaign; that of the file if absent")
    sensor: str | None = Field(None, description="what was calibrated")
    columns: dict[str, Place] = Field(
        {}, description="fx, fy, fz: name of the column, or its place counted from 0"
    )
    time: Place | None = Field(None, description="column of time")
    time_unit: Literal["s", "ms", "us", "ns"] = "s"
    rate_hz: Rate | None = Field(None, description="samples per second, without time")
    variable: str | None = Field(None, description="which array of a MATLAB file")
    unit: Literal["m/s^2", "g", "counts"] = "m/s^2"
    scale: OneOrMore[Finite] | None = Field(None, description="with counts: m/s² per count")
    offset: OneOrMore[Finite] | None = Field(None, description="with counts: reading at 0 m/s²")
    gravity: GravitySettings = GravitySettings()
    window_s: Positive = Field(1.0, description="length of the sliding window")
    threshold_mps2: Positive | None = Field(
        None, description="sd of a window at rest; chosen from the data if absent"
    )
    trim_s: NotNegative = Field(0.2, description="cut from both ends of a hold")
    shortest_s: Positive = Field(1.0, description="shortest hold")


@dataclass(frozen=True)
class ImportReport:
    """What an import found.

    Attributes
    ----------
    n_holds : int
    accuracy : MeanAccuracy, of the mean of a typical hold; None from a table of means
    sigma_white : float, m/s², of a mean if the noise were white; None if unknown
    holds : Holds, None from a table of means
    warnings : tuple of str
    """

    n_holds: int
    accuracy: MeanAccuracy | None
    sigma_white: float | None
    holds: Holds | None
    warnings: tuple[str, ...]

    @property
    def sigma_allan(self) -> float | None:
        """Standard deviation of a mean from the Allan deviation, m/s²; None without a log."""
        return None if self.accuracy is None else self.accuracy.allan

    @property
    def ratio(self) -> float | None:
        """By how much white noise would have been too optimistic."""
        return None if self.accuracy is None else self.accuracy.ratio

    def lines(self) -> list[str]:
        """Return the report in plain lines."""
        if self.holds is None or self.accuracy is None:
            sigma = "unknown" if self.sigma_white is None else _mm(self.sigma_white)
            return [f"{self.n_holds} positions; sigma of a mean: {sigma}"]
        holds, accuracy = self.holds, self.accuracy
        lengths = holds.t1 - holds.t0
        return [
            f"log: {holds.span[1] - holds.span[0]:.1f} s at {1 / holds.step:.6g} per second",
            f"threshold: {holds.threshold.sd:.3g} m/s², {holds.threshold.reason}",
            f"holds: {len(holds)}, of {lengths.min():.1f} to {lengths.max():.1f} s",
            f"sigma of a mean over {accuracy.duration:.1f} s: {_mm(accuracy.allan)} (Allan), "
            f"{_mm(accuracy.white)} if the noise were white; ratio {accuracy.ratio:.2f}",
        ]


def _mm(sigma: float) -> str:
    return f"{1e3 * sigma:.3g} mm/s²"


def parse_settings(content: Mapping[str, Any], source: str = "settings") -> ImportSettings:
    """Check settings; raise `InputError` with one line that names the source and the key."""
    try:
        return ImportSettings.model_validate(content)
    except ValidationError as error:
        raise InputError(f"{source}: {first_error(error, ImportSettings)}") from None


def read_settings(
    path: str | Path | None, given: Mapping[str, Any] | None = None
) -> ImportSettings:
    """Settings from a YAML file, overlaid with what is given besides."""
    content = read_layer(path) if path is not None else {}
    return parse_settings(overlay(content, given or {}), str(path or "options"))


def log_of(path: str | Path, settings: ImportSettings) -> Log:
    """Open a log as the settings say."""
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
    )


def import_log(
    path: str | Path, settings: ImportSettings | None = None
) -> tuple[Campaign, ImportReport]:
    """Find the static holds of a log.

    Parameters
    ----------
    path : file with the raw log; see `open_log`
    settings : ImportSettings, optional

    Returns
    -------
    Campaign
        One position for each hold. Its `sigma_force` takes into account that the samples are not
        independent: it is the Allan deviation over a typical hold, of the specific force along
        gravity, as across it a sensor that settles looks like one that drifts.
    ImportReport

    Raises
    ------
    InputError
        If the log cannot be read or has no static hold.
    """
    settings = settings or ImportSettings()
    log = log_of(path, settings)
    holds = find_holds(
        log,
        window=settings.window_s,
        threshold=settings.threshold_mps2,
        trim=settings.trim_s,
        shortest=settings.shortest_s,
    )
    typical = int(np.median(holds.n_samples))

    def accuracy_in(channels: slice) -> MeanAccuracy:
        sd = float(np.sqrt(np.mean(holds.noise[channels] ** 2)))
        return accuracy_of_mean(holds.allan.channels(channels), typical * holds.step, sd, typical)

    accuracy = accuracy_in(slice(0, 1) if holds.directed else slice(0, 3))
    warnings = list(holds.warnings)
    if not holds.directed:
        warnings.append(
            "the norms of the means differ too much for specific forces (is an offset missing?); "
            "sigma is that of all axes together"
        )
    elif (across := accuracy_in(slice(1, 3)).allan) > TURNING * accuracy.allan:
        angle = across / settings.gravity.value_mps2 / MGON
        warnings.append(
            f"across gravity the means vary by {_mm(across)}, more than along it: the sensor turns "
            f"by some {angle:.0f} mgon within holds"
        )
    if accuracy.slope is not None:
        warnings.append(
            f"the Allan deviation is known up to {accuracy.tau:.2g} s, and carried on from there "
            f"to the {accuracy.duration:.2g} s of a hold with slope {accuracy.slope:.2f}"
        )
    campaign = _campaign(
        path,
        settings,
        holds.mean,
        sigma=accuracy.allan,
        n_samples=holds.n_samples,
        sd=holds.sd,
        time=(holds.t0 + holds.t1) / 2 - holds.span[0],
        warnings=tuple(warnings),
    )
    return campaign, ImportReport(
        len(holds), accuracy, float(accuracy.white), holds, tuple(warnings)
    )


def import_means(
    path: str | Path, settings: ImportSettings | None = None
) -> tuple[Campaign, ImportReport]:
    """Take a table of means, one row for each position.

    Parameters
    ----------
    path : file, of any kind that `open_log` reads; a MATLAB array may have a column for each
        position instead
    settings : ImportSettings, optional
        Of `columns` those of `MEANS`; nothing is detected, so that windows do not matter.

    Returns
    -------
    Campaign
        With a `sigma_force` if the table has the number of samples and their standard deviations:
        that of white noise, as a table of means does not tell more.
    ImportReport

    Raises
    ------
    InputError
        If the table cannot be read.
    """
    settings = settings or ImportSettings()
    factor, shift = conversion(settings.unit, settings.scale, settings.offset)
    source = open_source(path, settings.variable)
    for key in settings.columns:
        if key not in MEANS:
            raise UnknownNameError("column", key, MEANS)
    given = settings.columns
    places = locate(source, {key: given[key] for key in AXES if key in given}, AXES)
    others = {key: column for key, column in given.items() if key not in AXES}
    places |= locate(source, others, MEANS[3:], needed=False)
    if settings.time is not None:
        places |= locate(source, {"time": settings.time}, ("time",))
    values = dict(zip(places, read_columns(source, places).T, strict=True))

    n_samples = None
    if "n_samples" in values:
        n_samples = np.round(values["n_samples"]).astype(int)
        if np.any(n_samples < 1):
            raise InputError(f"{path}: column n_samples: must be positive")
    sd = None
    if all(f"sd_{axis}" in values for axis in AXES):
        sd = np.column_stack([values[f"sd_{axis}"] for axis in AXES]) * np.abs(factor)
        if np.any(sd < 0):
            raise InputError(f"{path}: columns sd_fx, sd_fy, sd_fz: must not be negative")
    sigma: float | None = None
    warnings: tuple[str, ...] = ()
    if sd is not None and n_samples is not None and np.any(sd > 0):
        sigma = float(np.sqrt(np.mean(sd**2 / n_samples[:, None])))
        warnings = ("sigma of a mean is that of white noise; coloured noise makes it larger",)
    time = values.get("time")
    forces = np.column_stack([values[axis] for axis in AXES])
    campaign = _campaign(
        path,
        settings,
        (forces - shift) * factor,
        sigma=sigma,
        n_samples=n_samples,
        sd=sd,
        time=None if time is None else time * TIME_UNITS[settings.time_unit],
        warnings=warnings,
    )
    return campaign, ImportReport(len(forces), None, sigma, None, warnings)


def import_file(
    path: str | Path, settings: ImportSettings | None = None
) -> tuple[Campaign, ImportReport]:
    """Import a log or, if the settings say so, a table of means."""
    settings = settings or ImportSettings()
    return (import_means if settings.means else import_log)(path, settings)


def import_to(
    folder: str | Path, path: str | Path, settings: ImportSettings, figure: bool = True
) -> tuple[Campaign, ImportReport]:
    """Import a file and write the campaign to a folder.

    With `figure`, segmentation.svg and .png there show the log with its holds, if it is a log.
    """
    campaign, report = import_file(path, settings)
    write_campaign(campaign, folder)
    if figure and report.holds is not None:
        from accelstudy.campaign.segmentation_figure import render_segmentation

        paths = (Path(folder) / f"segmentation.{kind}" for kind in ("svg", "png"))
        render_segmentation(log_of(path, settings), report.holds, *paths)
    return campaign, report


def _campaign(
    path: str | Path,
    settings: ImportSettings,
    forces: Array,
    *,
    sigma: float | None,
    n_samples: NDArray[np.int_] | None,
    sd: Array | None,
    time: Array | None,
    warnings: tuple[str, ...],
) -> Campaign:
    scale, offset = None, None
    if settings.unit == "counts":
        scale, offset = conversion("counts", settings.scale, settings.offset)
    return Campaign(
        name=settings.name or Path(path).stem,
        positions=np.arange(1, len(forces) + 1),
        forces=forces,
        gravity=settings.gravity.value_mps2,
        sigma_gravity=settings.gravity.sigma_mps2,
        unit=settings.unit,
        sensor=settings.sensor,
        sigma_force=sigma,
        n_samples=n_samples,
        sd=sd,
        time=time,
        nominal_scale=scale,
        nominal_offset=offset,
        warnings=warnings,
    )
