"""Groups of regressors, each one space: what varies with direction, with time and so on."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.errors import InputError
from accelstudy.diagnosis.space.examined import ExaminedFit
from accelstudy.diagnosis.space.frame import Frame
from accelstudy.diagnosis.space.repeats import clusters
from accelstudy.diagnosis.space.signatures import Moment, Signature, rate_of
from accelstudy.diagnosis.space.spaces import ABSORBED, Bases, LackOfFit, Repeats, Spaces, span
from accelstudy.effects import HoldConditions, effect_names, get_effect

Array = NDArray[np.float64]

ROBOT = "robot_angles"
"""Group of the effects on what a robot reads, and of its base."""
COURSES = ("slow_time", "temperature")
"""Groups of anything that depends smoothly on a column of the holds."""
REPEAT = "repeat"
"""Group of the differences of repeated positions."""
LACK_OF_FIT = "lack_of_fit"
"""Everything but the differences of repeated positions, which are noise alone (pure error)."""


def groups(examined: ExaminedFit) -> dict[str, Spaces]:
    """Groups that the campaign can show, each one space; with repeats also the lack of fit.

    They leave something of the residuals, and the model does something of them.
    """
    r, found = examined.frame.residuals.redundancy, all_groups(examined)
    shown = {name for name, space in found.items() if 0 < space.dims[0] < r}
    return {n: q for n, q in found.items() if (REPEAT if n == LACK_OF_FIT else n) in shown}


def all_groups(examined: ExaminedFit) -> dict[str, Spaces]:
    """Groups whose columns are there, those as well of which nothing shows or in which all does."""
    residuals, hold, n = examined.frame.residuals, examined.frame.hold, len(examined.frame.forces)
    found: dict[str, Spaces] = {}

    def add(name: str, course: Callable[[Moment], Array]) -> None:
        """Enter a group given by changes of the sensor's output, (n, 3, k), in some holds."""
        change = residuals.by_observations[..., :3] @ course(Moment(hold))
        rate = rate_of(course, hold) if residuals.slopes else None
        add_rows(name, residuals.stacked(change, rate))

    def add_rows(name: str, rows: Array) -> None:
        projected = residuals.project(rows)
        basis = span(projected, np.linalg.norm(rows, axis=0), ABSORBED)[1]
        found[name] = Bases(basis, np.array([basis.shape[1]]))

    for name, signatures in _signatures(examined.frame).items():
        rows = [residuals.whitened(s) for s in signatures]
        if name == ROBOT and np.ptp(hold.column("yaw")) > 0:
            change = residuals.by_observations[..., :3] @ _of_yaw(hold.column("yaw"))
            rows.append(residuals.stacked(change))
        add_rows(name, np.concatenate(rows, axis=1))
    if hold.time is not None and np.ptp(hold.time) > 0:
        add("slow_time", _slow_course(hold, examined.frame.forces))
    if hold.temperature is not None and np.ptp(hold.temperature) > 0:
        add("temperature", _thermal_course(hold, examined.frame.forces))
    labels = clusters(examined.frame.forces)
    if len(np.unique(labels)) < n:
        same = LackOfFit.of(residuals, labels)
        found |= {REPEAT: Repeats(same, residuals.redundancy), LACK_OF_FIT: same}
    return found


def _of_yaw(yaw: Array) -> Array:
    """Biases that vary with the yaw of the robot, once and twice per turn, as changes (n, 3, k)."""
    return _per_axis(np.column_stack([f(k * yaw) for k in (1, 2) for f in (np.sin, np.cos)]))


def _slow_course(hold: HoldConditions, forces: Array) -> Callable[[Moment], Array]:
    """Biases that change smoothly in the time of holds, and scales that do in proportion to it."""
    unit = _between(hold.column("time"))

    def course(at: Moment) -> Array:
        t = unit(at.time)
        bias = np.asarray(np.polynomial.legendre.legvander(t, 4), dtype=float)[:, 1:]
        scale = np.einsum("na,ab->nab", t[:, None] * forces, np.eye(3))
        return np.concatenate([_per_axis(bias), scale], axis=2)

    return course


def _thermal_course(hold: HoldConditions, forces: Array) -> Callable[[Moment], Array]:
    """Biases that change smoothly with temperature, and two orders of the scale in proportion."""
    unit = _between(hold.column("temperature"))

    def course(at: Moment) -> Array:
        t = unit(at.temperature)
        scales = [
            np.einsum("na,ab->nab", t[:, None] * part, np.eye(3)) for part in (forces, forces**2)
        ]
        return np.concatenate([_per_axis(np.column_stack([t, t**2])), *scales], axis=2)

    return course


def _between(values: Array) -> Callable[[Array], Array]:
    """Scale to −1 at the least of values and 1 at the largest."""
    return lambda at: 2 * (at - values.min()) / np.ptp(values) - 1


def _per_axis(values: Array) -> Array:
    """Regressors (n, k), separate for each axis, as changes (n, 3, 3k)."""
    return np.einsum("nk,ab->nabk", values, np.eye(3)).reshape(len(values), 3, -1)


def _signatures(frame: Frame) -> dict[str, list[Signature]]:
    """Signatures of the effects of each group that the campaign can show.

    Effects whose settings are searched finely are left out: they have no single space. The groups
    of `COURSES` hold any smooth course, which is more than their effects.
    """
    found: dict[str, list[Signature]] = {}
    for effect in map(get_effect, effect_names()):
        if not effect.group or effect.group in COURSES or any(h.smooth for h in effect.takes):
            continue
        if effect.group == ROBOT and not frame.solution.approach.uses_angles:
            continue
        shapes = effect.candidates(frame.hold, frame.forces, frame.solution.gravity)
        try:
            shown = frame.signatures(shapes, ideal=True)
        except InputError:  # a column is absent
            continue
        found.setdefault(effect.group, []).append(shown)
    return found
