"""Groups of regressors, each one space: what varies with direction, with time and so on."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.errors import InputError
from accelstudy.diagnosis.space.examined import ExaminedFit, Frame
from accelstudy.diagnosis.space.hypotheses import Bases, Spaces
from accelstudy.diagnosis.space.residuals import ABSORBED, Residuals, span
from accelstudy.diagnosis.space.signatures import Moment, Signature, rate_of
from accelstudy.effects import HoldConditions, effect_names, get_effect

Array = NDArray[np.float64]

SAME_ATTITUDE = 0.05
"""Positions closer than this (chord of unit vectors) repeat each other, as those do that a person
turns back to by eye. What the model says of them may differ; of what it lacks, such as a square or
a cube of the force, they differ by some percent of it, which the test of lack of fit can bear."""

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
    r, spaces = examined.frame.residuals.redundancy, all_groups(examined)
    shown = {name for name, space in spaces.items() if 0 < space.dims[0] < r}
    return {n: q for n, q in spaces.items() if (REPEAT if n == LACK_OF_FIT else n) in shown}


def all_groups(examined: ExaminedFit) -> dict[str, Spaces]:
    """Groups whose columns are there, those as well of which nothing shows or in which all does."""
    residuals, hold, n = examined.frame.residuals, examined.frame.hold, len(examined.frame.forces)
    spaces: dict[str, Spaces] = {}

    def add(name: str, course: Callable[[Moment], Array]) -> None:
        """Enter a group given by changes of the sensor's output, (n, 3, k), in some holds."""
        change = residuals.by_observations[..., :3] @ course(Moment(hold))
        rate = rate_of(course, hold) if residuals.slopes else None
        add_rows(name, residuals.stacked(change, rate))

    def add_rows(name: str, rows: Array) -> None:
        projected = residuals.project(rows)
        basis = span(projected, np.linalg.norm(rows, axis=0), ABSORBED)[1]
        spaces[name] = Bases(basis, np.array([basis.shape[1]]))

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
        if hold.time is not None and np.ptp(rate := _rate_of_ramps(hold.time, hold.temperature)):
            # As gradients of the temperature within a sensor make them.
            add("temperature_rate", lambda _: _per_axis(rate[:, None] / np.ptp(rate)))
    labels = clusters(examined.frame.forces)
    if len(np.unique(labels)) < n:
        same = LackOfFit.of(residuals, labels)
        spaces |= {REPEAT: Repeats(same, residuals.redundancy), LACK_OF_FIT: same}
    return spaces


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


def _rate_of_ramps(time: Array, values: Array) -> Array:
    """Rate of values (n,) in each hold, (n,): the smaller of those before and after it.

    Where a ramp begins or ends beside a hold, the mean of the two would be half a rate in a rest.
    """
    at = np.unique(time, return_index=True)[1]
    if len(at) < 2:
        return np.zeros(len(time))
    rates = np.diff(values[at]) / np.diff(time[at])
    before, after = np.append(rates[:1], rates), np.append(rates, rates[-1:])
    smaller = np.where(np.abs(before) < np.abs(after), before, after)
    return np.interp(time, time[at], np.where(before * after > 0, smaller, 0.0))


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
    by_group: dict[str, list[Signature]] = {}
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
        by_group.setdefault(effect.group, []).append(shown)
    return by_group


@dataclass(frozen=True)
class LackOfFit:
    """All that positions of one attitude have in common: everything but their differences.

    A change of conditions by t that is the same in all positions of an attitude is L_iᵀ t at unit
    weight (but for what varies between them). Of these directions, orthonormal within each
    attitude, those are left that the model does not absorb.

    Attributes
    ----------
    order : (n,) int array, positions sorted by attitude
    starts : (a,) int array, where each attitude begins there
    weights : (n, c, c) array, W_i with Σ W_i e_i the coordinates (c,) of an attitude, sorted
    absorbed : (a c + k, l) array, orthonormal basis of what the model absorbs, in coordinates
    """

    order: NDArray[np.int_]
    starts: NDArray[np.int_]
    weights: Array
    absorbed: Array

    @classmethod
    def of(cls, residuals: Residuals, labels: NDArray[np.int_]) -> LackOfFit:
        """Of residuals whose positions have labels (n,), the same for the same attitude."""
        order = np.argsort(labels, kind="stable")
        starts = np.flatnonzero(np.diff(labels[order], prepend=-1))
        whitening = residuals.whitening[order]
        normal = np.add.reduceat(whitening @ np.swapaxes(whitening, 1, 2), starts, axis=0)
        inverse = np.linalg.inv(np.linalg.cholesky(normal))
        counts = np.diff(np.append(starts, len(labels)))
        same = cls(order, starts, np.repeat(inverse, counts, axis=0) @ whitening, np.empty((0, 0)))
        left, values, _ = np.linalg.svd(same._means(residuals.absorbed.T).T, full_matrices=False)
        return cls(order, starts, same.weights, left[:, values > ABSORBED])

    @property
    def dims(self) -> NDArray[np.int_]:
        """Its dimension, (1,)."""
        rows, absorbed = self.absorbed.shape
        return np.array([rows - absorbed])

    def parts(self, errors: Array) -> Array:
        """Squares of what residuals (..., m) have in it, (..., 1)."""
        same = self._means(errors)
        part = np.sum(same**2, axis=-1) - np.sum((same @ self.absorbed) ** 2, axis=-1)
        return np.maximum(part, 0.0)[..., None]

    def _means(self, errors: Array) -> Array:
        """Coordinates of residuals (..., m): of each attitude, and of observed gravity."""
        n, c = self.weights.shape[:2]
        blocks = errors[..., : n * c].reshape(*errors.shape[:-1], n, c)[..., self.order, :]
        weighted = np.einsum("ncd,...nd->...nc", self.weights, blocks)
        sums = np.add.reduceat(weighted, self.starts, axis=-2)
        return np.concatenate([sums.reshape(*errors.shape[:-1], -1), errors[..., n * c :]], axis=-1)


@dataclass(frozen=True)
class Repeats:
    """Differences between positions of one attitude: what lack of fit leaves of the residuals."""

    lack_of_fit: LackOfFit
    redundancy: int

    @property
    def dims(self) -> NDArray[np.int_]:
        """Its dimension, (1,)."""
        return self.redundancy - self.lack_of_fit.dims

    def parts(self, errors: Array) -> Array:
        """Squares of what residuals (..., m) have in it, (..., 1)."""
        total = np.sum(errors**2, axis=-1, keepdims=True)
        return np.maximum(total - self.lack_of_fit.parts(errors), 0.0)


def clusters(forces: NDArray[np.float64]) -> NDArray[np.int_]:
    """Label positions by attitude; positions with the same label repeat each other."""
    unit = forces / np.linalg.norm(forces, axis=1, keepdims=True)
    labels = -np.ones(len(unit), dtype=int)
    # Only positions alike in one coordinate need to be compared.
    order = np.argsort(unit[:, 0], kind="stable")
    x = unit[order, 0]
    first = np.searchsorted(x, unit[:, 0] - SAME_ATTITUDE)
    last = np.searchsorted(x, unit[:, 0] + SAME_ATTITUDE, side="right")
    for i in range(len(unit)):
        if labels[i] < 0:
            near = order[first[i] : last[i]]
            near = near[labels[near] < 0]
            labels[near[np.linalg.norm(unit[near] - unit[i], axis=1) < SAME_ATTITUDE]] = i
    return labels
