"""Where a disagreement lives: the share of the excess χ² that a group of regressors takes up."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from accelstudy.diagnosis.evidence.chance import Chance
from accelstudy.diagnosis.space.hypotheses import Frame, Setting, span
from accelstudy.diagnosis.space.repeats import clusters
from accelstudy.diagnosis.space.residuals import Residuals
from accelstudy.diagnosis.space.signatures import Signature, signature
from accelstudy.diagnosis.space.spaces import ABSORBED, Bases, LackOfFit, Repeats, Spaces
from accelstudy.effects import effect_names, get_effect
from accelstudy.errors import InputError

Array = NDArray[np.float64]

ROBOT = "robot_angles"
"""Group of the effects on what a robot reads, and of its base."""
COURSES = ("slow_time", "temperature")
"""Groups of whatever depends smoothly on a column of the holds."""
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

    for name, signatures in _signatures(setting.frame).items():
        add_rows(name, np.concatenate([residuals.whitened(s) for s in signatures], axis=1))
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


def _signatures(frame: Frame) -> dict[str, list[Signature]]:
    """Signatures of the effects of each group that the campaign can show.

    An effect whose shape is searched finely has no space of its own. Groups of `COURSES` have what
    any smooth course can do, which is more than their effects.
    """
    found: dict[str, list[Signature]] = {}
    for effect in map(get_effect, effect_names()):
        if not effect.group or effect.group in COURSES or any(h.smooth for h in effect.hypers):
            continue
        if effect.group == ROBOT and not frame.solution.approach.uses_angles:
            continue
        g = frame.solution.gravity
        try:
            shown = [
                signature(shape, frame.forces, frame.angles, g, frame.hold)
                for shape in effect.candidates(frame.hold, frame.forces, g)
            ]
        except InputError:  # a column is absent
            continue
        found.setdefault(effect.group, []).extend(shown)
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
