"""The mean of sensors that were in the same positions: one more campaign, with less noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from accelstudy.campaign.session import Campaign
from accelstudy.diagnosis.rules import RULES
from accelstudy.lots.evidence import Sensor, SensorEvidence
from accelstudy.lots.noise import LEAST_SIGMA, NoisePrior

COLUMNS = ("angles", "yaw", "time", "temperature", "vibration")
"""What a position has beside its forces."""
MAX_CONDITION_DIFFERENCE = 0.2
"""Largest difference of conditions that are the same, in parts of their range."""
MAX_DIRECTION_DIFFERENCE = 0.15
"""Largest difference of the directions of forces in positions that are the same."""


def mean_sensor(sensors: Sequence[Sensor], said: Sequence[SensorEvidence]) -> Sensor | None:
    """Average sensors that were in the same positions and conditions, in one order.

    What all of them have is as large in their mean, and the noise is smaller by the root of their
    number. Sensors whose noise is known by that of the lot have weights by it, and the others equal
    ones. The noise of the mean is told by their scatter about it. None if the positions differ.
    """
    n, campaigns = len(sensors), [sensor.campaign for sensor in sensors]
    if n < 2 or len({each.residuals.shape for each in said}) > 1:
        return None
    first = campaigns[0]
    if not all(_alike(first, other) for other in campaigns[1:]):
        return None
    table = np.array([each.residuals for each in said])
    variances = np.array([each.variance for each in said])
    alone = np.array([sensor.noise is None for sensor in sensors])
    if alone.any():  # an estimate of its own is no weight: one that is small by chance would count
        variances[alone] = variances[alone].mean()
    weights = variances.mean() / variances
    freedom = (n - 1) * min(each.redundancy for each in said)
    apart = table - np.average(table, axis=0, weights=weights)
    within = float(np.sum(weights @ apart**2)) / freedom
    sigma = max(float(np.sqrt(within / weights.sum())), LEAST_SIGMA)
    columns: dict[str, Any] = {
        name: np.average([getattr(one, name) for one in campaigns], axis=0, weights=weights)
        for name in ("forces", *COLUMNS)
        if getattr(first, name) is not None
    }
    if first.sigma_angle is not None:
        columns["sigma_angle"] = first.sigma_angle * float(np.linalg.norm(weights) / weights.sum())
    mean = replace(
        first, name="mean of the lot", sd=None, n_samples=None, sigma_force=sigma, **columns
    )
    noise = NoisePrior(sigma, min(float(freedom), RULES.freedom_given), doubt=0.0)
    return replace(sensors[0], campaign=mean, noise=noise)


def _alike(one: Campaign, other: Campaign) -> bool:
    """Whether two campaigns were in the same positions, in the same conditions."""
    if one.forces.shape != other.forces.shape:
        return False
    for name in COLUMNS:
        column, its = getattr(one, name), getattr(other, name)
        if (column is None) != (its is None):
            return False
        if column is not None:
            apart = np.max(abs(its - column))
            if apart > MAX_CONDITION_DIFFERENCE * np.ptp(column):
                return False
    a, b = (c.forces / np.linalg.norm(c.forces, axis=1, keepdims=True) for c in (one, other))
    return bool(np.max(abs(a - b)) < MAX_DIRECTION_DIFFERENCE)
