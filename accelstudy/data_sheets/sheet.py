"""The data sheet of a sensor: its quantities, and what follows for a hold and for later times."""

from __future__ import annotations

import inspect
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import yaml

from accelstudy.basics.errors import InputError
from accelstudy.basics.progress import say, show
from accelstudy.basics.units import (
    STANDARD_GRAVITY,
    InputQuantity,
    recorded_unit,
    to_recorded,
)
from accelstudy.files.validation import ITEM
from accelstudy.pages.result import Result

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

FLICKER = math.sqrt(2 * math.log(2) / math.pi)
"""Floor of the Allan deviation in parts of the bias instability B, 0.664 (IEEE Std 952)."""
MIN_NOISE = 1e-12
"""Least noise, SI: no sensor is without any."""
MAX_FORCE = 1e6
"""m/s²; no sensor for leveling has anything like it."""


def _quantity(unit: str, most: float, least: float = 0.0) -> Any:
    """Field of a quantity in the SI `unit`, unknown by default; its limits are those of files."""
    return field(default=None, metadata={"quantity": InputQuantity(unit, least, most)})


@dataclass(frozen=True, eq=False, repr=False)
class DataSheet(Result):
    """What is known of a sensor before its calibration; None if a quantity is unknown.

    Quantities are in SI. White noise is given as its part of the Allan deviation: the one-sided
    noise density of most data sheets is √2 times `velocity_random_walk`. The meanings below are
    also those of the reference page, and of comments in files.

    Attributes
    ----------
    name, title, source : str
    velocity_random_walk : white noise: the mean of τ s has the sd N/√τ
    bias_instability : floor of the Allan deviation, divided by 0.664
    acceleration_random_walk : random walk of the bias
    position_sigma : sd of the mean of a hold, where no more is known of the noise
    repeatability : change of the bias from one switching-on to the next, sd
    bias_per_kelvin : temperature coefficient of the bias
    scale_per_kelvin : temperature coefficient of the scale
    bias : bias before calibration
    scale : scale error before calibration
    nonorthogonality : deviation of the angles between the axes from a right angle
    alignment : rotation of the axes against the housing
    nonlinearity : largest deviation from a straight line, in parts of the full scale
    full_scale : the sensor measures ± this
    bias_rate : float, m/s²/s, drift of the bias, which only a history of the sensor tells
    sources : mapping of quantity to where its value comes from
    assumed : frozenset of quantities whose value is an assumption
    """

    name: str
    title: str = ""
    source: str = ""
    velocity_random_walk: float | None = _quantity("m/s^2/sqrt(Hz)", 10.0, MIN_NOISE)
    bias_instability: float | None = _quantity("m/s^2", MAX_FORCE)
    acceleration_random_walk: float | None = _quantity("m/s^2/sqrt(s)", 10.0)
    position_sigma: float | None = _quantity("m/s^2", MAX_FORCE, MIN_NOISE)
    repeatability: float | None = _quantity("m/s^2", MAX_FORCE)
    bias_per_kelvin: float | None = _quantity("m/s^2/K", 10.0)
    scale_per_kelvin: float | None = _quantity("1/K", 1.0)
    bias: float | None = _quantity("m/s^2", MAX_FORCE)
    scale: float | None = _quantity("1", 1.0)
    nonorthogonality: float | None = _quantity("rad", 1.0)
    alignment: float | None = _quantity("rad", 1.0)
    nonlinearity: float | None = _quantity("1", 1.0)
    full_scale: float | None = _quantity("m/s^2", MAX_FORCE, 1.0)
    bias_rate: float | None = None
    sources: Mapping[str, str] = field(default_factory=dict)
    assumed: frozenset[str] = frozenset()

    def __post_init__(self) -> None:
        if self.velocity_random_walk is None and self.position_sigma is None:
            raise InputError(
                "the noise is missing: give velocity_random_walk, noise_density or position_sigma"
            )
        if self.velocity_random_walk is not None and self.position_sigma is not None:
            raise InputError(
                "velocity_random_walk (or noise_density) and position_sigma both say how large "
                "the noise is; give one of them"
            )
        if self.nonlinearity is not None and self.full_scale is None:
            raise InputError("full_scale: missing; nonlinearity is in parts of it")

    @property
    def known_quantities(self) -> tuple[str, ...]:
        """Quantities that have a value."""
        return tuple(name for name in QUANTITIES if getattr(self, name) is not None)

    @property
    def unknown_quantities(self) -> tuple[str, ...]:
        """Quantities without a value; the noise always has one."""
        noise = ("velocity_random_walk", "position_sigma")
        return tuple(n for n in QUANTITIES if n not in self.known_quantities and n not in noise)

    @property
    def content(self) -> dict[str, object]:
        """What `read_data_sheet` reads; each known quantity with its unit and its source."""
        content: dict[str, object] = {
            "name": self.name,
            "title": self.title,
            "source": self.source,
        }
        for key in self.known_quantities:
            unit = QUANTITIES[key].unit
            value = float(to_recorded(getattr(self, key), unit))
            content[key] = {
                "value": f"{value:.4g} {recorded_unit(unit)}",
                "source": self.sources.get(key, ""),
            }
        return content

    @property
    def as_yaml(self) -> str:
        """Text of a file for `read_data_sheet`; unknown quantities are comments."""
        lines = yaml.safe_dump(self.content, sort_keys=False, allow_unicode=True, width=96)
        rest = [
            f"# {key}: {MEANINGS[key]} (as in 1 {recorded_unit(QUANTITIES[key].unit)})"
            for key in self.unknown_quantities
        ]
        more = ["# Unknown; add what the manufacturer states:", *rest] if rest else []
        return lines + "\n".join(more) + "\n"

    @property
    def state(self) -> str:
        """Found: where no noise is known, there is no data sheet."""
        return "found"

    @property
    def verdict(self) -> str:
        """How large the noise of a mean is, a line for each duration."""
        means = {"a position": 1.0}
        if self.position_sigma is None:
            means = {f"{seconds:g} s": seconds for seconds in (1.0, 10.0, 100.0)}
        return "\n".join(
            f"sigma of the mean of {what}: {1e3 * self.sigma_mean(seconds):.3g} mm/s²"
            for what, seconds in means.items()
        )

    def to_frame(self) -> pd.DataFrame:
        """Return the known quantities in SI, with their units and sources."""
        import pandas as pd

        known = self.known_quantities
        rows = [(getattr(self, k), QUANTITIES[k].unit, self.sources.get(k, "")) for k in known]
        index = pd.Index(known, name="quantity")
        return pd.DataFrame(rows, index, columns=["value", "unit", "source"])

    def draw(self, ax: Axes) -> None:
        """Draw the noise of a mean over its duration."""
        seconds = [10 ** (exponent / 10) for exponent in range(-10, 41)]
        ax.loglog(seconds, [1e3 * self.sigma_mean(each) for each in seconds])
        ax.set(xlabel="duration of a hold / s", ylabel="sigma of its mean / (mm/s²)")

    def write(self, file: Path, place: Path) -> None:
        """Write a YAML file for `plan`, which becomes `place`."""
        file.write_text(self.as_yaml, encoding="utf-8")

    def tell(self, place: Path | None) -> None:
        """Print the noise of a mean."""
        show(self.verdict)
        say(f"data sheet: {place}")

    def sigma_mean(self, seconds: float, session: float | None = None) -> float:
        """Standard deviation of the mean of a hold, m/s².

        For a single hold it is the Allan deviation, √(N²/τ + (0.664 B)² + K² τ/3). The holds of a
        session scatter more about their common mean, since the bias wanders during the session.
        The variances grow by the bias functions B1 = n ln n / (2 (n − 1) ln 2) for flicker noise
        and n/2 for a random walk, with n = session/τ consecutive means (NIST SP 1065, section
        5.2.4).

        Parameters
        ----------
        seconds : float, s, of the hold
        session : float, s, from the first hold to the end of the last, optional
        """
        if self.position_sigma is not None:
            return self.position_sigma
        flicker = walk = 1.0
        if session is not None and session > 2 * seconds:
            n = session / seconds
            flicker, walk = n * math.log(n) / (2 * (n - 1) * math.log(2)), n / 2
        white = (self.velocity_random_walk or 0.0) ** 2 / seconds
        floor = (FLICKER * (self.bias_instability or 0.0)) ** 2
        rising = (self.acceleration_random_walk or 0.0) ** 2 * seconds / 3
        return math.sqrt(white + flicker * floor + walk * rising)

    def bias_change(self, seconds: float, restarted: bool = False) -> float:
        """Standard deviation of the bias's change since the calibration, m/s².

        It is √(F² + K² t + rate² t² + repeatability²) with F of `flicker_change`. Unknown
        quantities count as zero; `unknown_quantities` lists them. What a temperature adds says
        `temperature_sigmas`.

        Parameters
        ----------
        seconds : float, s, since the calibration; 0 for none
        restarted : bool, whether the sensor was switched off and on in between
        """
        floor = flicker_change(
            self.bias_instability or 0.0, self.velocity_random_walk or 0.0, seconds
        )
        walk = (self.acceleration_random_walk or 0.0) * math.sqrt(seconds)
        again = (self.repeatability or 0.0) if restarted else 0.0
        drift = (self.bias_rate or 0.0) * seconds
        return math.hypot(floor, walk, drift, again)

    def temperature_sigmas(self, kelvin: float) -> tuple[float, float]:
        """Standard deviations of what a temperature changes: of the bias, m/s², and of the scale.

        Coefficients that are unknown count as zero.

        Parameters
        ----------
        kelvin : float, K, difference from the temperature of the calibration
        """
        bias, scale = self.bias_per_kelvin or 0.0, self.scale_per_kelvin or 0.0
        return bias * abs(kelvin), scale * abs(kelvin)

    @property
    def quadratic_scale(self) -> float | None:
        """Size of k2 if the nonlinearity is purely quadratic.

        A parabola differs from the best line by half of its term at full scale.
        """
        if self.nonlinearity is None or self.full_scale is None:
            return None
        return 2 * self.nonlinearity * STANDARD_GRAVITY / self.full_scale

    @property
    def cubic_scale(self) -> float | None:
        """Size of k3 if the nonlinearity is purely cubic.

        A cubic differs from the best line by a quarter of its term at full scale.
        """
        if self.nonlinearity is None or self.full_scale is None:
            return None
        return 4 * self.nonlinearity * (STANDARD_GRAVITY / self.full_scale) ** 2


QUANTITIES: dict[str, InputQuantity] = {
    each.name: each.metadata["quantity"] for each in fields(DataSheet) if each.metadata
}
"""Quantities that a data sheet can state."""
MEANINGS = dict(ITEM.findall(inspect.cleandoc(DataSheet.__doc__ or "")))
"""What each attribute of a data sheet means."""


def sheet_of_sigma(sigma: float) -> DataSheet:
    """Sensor of which only the noise of the mean of a position is known, m/s².

    It is assumed to be linear, like that of the paper.
    """
    return DataSheet(
        "sigma",
        "a sensor of which only the noise is known",
        position_sigma=sigma,
        nonlinearity=0.0,
        full_scale=STANDARD_GRAVITY,
        assumed=frozenset({"nonlinearity", "full_scale"}),
    )


def flicker_change(instability: float, white: float, seconds: float) -> float:
    """Standard deviation of the change of a bias by flicker noise, m/s².

    Consider two means over τ; the second begins m τ after the first. By noise of the two-sided
    density B²/(2πf) their difference has the variance B²/π ((m + 1)² ln(m + 1) +
    (m − 1)² ln(m − 1) − 2 m² ln m). For neighbouring means this is twice the Allan variance
    2 ln 2 B²/π; far apart it is about B²/π (2 ln m + 3), which grows slowly without a limit. τ is
    the time from which on flicker noise exceeds white noise, since shorter means do not show it.

    Parameters
    ----------
    instability : float, B, m/s²
    white : float, N of the white noise, m/s²/√Hz
    seconds : float, s, between the two means; 0 for no change
    """
    if seconds <= 0 or instability == 0:
        return 0.0
    means = max(1.0, seconds * (FLICKER * instability / white) ** 2) if white > 0 else 1.0
    # Logarithms of m ± 1 relative to that of m, so that large terms do not cancel.
    growth = 2 * math.log(means) + (means + 1) ** 2 * math.log1p(1 / means)
    if means > 1:
        growth += (means - 1) ** 2 * math.log1p(-1 / means)
    return instability * math.sqrt(growth / math.pi)
