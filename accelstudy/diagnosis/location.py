"""Where a disagreement lives: the share of the excess χ² that a group of regressors takes up."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from accelstudy.diagnosis.hypotheses import Hypothesis, Setting, orthonormal, span
from accelstudy.diagnosis.repeats import clusters
from accelstudy.diagnosis.signatures import signature
from accelstudy.effects import get_effect
from accelstudy.errors import InputError

Array = NDArray[np.float64]

DIRECTION = (
    "cross_axis_misalignment",
    "quadratic_scale",
    "cubic_scale",
    "scale_asymmetry",
    "cross_coupling",
)
ROBOT = (
    "base_tilt",
    "encoder_offset",
    "encoder_scale",
    "encoder_eccentricity",
    "encoder_eccentricity(order=2)",
    "axis_nonperpendicularity",
)
PREVIOUS = ("hysteresis", "settling")


def groups(setting: Setting) -> dict[str, Array]:
    """Orthonormal bases (r, l) of the groups that the campaign can show."""
    residuals, hold, n = setting.frame.residuals, setting.frame.hold, len(setting.frame.forces)
    found: dict[str, Array] = {}

    def add(name: str, change: Array) -> None:
        """Enter a group given by changes of the sensor's output, (n, 3, k)."""
        add_rows(name, residuals.rows(residuals.jac_observations[..., :3] @ change))

    def add_rows(name: str, rows: Array) -> None:
        projected = residuals.project(rows)
        directions = span(projected, np.linalg.norm(rows, axis=0), 1e-2)
        if 0 < directions.shape[1] < residuals.redundancy:
            found[name] = orthonormal(projected @ directions)

    def per_axis(values: Array) -> Array:
        """Regressors (n, k), separate for each axis, as changes (n, 3, 3k)."""
        return np.einsum("nk,ab->nabk", values, np.eye(3)).reshape(n, 3, -1)

    for name, effects in (
        ("direction", DIRECTION),
        ("robot_angles", ROBOT),
        ("previous_position", PREVIOUS),
    ):
        if name == "robot_angles" and not setting.frame.solution.approach.uses_angles:
            continue
        parts = []
        for effect in effects:
            try:
                shown = signature(
                    get_effect(effect),
                    setting.frame.forces,
                    setting.frame.angles,
                    setting.frame.solution.gravity,
                    hold,
                )
            except InputError:
                continue
            parts.append(residuals.whitened(shown))
        if parts:
            add_rows(name, np.concatenate(parts, axis=1))
    if hold.time is not None and np.ptp(hold.time) > 0:
        t = 2 * (hold.time - hold.time.min()) / np.ptp(hold.time) - 1
        add("slow_time", per_axis(np.polynomial.legendre.legvander(t, 4)[:, 1:]))
    if hold.temperature is not None and np.ptp(hold.temperature) > 0:
        t = 2 * (hold.temperature - hold.temperature.min()) / np.ptp(hold.temperature) - 1
        linear = per_axis(np.column_stack([t, t**2]))
        scale = np.einsum("na,ab->nab", t[:, None] * setting.frame.forces, np.eye(3))
        add("temperature", np.concatenate([linear, scale], axis=2))
    labels = clusters(setting.frame.forces)
    contrasts = [
        (np.arange(n) == i).astype(float) - (labels == labels[i]) / np.sum(labels == labels[i])
        for i in range(n)
        if np.sum(labels == labels[i]) > 1
    ]
    if contrasts:
        add("repeat", per_axis(np.column_stack(contrasts)))
    return found


def locate(
    found: Mapping[str, Array], outliers: list[Hypothesis], z: Array, null: Array, variance: float
) -> dict[str, float]:
    """Share of the excess χ² in the space of each group, in [0, 1].

    Parameters
    ----------
    found : what `groups` returned
    outliers : hypotheses of single positions
    z : (r,) array
    null : (B, r) array, residuals without any effect
    variance : float, of unit weight, of the noise
    """
    excess = float(z @ z) / variance - len(z)
    if excess <= 0:
        return {name: 0.0 for name in (*found, "single_position")}

    def share(part: float, expected: float) -> float:
        return float(np.clip((part / variance - expected) / excess, 0.0, 1.0))

    shares = {name: share(float(np.sum((z @ q) ** 2)), q.shape[1]) for name, q in found.items()}
    if outliers:
        parts = [np.sum((z @ h.basis) ** 2) for h in outliers]
        usual = np.max([np.sum((null @ h.basis) ** 2, axis=1) for h in outliers], axis=0)
        shares["single_position"] = share(float(np.max(parts)), float(np.mean(usual)))
    return shares
