"""Shares of the variance of roll and pitch in use: calibration, noise, time and temperature.

A reading in the field has the errors of the calibration, its own noise, and the changes of the
sensor since: its bias drifted with time, it was switched off and on, and bias and scales changed
with the temperature. These causes are independent, so their Shapley effects are their parts of the
variance. Within the calibration the parameters are correlated.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from accelstudy.basics.units import GON, MGON
from accelstudy.leveling.angles import specific_force
from accelstudy.leveling.sensitivity import FORCES, OUTPUTS
from accelstudy.leveling.shapley import linear_shapley
from accelstudy.leveling.shares import leveling_slope
from accelstudy.pole.sensor import CalibratedSensor

Array = NDArray[np.float64]

CALIBRATION = "calibration"
RESTART = "restart"
AGES = np.geomspace(60.0, 1e4 * 3600, 30)
"""Times since the calibration, s, over which shares are shown."""
KELVINS = np.geomspace(0.1, 40.0, 30)
"""Temperature differences, K, over which shares are shown."""


@dataclass(frozen=True)
class Use:
    """How a calibrated sensor is used.

    Attributes
    ----------
    averaging : float, s, over which a reading is averaged
    age : float, s, since the calibration
    temperature_change : float, K, difference from the temperature of the calibration
    restarted : bool, whether the sensor was switched off and on since the calibration
    """

    averaging: float = 2.0
    age: float = 8 * 3600.0
    temperature_change: float = 10.0
    restarted: bool = True


@dataclass(frozen=True)
class Errors:
    """Independent errors of one kind, one for each axis.

    Attributes
    ----------
    source : str, name of the kind
    names : tuple of str, of its inputs
    sigma : float, SI
    of_force : bool, whether they are proportional to the force, instead of added to it
    """

    source: str
    names: tuple[str, ...]
    sigma: float
    of_force: bool = False


def errors_in_use(sensor: CalibratedSensor, use: Use) -> tuple[Errors, ...]:
    """List the errors besides those of the calibration; unknown ones of the data sheet are zero."""
    sheet = sensor.sheet
    bias, scale = sensor.warmed(use.temperature_change)
    biases, scales = ("b_x", "b_y", "b_z"), ("s_x", "s_y", "s_z")
    return (
        Errors("noise", FORCES, sheet.sigma_mean(use.averaging)),
        Errors("drift", biases, sheet.bias_change(use.age)),
        Errors(RESTART, biases, sheet.bias_change(0.0, restarted=use.restarted)),
        Errors("temperature", biases, bias),
        Errors("temperature", scales, scale, of_force=True),
    )


def shares_in_use(sensor: CalibratedSensor, use: Use, attitudes: Array) -> pd.DataFrame:
    """Shapley effects of all inputs in one use, by linear theory.

    Parameters
    ----------
    sensor : CalibratedSensor
    use : Use
    attitudes : (k, 2) array, rad, roll and pitch of the sensor

    Returns
    -------
    DataFrame
        roll_gon, pitch_gon, output, source, input, shapley_effect, sd_output_mgon
    """
    model, x, g = sensor.model, sensor.parameters, sensor.gravity
    f_b = np.stack(specific_force(attitudes[:, 0], attitudes[:, 1], g), axis=-1)
    hold = sensor.conditions(f_b, use.temperature_change)
    f_s = model.sense(f_b[:, None], x, g, hold)
    slope = leveling_slope(model, x, f_s, g, hold)[:, 0]
    by_force, by_parameters = slope[..., :3], slope[..., 3:]
    errors = errors_in_use(sensor, use)
    slopes = [by_parameters, *(by_force * (f_s if each.of_force else 1.0) for each in errors)]
    sigmas = np.repeat([each.sigma for each in errors], 3)
    u = model.n_parameters
    covariance = np.diag(np.concatenate([np.zeros(u), sigmas**2]))
    covariance[:u, :u] = sensor.covariance
    whole = np.concatenate(slopes, axis=-1)
    shares, variance = linear_shapley(whole.reshape(-1, whole.shape[-1]), covariance)

    inputs = [(CALIBRATION, name) for name in model.parameter_names]
    inputs += [(each.source, name) for each in errors for name in each.names]
    labels = [
        (roll, pitch, output, *each)
        for (roll, pitch), output, each in product(attitudes / GON, OUTPUTS, inputs)
    ]
    table = pd.DataFrame(labels, columns=["roll_gon", "pitch_gon", "output", "source", "input"])
    return table.assign(
        shapley_effect=shares.ravel(),
        sd_output_mgon=np.repeat(np.sqrt(variance), len(inputs)) / MGON,
    )


def field_shares(
    sensor: CalibratedSensor, use: Use, roll_gon: Sequence[float], pitch_gon: Sequence[float]
) -> pd.DataFrame:
    """Shares over a grid of attitudes: in one use, over time, and over the temperature.

    Over time the temperature is that of the calibration, so that it does not hide the drift.

    Parameters
    ----------
    sensor : CalibratedSensor
    use : Use
    roll_gon, pitch_gon : the grid

    Returns
    -------
    DataFrame
        Columns of `shares_in_use`, after `over` (use, time or temperature), hours and kelvin.
    """
    attitudes = np.array(list(product(roll_gon, pitch_gon))) * GON
    parts = []
    for over, each in _uses(use):
        table = shares_in_use(sensor, each, attitudes)
        table.insert(0, "over", over)
        table.insert(1, "hours", each.age / 3600)
        table.insert(2, "kelvin", each.temperature_change)
        parts.append(table)
    return pd.concat(parts, ignore_index=True)


def _uses(use: Use) -> Iterator[tuple[str, Use]]:
    yield "use", use
    for age in AGES:
        yield "time", replace(use, age=float(age), temperature_change=0.0)
    for kelvin in KELVINS:
        yield "temperature", replace(use, temperature_change=float(kelvin))


def parts_of_variance(table: pd.DataFrame) -> pd.DataFrame:
    """Variances by source, mgon², mean over attitudes and over roll and pitch.

    Parameters
    ----------
    table : DataFrame of `field_shares`

    Returns
    -------
    DataFrame
        A row for each over, hours and kelvin; a column for each source.
    """
    variance = table["shapley_effect"] * table["sd_output_mgon"] ** 2
    keys = ["over", "hours", "kelvin"]
    outputs = table.groupby(keys)[["roll_gon", "pitch_gon", "output"]].nunique().prod(axis=1)
    sums = table.assign(variance=variance).pivot_table("variance", keys, "source", "sum")
    return sums.div(outputs, axis=0)[list(dict.fromkeys(table["source"]))]
