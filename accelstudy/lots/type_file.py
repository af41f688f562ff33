"""The file of a type: its model, its parameters from sensor to sensor, and a data sheet."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import yaml

from accelstudy.basics.plugins import file_key
from accelstudy.campaign.sensor_type import TYPE_FILE, TypeFile, TypicalParameter
from accelstudy.data_sheets import DataSheet
from accelstudy.files.outputs import whole_file
from accelstudy.lots.parameters import TypeParameter

if TYPE_CHECKING:
    from accelstudy.lots.output import Lot

SHEET = {
    "bias": "bias",
    "scale": "scale",
    "nonorthogonality": "nonorthogonality",
    "thermal_bias": "bias_per_kelvin",
    "thermal_scale": "scale_per_kelvin",
}
"""Quantities of a data sheet, by the effect whose parameters are of that size."""
BOUND_PROBABILITY = 0.9
"""Probability with which the scatter is below its bound."""


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
    parameters = {
        name: _typical(lot.parameters[name], sensors, bool(stays))
        for name, stays in zip(model.parameter_names, model.stays, strict=True)
        if name in wanted
    }
    content = {
        **file_key(),
        **_sheet(lot, parameters).content,
        **TypeFile(
            schema_version=1,
            models={"type": [effect.spec for effect in lasting]},
            sensors=sensors,
            parameters=parameters,
        ).model_dump(),
    }
    with whole_file(folder / TYPE_FILE) as path:
        text = yaml.safe_dump(content, sort_keys=False, allow_unicode=True, width=96)
        path.write_text(text, encoding="utf-8")
    return True


def _typical(parameter: TypeParameter, sensors: int, stays: bool) -> TypicalParameter:
    """Mean and scatter of a parameter, as the next sensor may have it.

    Parameters
    ----------
    parameter : TypeParameter
    sensors : int, that are usual and were calibrated
    stays : bool, whether it belongs to the sensor
    """
    having = 0 if parameter.of_type is None else len(parameter.of_type.values)
    if not having:  # the campaigns of the other sensors tell of it
        parameter = replace(parameter, has=parameter.usual)
    _, below = parameter.scatter_interval(2 * BOUND_PROBABILITY - 1)
    return TypicalParameter(
        mean=parameter.mean,
        sigma=parameter.sigma,
        scatter=parameter.scatter,
        scatter_below=below if np.isfinite(below) else 0.0,
        unit=parameter.unit,
        in_all=stays and 1 < having == sensors,
    )


def _sheet(lot: Lot, parameters: dict[str, TypicalParameter]) -> DataSheet:
    """Noise of a position mean, which is that of the median sensor, and errors when it is new."""
    title = f"{len(lot.usual)} sensors of a type"
    sensors = lot.diagnosis.sensors
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
