"""Where a disagreement lives: the share of the excess χ² that a group of regressors takes up."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from accelstudy.diagnosis.evidence.chance import Chance
from accelstudy.diagnosis.space.hypotheses import Setting, span
from accelstudy.diagnosis.space.repeats import clusters
from accelstudy.diagnosis.space.residuals import Residuals
from accelstudy.diagnosis.space.signatures import signature
from accelstudy.diagnosis.space.spaces import ABSORBED, Bases, LackOfFit, Repeats, Spaces
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
LACK_OF_FIT = "lack_of_fit"
"""Everything but the differences of repeated positions, which are noise alone (pure error)."""


def groups(setting: Setting) -> dict[str, Spaces]:
    """Groups that the campaign can show, each one space; beside repeats also the lack of fit."""
    residuals, hold, n = setting.frame.residuals, setting.frame.hold, len(setting.frame.forces)
    found: dict[str, Spaces] = {}

    def add(name: str, change: Array) -> None:
        """Enter a group given by changes of the sensor's output, (n, 3, k)."""
        add_rows(name, residuals.stacked(residuals.by_observations[..., :3] @ change))

    def add_rows(name: str, rows: Array) -> None:
        projected = residuals.project(rows)
        basis = span(projected, np.linalg.norm(rows, axis=0), ABSORBED)[1]
        if 0 < basis.shape[1] < residuals.redundancy:
            found[name] = Bases(basis, np.array([basis.shape[1]]))

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
    if len(np.unique(labels)) < n:
        same = LackOfFit.of(residuals, labels)
        repeats = Repeats(same, residuals.redundancy)
        if 0 < repeats.dims[0] < residuals.redundancy:
            found |= {"repeat": repeats, LACK_OF_FIT: same}
    return found


def locate(
    found: Mapping[str, Spaces],
    bumped: Spaces | None,
    residuals: Residuals,
    chance: Chance,
    variance: float,
) -> dict[str, float]:
    """Share of the excess χ² in the space of each group, in [0, 1].

    Parameters
    ----------
    found : what `groups` returned
    bumped : hypotheses of single positions, if there are any
    residuals : Residuals
    chance : Chance, residuals without any effect
    variance : float, of unit weight, of the noise
    """
    z = residuals.z
    names = [name for name in found if name != LACK_OF_FIT]
    excess = float(z @ z) / variance - residuals.redundancy
    if excess <= 0:
        return {name: 0.0 for name in (*names, "single_position")}

    def share(part: float, expected: float) -> float:
        return float(np.clip((part / variance - expected) / excess, 0.0, 1.0))

    shares = {n: share(float(found[n].parts(z)[0]), float(found[n].dims[0])) for n in names}
    if bumped is not None:
        usual = chance.statistic(residuals, lambda errors: bumped.parts(errors).max(axis=-1))
        shares["single_position"] = share(float(bumped.parts(z).max()), float(np.mean(usual)))
    return shares
