"""The file of a type: its model, its parameters from sensor to sensor, and a data sheet."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

from accelstudy.adjustment.random_effects import RandomEffects
from accelstudy.basics.errors import InputError
from accelstudy.basics.plugins import as_a_key
from accelstudy.campaign.calibration.fit import CampaignFit
from accelstudy.campaign.of_type import TYPE_FILE, TypeFile, TypicalParameter
from accelstudy.data_sheets import DataSheet
from accelstudy.effects import Effect
from accelstudy.files.outputs import whole_file
from accelstudy.lots.lot import Lot, variances
from accelstudy.sensors.models import compose

SHEET = {
    "bias": "bias",
    "scale": "scale",
    "nonorthogonality": "nonorthogonality",
    "thermal_bias": "bias_per_kelvin",
    "thermal_scale": "scale_per_kelvin",
}
"""Quantities of a data sheet, by the effect whose parameters are of that size."""
BOUND = 0.9
"""Probability with which the scatter is below its bound."""


def write_type(lot: Lot, fits: Sequence[CampaignFit | InputError], folder: str | Path) -> bool:
    """Write type.yaml: for `--model`, `--prior`, and as a data sheet for `plan --sensor`.

    Odd sensors do not count, and what is sudden is no matter of the type.

    Parameters
    ----------
    lot : Lot
    fits : of `calibrations`
    folder : path

    Returns
    -------
    bool
        Whether there is one; not if fewer than two sensors were calibrated.
    """
    used = lot.usual(fits)
    if len(used) < 2:
        return False
    lasting = [effect for effect in lot.model.effects if not effect.sudden]
    parameters = _typical(lot, lasting, used)
    content = {
        **as_a_key(),
        **_sheet(lot, parameters, used).content,
        **TypeFile(
            schema_version=1,
            models={"type": [effect.spec for effect in lasting]},
            sensors=len(used),
            parameters=parameters,
        ).model_dump(),
    }
    with whole_file(Path(folder) / TYPE_FILE) as path:
        text = yaml.safe_dump(content, sort_keys=False, allow_unicode=True, width=96)
        path.write_text(text, encoding="utf-8")
    return True


def _typical(
    lot: Lot, lasting: Sequence[Effect], fits: Sequence[CampaignFit]
) -> dict[str, TypicalParameter]:
    """Mean and scatter of each parameter; of an effect, over the sensors that have it."""
    each = {campaign: names for campaign, names, _ in lot.each()}
    rows: dict[str, NDArray[np.bool_]] = {}
    for found, spec in lot.effects:
        if spec is not None:
            has = np.array([found.names[0] in each[fit.campaign.name] for fit in fits])
            rows |= dict.fromkeys(compose(spec, (spec,)).parameter_names, has)
    everyone = np.ones(len(fits), dtype=bool)
    values = np.array([fit.parameters for fit in fits])
    squares = np.array([variances(lot, fit) for fit in fits])
    typical = {}
    wanted = {parameter for effect in lasting for parameter in effect.parameters}
    for j, parameter in enumerate(lot.model.parameters):
        if parameter not in wanted:
            continue
        told = rows.get(parameter.name, everyone)
        # Where no campaign of those that have it could be calibrated, the others tell of it.
        has = told if told.any() else everyone
        of_type = RandomEffects(values[has, j], squares[has, j], np.ones((has.sum(), 1)))
        some = of_type.dof > 0
        typical[parameter.name] = TypicalParameter(
            mean=float(of_type.estimates[0]),
            sigma=float(np.sqrt(of_type.covariance[0, 0])),
            scatter=of_type.scatter,
            scatter_below=of_type.scatter_interval(2 * BOUND - 1)[1] if some else 0.0,
            unit=parameter.unit,
            in_all=some and bool(lot.model.stays[j] and told.all()),
        )
    return typical


def _sheet(
    lot: Lot, parameters: dict[str, TypicalParameter], fits: Sequence[CampaignFit]
) -> DataSheet:
    """Noise of a position mean, which is that of the median sensor, and errors when it is new."""
    title = f"{len(fits)} sensors of a type"
    sigmas = [
        fit.sigma_position if noise is None else noise.sigma
        for fit in fits
        for noise in [lot.noises[fit.campaign.name]]
    ]
    values: dict[str, Any] = {"position_sigma": float(np.median(sigmas))}
    for effect in lot.model.effects:
        if (quantity := SHEET.get(effect.name)) is not None:
            of_effect = [parameters[parameter.name] for parameter in effect.parameters]
            squares = [one.mean**2 + one.scatter**2 for one in of_effect]
            values[quantity] = float(np.sqrt(np.mean(squares)))
    sources = dict.fromkeys(values, title)
    return DataSheet("type", title, "accelstudy lot", sources=sources, **values)
