"""The file of a type: its model, the mean and the scatter of each parameter, and a data sheet."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from accelstudy.basics.plugins import file_key
from accelstudy.campaign.sensor_type import TYPE_FILE, TypeFile
from accelstudy.data_sheets import DataSheet
from accelstudy.files.outputs import write_yaml
from accelstudy.lots.calibration import LotCalibration
from accelstudy.lots.type_parameter import TypeParameter

SHEET = {
    "bias": "bias",
    "scale": "scale",
    "nonorthogonality": "nonorthogonality",
    "thermal_bias": "bias_per_kelvin",
    "thermal_scale": "scale_per_kelvin",
}
"""Quantities of a data sheet, by the effect whose parameters are of that size."""


def write_type(lot: LotCalibration, folder: Path) -> bool:
    """Write type.yaml: for `--model`, `--prior`, and as a data sheet for `plan --sensor`.

    Odd sensors do not count, and what is sudden is no matter of the type.

    Parameters
    ----------
    lot : LotCalibration
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
    parameters = {name: one for name, one in lot.parameters.items() if name in wanted}
    sheet = {**file_key(), **_sheet(lot, parameters).content}
    content = TypeFile.content({
        **sheet,
        "models": {"type": [effect.spec for effect in lasting]},
        "sensors": sensors,
        "parameters": parameters,
    })  # fmt: skip
    content = {name: content[name] for name in (*sheet, *content)}  # name and title first
    write_yaml(folder / TYPE_FILE, content, width=96)
    return True


def _sheet(lot: LotCalibration, parameters: dict[str, TypeParameter]) -> DataSheet:
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
