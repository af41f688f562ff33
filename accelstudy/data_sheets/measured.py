"""A data sheet from measurements: Allan deviation of a log, noise of a campaign, or a history."""

from __future__ import annotations

import math
from dataclasses import replace
from operator import itemgetter
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import nnls

from accelstudy.basics.arrays import Array
from accelstudy.basics.errors import InputError
from accelstudy.campaign.format import read_campaign
from accelstudy.campaign.importing.allan import MIN_DIFFERENCES, AllanDeviation
from accelstudy.campaign.importing.logs import import_log
from accelstudy.campaign.importing.settings import ImportSettings
from accelstudy.data_sheets.sheet import FLICKER, DataSheet
from accelstudy.effects import get_effect
from accelstudy.epochs.course import YEAR
from accelstudy.epochs.file_format import HistoryDocument

MIN_GAIN = 2.71
"""Gain in deviance from which on a kind of noise is there, or the shortest averaging time is left
out: χ² of a one-sided 5 %, of which white noise shows a random walk in 5 % of logs and a bias
instability in 10 %."""
INDEPENDENT_SHARE = 3 / 8
"""Values of an Allan deviation within two octaves, eight of them, count as three."""
MAX_STEPS = 50
"""Steps in which the weights of a fit become those of what it expects."""


def sheet_of_log(path: str | Path, settings: ImportSettings) -> DataSheet:
    """Data sheet of a sensor from a log in which it rests, once or in several positions.

    Raises
    ------
    InputError
        If the log cannot be read, has no static hold, or is too short for an Allan deviation.
    """
    _, holds = import_log(path, settings)
    assert holds is not None
    return sheet_of_allan(holds.noise.allan, Path(path).stem, str(path))


def sheet_of_allan(curve: AllanDeviation, name: str, source: str) -> DataSheet:
    """Fit σ²(τ) = N²/τ + (0.664 B)² + K²τ/3 to an Allan deviation.

    None of the three is negative, and B and K are there only if they explain the curve better than
    chance would. At the shortest averaging times a low-pass filter of the sensor makes noise less;
    as many are left out as differ from the others by more than chance. A variance with ν degrees of
    freedom has a gamma distribution.

    Raises
    ------
    InputError
        If there are too few values, or none shows white noise.
    """
    usable = (curve.differences >= MIN_DIFFERENCES) & (curve.pooled > 0)
    if np.count_nonzero(usable) < 3:
        raise InputError(f"{source}: too short at rest for an Allan deviation")
    tau, variance = curve.tau[usable], curve.pooled[usable] ** 2
    dof = INDEPENDENT_SHARE * curve.deviation.shape[1] * curve.differences[usable]
    kinds = np.column_stack([1 / tau, np.ones_like(tau), tau])

    def fit(first: int, chosen: tuple[int, ...]) -> tuple[float, Array]:
        """Deviance with penalties for what is chosen and left out, and squares of all sizes."""
        squares, expected = np.zeros(3), variance[first:]
        for _ in range(MAX_STEPS):
            weight = np.sqrt(dof[first:]) / expected
            weighted = kinds[first:, chosen] * weight[:, None]
            squares[[*chosen]], _ = nnls(weighted, variance[first:] * weight)
            expected = kinds[first:] @ squares
        ratio = variance[first:] / expected
        deviance = np.sum(dof[first:] * (ratio - 1 - np.log(ratio)))
        return float(deviance) + MIN_GAIN * (len(chosen) + first), squares

    best = math.inf, np.zeros(3)
    for first in range(len(tau) - 2):
        if MIN_GAIN * first > best[0]:
            break
        each = [fit(first, chosen) for chosen in ((0,), (0, 1), (0, 2), (0, 1, 2))]
        best = min(best, *each, key=itemgetter(0))
    n, b, k = best[1]
    if n == 0:
        raise InputError(f"{source}: no white noise in its Allan deviation; is it filtered?")
    values: dict[str, Any] = {
        "velocity_random_walk": math.sqrt(n),
        "bias_instability": math.sqrt(b) / FLICKER or None,
        "acceleration_random_walk": math.sqrt(3 * k) or None,
    }
    longest = f"Allan deviation of {source} up to {tau[-1]:.3g} s"
    sources = {key: longest for key, value in values.items() if value is not None}
    return DataSheet(name, f"the sensor of {source}", longest, **values, sources=sources)


def sheet_of_campaign(folder: str | Path) -> DataSheet:
    """Data sheet of the sensor of a campaign, which states only the noise of its positions.

    Raises
    ------
    InputError
        If the folder is not a campaign, or the campaign does not state its noise.
    """
    campaign = read_campaign(folder)
    if campaign.sigma_force is None:
        raise InputError(f"{folder}: the campaign does not state the noise of its positions")
    source = f"sigma of the campaign {campaign.name}"
    return DataSheet(
        campaign.name,
        campaign.header.sensor or f"the sensor of the campaign {campaign.name}",
        source,
        position_sigma=campaign.sigma_force,
        sources={"position_sigma": source},
    )


def with_history(sheet: DataSheet, path: str | Path) -> DataSheet:
    """Put the scatter and the drift of the biases, rms over the axes, into a data sheet.

    The repeatability is the change from one session to the next, √2 times the scatter. The square
    of a rate is that of its estimate and that of its sigma together, as of a drift of that size.

    Raises
    ------
    InputError
        If it is no history, none of a bias, or one of two calibrations.
    """
    document = HistoryDocument.read(path)
    names = [parameter.name for parameter in get_effect("bias").parameters]
    biases = [parameter for parameter in document.parameters if parameter.name in names]
    if not biases:
        raise InputError(f"{path}: parameters: no bias; take calibrations whose model has one")
    rates, scatters = [each.rate for each in biases], [each.scatter for each in biases]
    if None in rates or None in scatters:
        raise InputError(f"{path}: parameters: no rates; take a history of three calibrations")
    scatter = np.sqrt(np.mean([each.sd**2 for each in scatters if each]))
    rate = np.sqrt(np.mean([each.per_year**2 + each.sigma**2 for each in rates if each]))
    return replace(
        sheet,
        repeatability=float(np.sqrt(2) * scatter),
        bias_rate=float(rate / YEAR),
        sources={**sheet.sources, "repeatability": str(path)},
        assumed=sheet.assumed - {"repeatability"},
    )
