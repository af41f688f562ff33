"""A type of sensors: its parameters from sensor to sensor, and its file.

The file has the model of the type, the mean and the scatter of each parameter, and a data sheet.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import yaml
from numpy.typing import NDArray

from accelstudy.adjustment.random_effects import RandomEffects
from accelstudy.basics.plugins import file_key
from accelstudy.campaign.sensor_type import TYPE_FILE, TypeFile
from accelstudy.data_sheets import DataSheet
from accelstudy.files.outputs import whole_file

if TYPE_CHECKING:
    from accelstudy.lots.output import Lot

Array = NDArray[np.float64]

SHEET = {
    "bias": "bias",
    "scale": "scale",
    "nonorthogonality": "nonorthogonality",
    "thermal_bias": "bias_per_kelvin",
    "thermal_scale": "scale_per_kelvin",
}
"""Quantities of a data sheet, by the effect whose parameters are of that size."""


@dataclass(frozen=True, eq=False)
class TypeParameter:
    """A parameter over the sensors of a lot.

    Attributes
    ----------
    name, unit : str, SI
    stays : bool, whether it belongs to the sensor, and not to its mounting
    values, sigmas : (n,) arrays, of the sensors; NaN where a campaign cannot show it
    usual, has : (n,) bool arrays, whether a sensor is not odd, and whether it has the parameter
    """

    name: str
    unit: str
    stays: bool
    values: Array
    sigmas: Array
    usual: NDArray[np.bool_]
    has: NDArray[np.bool_]

    @cached_property
    def told(self) -> NDArray[np.bool_]:
        """Usual sensors that have it, and whose campaigns show it, (n,)."""
        return self.usual & self.has & np.isfinite(self.values) & np.isfinite(self.sigmas)

    @cached_property
    def of_type(self) -> RandomEffects:
        """Mean and scatter over these sensors; those of one that is not known if there are none."""
        values, sigmas = self.values[self.told], self.sigmas[self.told]
        if not len(values):
            values, sigmas = np.full((2, 1), np.nan)
        return RandomEffects(values, sigmas**2, np.ones((len(values), 1)))

    @property
    def mean(self) -> float:
        """Mean of the type."""
        return float(self.of_type.estimates[0])

    @property
    def sigma(self) -> float:
        """Sigma of the mean."""
        return float(np.sqrt(self.of_type.covariance[0, 0]))

    @property
    def scatter(self) -> float:
        """Scatter from sensor to sensor, an sd."""
        return self.of_type.scatter

    @property
    def scatter_ci95(self) -> tuple[float, float]:
        """Interval that holds the scatter with a probability of 95 %; that of one has no end."""
        return self.of_type.scatter_interval(0.95) if self.of_type.dof else (0.0, np.inf)

    @property
    def scatter_below(self) -> float:
        """Bound below which the scatter is with a probability of 90 %; 0 if one sensor tells it."""
        return self.of_type.scatter_interval(0.8)[1] if self.of_type.dof else 0.0

    @property
    def in_all(self) -> bool:
        """Whether the next sensor has it, too: all that are usual and calibrated have it."""
        calibrated = self.usual & np.isfinite(self.values)
        return self.stays and 1 < np.count_nonzero(self.told) == np.count_nonzero(calibrated)


def write_type(lot: Lot, folder: Path) -> bool:
    """Write type.yaml: for `--model`, `--prior`, and as a data sheet for `plan --sensor`.

    Odd sensors do not count, and what is sudden is no matter of the type.

    Parameters
    ----------
    lot : Lot
    folder : Path

    Returns
    -------
    bool
        Whether there is one; not if fewer than two sensors were calibrated.
    """
    if (sensors := len(lot.usual)) < 2:
        return False
    model = lot.diagnosis.model
    lasting = [effect for effect in model.effects if not effect.sudden]
    wanted = {parameter.name for effect in lasting for parameter in effect.parameters}
    # Of what none of the usual sensors has for sure, the campaigns of all tell; the next one may
    # not have it, as of what belongs to a mounting.
    parameters = {
        name: one if one.told.any() else replace(one, has=one.usual, stays=False)
        for name, one in lot.parameters.items()
        if name in wanted
    }
    sheet = {**file_key(), **_sheet(lot, parameters).content}
    content = TypeFile.content({
        **sheet,
        "models": {"type": [effect.spec for effect in lasting]},
        "sensors": sensors,
        "parameters": parameters,
    })  # fmt: skip
    with whole_file(folder / TYPE_FILE) as path:
        content = {name: content[name] for name in (*sheet, *content)}  # name and title first
        text = yaml.safe_dump(content, sort_keys=False, allow_unicode=True, width=96)
        path.write_text(text, encoding="utf-8")
    return True


def _sheet(lot: Lot, parameters: dict[str, TypeParameter]) -> DataSheet:
    """Noise of a position mean, which is that of the median sensor, and errors when it is new."""
    title = f"{len(lot.usual)} sensors of a type"
    sensors = lot.diagnosis.last.sensors
    sigmas = [
        fit.sigma_position if (noise := sensors[i].noise) is None else noise.sigma
        for i, fit in lot.usual.items()
    ]
    values: dict[str, Any] = {"position_sigma": float(np.median(sigmas))}
    for effect in lot.diagnosis.model.effects:
        if (quantity := SHEET.get(effect.name)) is not None:
            of_effect = [parameters[parameter.name] for parameter in effect.parameters]
            squares = [one.mean**2 + one.scatter**2 for one in of_effect]
            values[quantity] = float(np.sqrt(np.mean(squares)))
    sources = dict.fromkeys(values, title)
    return DataSheet("type", title, "accelstudy lot", sources=sources, **values)
