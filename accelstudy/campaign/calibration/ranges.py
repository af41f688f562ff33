"""The ranges of forces and conditions in a calibration, and how far a log goes beyond them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.wording import counted
from accelstudy.effects import HoldConditions

if TYPE_CHECKING:
    from accelstudy.campaign.calibration.fit import CampaignFit

Array = NDArray[np.float64]

MARGIN = 0.1
"""A log may leave a range by this part of its width without a warning."""
FORCES = {"fx_mps2": "forward", "fy_mps2": "right", "fz_mps2": "down"}
"""Ranges of the calibrated forces, and where they point."""


def ranges_of(fit: CampaignFit) -> dict[str, list[float]]:
    """Smallest and largest value over the holds of a calibration.

    Returns
    -------
    dict
        Ranges of `time_s` since the start of the session, `temperature_degC`, `vibration_mps2` as
        far as they are known, and of the calibrated forces.
    """
    campaign = fit.campaign
    columns = {
        "time_s": campaign.time,
        "temperature_degC": campaign.temperature,
        "vibration_mps2": campaign.vibration,
        **dict(zip(FORCES, fit.corrected.T, strict=True)),
    }
    return {
        name: [float(np.min(values)), float(np.max(values))]
        for name, values in columns.items()
        if values is not None
    }


class Watch:
    """Counts the rows of a log that lie beyond the ranges of a calibration.

    Parameters
    ----------
    ranges : mapping, as `ranges_of` returns it
    """

    def __init__(self, ranges: Mapping[str, list[float]]) -> None:
        groups = [
            ("temperature", "°C", {"temperature_degC": ""}),
            ("vibration", "m/s²", {"vibration_mps2": ""}),
            ("specific force", "m/s²", {name: f" {way}" for name, way in FORCES.items()}),
        ]
        self._ranges = ranges
        self._groups = [group for group in groups if set(group[2]) <= set(ranges)]
        self._rows = dict.fromkeys((what for what, _, _ in groups), 0)
        self._worst: dict[str, tuple[float, str, float]] = {}

    def look_at(self, corrected: Array, hold: HoldConditions) -> None:
        """Count calibrated forces (n, 3), m/s², and their conditions."""
        columns = {
            "temperature_degC": hold.temperature,
            "vibration_mps2": hold.vibration,
            **dict(zip(FORCES, corrected.T, strict=True)),
        }
        for what, _, names in self._groups:
            beyond = np.zeros(len(corrected), dtype=bool)
            for name in names:
                values = columns[name]
                if values is None:
                    continue
                low, high = self._ranges[name]
                # In parts of the width, so that axes can be compared; NaN does not count.
                excess = np.fmax(low - values, values - high) / max(high - low, 1e-9)
                beyond |= excess > MARGIN
                if (excess > MARGIN).any():
                    i = int(np.nanargmax(excess))
                    farthest = (float(excess[i]), name, float(values[i]))
                    self._worst[what] = max(farthest, self._worst.get(what, farthest))
            self._rows[what] += int(beyond.sum())

    def warnings(self, rows: int) -> Iterator[str]:
        """Say what lay beyond a range in a log of so many rows."""
        for what, unit, names in self._groups:
            if what in self._worst:
                _, name, value = self._worst[what]
                low, high = self._ranges[name]
                yield (
                    f"{what} outside the range of the calibration in {self._rows[what]} of "
                    f"{counted(rows, 'row')}: up to {value:.4g} {unit}{names[name]}, while the "
                    f"calibration had {low:.4g} to {high:.4g}; it is extrapolated there"
                )
