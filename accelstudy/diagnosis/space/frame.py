"""One calibrated session, in which effects are evaluated by their one definition.

The signature of an effect is what it would leave in the observations; what the model leaves of that
in the residuals is a hypothesis. All effects that the model does not have are candidates.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from accelstudy.adjustment.quality import Solution
from accelstudy.basics.arrays import Array
from accelstudy.basics.errors import InputError
from accelstudy.diagnosis.rules import RULES
from accelstudy.diagnosis.space.hypotheses import (
    OUTLIER,
    Hypotheses,
    Hypothesis,
    outlying_positions,
    same_space,
)
from accelstudy.diagnosis.space.residuals import Residuals, Signature, ideal_residuals, spans
from accelstudy.effects import Effect, HoldConditions, effect_names, get_effect
from accelstudy.leveling.angles import angles_of
from accelstudy.sensors.models import compose

ROUNDING = 1e-9
"""Share of a signature that rounding errors may leave where nothing is left."""
DIGITS = 6
"""Decimals to which cosines that are equal agree."""


class Candidates(NamedTuple):
    """What a session can show of all that its model may lack.

    Attributes
    ----------
    shapes : dict of name to shapes, what may be missing
    invisible : tuple of str, effects of rank 0
    untestable : dict of effect to the reason why it cannot be tested
    """

    shapes: Mapping[str, Hypotheses]
    invisible: tuple[str, ...]
    untestable: Mapping[str, str]


@dataclass(frozen=True)
class SessionFit:
    """One calibrated session, in which effects are evaluated.

    Attributes
    ----------
    solution : Solution
    residuals : Residuals
    ideal : Residuals, of an ideal sensor in the same positions
    forces : (n, 3) array, m/s², of the ideal sensor
    sensed : (n, 3) array, m/s², the same along the sensitive axes as the base fit finds them
    output : (n, 3) array, m/s², adjusted readings, on which effects act that act last
    angles : (n, 2) array, rad, attitude as the robot reads it, else as the forces show it
    hold : HoldConditions, with the attitude, and with yaw 0 where none is given
    """

    solution: Solution
    residuals: Residuals
    ideal: Residuals
    forces: Array
    sensed: Array
    output: Array
    angles: Array
    hold: HoldConditions

    @property
    def absent(self) -> tuple[str, ...]:
        """Columns that would tell what changes slowly, and that the campaign lacks."""
        return tuple(n for n in ("temperature", "time") if getattr(self.hold, n) is None)

    @property
    def course(self) -> str:
        """Column of the time, or of the order where there is none."""
        return "order" if self.hold.time is None else "time"

    @cached_property
    def _columns(self) -> HoldColumns:
        """Columns of the holds beside arrays of settings and parameters."""
        return HoldColumns(self.hold, 2)

    @classmethod
    def of(cls, solution: Solution) -> SessionFit:
        """Session of a calibration, at its solution."""
        ideal, forces = ideal_residuals(solution)
        observed, model = solution.observed, solution.model
        if observed.angles is not None and solution.approach.uses_angles:
            angles = np.asarray(observed.angles[0])
        else:
            angles = angles_of(forces)
        t = model.axes_matrix(solution.parameters[: model.n_parameters])
        hold = observed.hold or HoldConditions()
        yaw = np.zeros(len(angles)) if hold.yaw is None else hold.yaw
        return cls(
            solution=solution,
            residuals=Residuals.of(solution),
            ideal=ideal,
            forces=forces,
            sensed=np.asarray(np.linalg.solve(t, forces.T).T),
            output=observed.forces[0] + solution.residuals[:, :3],
            angles=angles,
            hold=replace(hold, roll=angles[:, 0], pitch=angles[:, 1], yaw=yaw),
        )

    def rows(self, effect: Effect) -> Array:
        """What an effect does to the conditions of unit weight, by its parameters, (m, k)."""
        return self.residuals.whiten(self.signatures((effect,)))

    def signatures(self, shapes: Sequence[Effect], ideal: bool = False) -> Signature:
        """Signatures of shapes of an effect of the sensor, or of an ideal one, side by side."""
        forces = self.forces if ideal else self.output if shapes[0].last else self.sensed
        shown = signatures(shapes, forces, self.angles, self.solution.gravity, self._columns)
        model = self.solution.model
        if ideal or shapes[0].last or not any(effect.last for effect in model.effects):
            return shown
        p = self.solution.parameters[: model.n_parameters]
        slope = model.slope_of_last(self.sensed, p, self.hold)
        return replace(shown, force=slope @ shown.force)

    def hypotheses(self, shapes: Sequence[Effect]) -> list[Hypothesis | None]:
        """Return what shapes of an effect would leave in the residuals; None for nothing."""
        if not shapes:
            return []

        def of_each(columns: Array) -> Array:
            """Columns (m, s k) of all shapes as those of each, (s, m, k)."""
            return np.moveaxis(columns.reshape(len(columns), len(shapes), -1), 1, 0)

        shown = self.signatures(shapes, ideal=True)
        projected = of_each(self.ideal.project(self.ideal.whiten(shown)))
        sizes = self.ideal.size(shown, self.solution.gravity).reshape(len(shapes), -1)
        directions, ideal, seen = spans(projected, sizes, RULES.visible)
        columns = of_each(self.residuals.project(self.residuals.whiten(self.signatures(shapes))))
        # A force that passes a knee at the ideal sensor may not do so along the real axes.
        sizes = np.linalg.norm(projected @ directions, axis=1)
        also, basis, rank = spans(columns @ directions, sizes, ROUNDING)
        for i in np.flatnonzero(rank < seen).tolist():
            directions[i] = directions[i] @ also[i]
            ideal[i] = spans((projected[i] @ directions[i])[None], None, ROUNDING)[1][0]
        bounded, found = np.isfinite(shapes[0].bounds).any(), list[Hypothesis | None]()
        for i, (effect, dim) in enumerate(zip(shapes, rank.tolist(), strict=True)):
            space = basis[i, :, :dim]
            hypothesis = Hypothesis(
                effect.name, effect, directions[i, :, :dim], space, ideal[i, :, :dim],
                estimates=_estimates(space.T @ columns[i]) if dim and bounded else None,
            )  # fmt: skip
            found.append(hypothesis if dim else None)
        return found

    # --- all that the model may lack --------------------------------------------------------

    @cached_property
    def tested(self) -> Candidates:
        """The effects that are not in the model, and outlier positions."""
        modelled = {*self.solution.model.effect_names}
        by_sensor, redundancy = self.solution.observed.angle_errors, self.residuals.redundancy
        shapes, invisible, untestable = dict[str, Hypotheses](), [], {}
        for name in effect_names():
            if name in modelled:
                continue
            if by_sensor is not None and _of_robot(get_effect(name)):
                untestable[name] = "a calibrated sensor told the angles, and no robot"
                continue
            try:
                tried = get_effect(name).candidates(self.hold, self.forces, self.solution.gravity)
                seen = [one for one in self.hypotheses(tried) if one is not None]
            except InputError as error:
                untestable[name] = str(error)
                continue
            fitting = [one for one in seen if one.dim < redundancy]
            if fitting:
                shapes[name] = Hypotheses.of(fitting)
            elif seen:
                untestable[name] = (
                    f"its {seen[0].dim} parameters need more than the {redundancy} redundant "
                    "conditions there are"
                )
            else:
                invisible.append(name)
        if outliers := outlying_positions(self.residuals):
            shapes[OUTLIER] = Hypotheses.of(outliers)
        return Candidates(shapes, tuple(invisible), untestable)

    @property
    def candidates(self) -> Mapping[str, Hypotheses]:
        """Shapes of what may be missing."""
        return self.tested.shapes

    def indistinguishable(self, others: Sequence[Hypothesis]) -> set[str]:
        """Effects indistinguishable from any of the given hypotheses, in one of their shapes."""
        ideals, ends = self._ideals
        same: set[str] = set()
        for other in others:
            # The squared cosines sum to the squares of all products: most need no decomposition.
            squares = np.sum((other.ideal.T @ ideals) ** 2, axis=0)
            near = np.add.reduceat(squares, ends[:-1]) > other.dim * RULES.alike**2
            shapes = (self._shapes[k] for k in np.flatnonzero(near))
            same |= {one.name for one in shapes if one.name not in same and same_space(other, one)}
        return same

    def nearest(self, hypothesis: Hypothesis) -> tuple[tuple[str, float], ...]:
        """Other effects and their largest canonical cosines, nearest first, and then by name."""
        near: dict[str, float] = {}
        for shape, cosine in zip(self._shapes, self._cosines(hypothesis, 1).tolist(), strict=True):
            if shape.name != hypothesis.name:
                near[shape.name] = max(near.get(shape.name, 0.0), cosine)
        return tuple(sorted(near.items(), key=lambda item: (-round(item[1], DIGITS), item[0])))

    def imitators(self, hypothesis: Hypothesis) -> tuple[str, ...]:
        """Other effects that could leave all that a hypothesis does, and perhaps more."""
        smallest = self._cosines(hypothesis, hypothesis.dim)
        names = {self._shapes[k].name for k in np.flatnonzero(smallest >= RULES.imitates)}
        return tuple(sorted(names - {hypothesis.name}))

    def _cosines(self, hypothesis: Hypothesis, rank: int) -> Array:
        """Canonical cosine of this rank, 1 for the largest, with each shape; 0 if it has fewer."""
        ideals, ends = self._ideals
        products, dims = hypothesis.ideal.T @ ideals, np.diff(ends)
        cosines = np.zeros(len(self._shapes))
        for d in np.unique(dims[dims >= rank]):
            alike = np.flatnonzero(dims == d)
            blocks = products[:, ends[alike][:, None] + np.arange(d)]
            values = np.linalg.svd(np.swapaxes(blocks, 0, 1), compute_uv=False)[:, rank - 1]
            cosines[alike] = np.minimum(values, 1.0)
        return cosines

    @cached_property
    def _shapes(self) -> list[Hypothesis]:
        """All shapes of all effects."""
        each = self.candidates.items()
        return [one for name, shapes in each if name != OUTLIER for one in shapes.hypotheses]

    @cached_property
    def _ideals(self) -> tuple[Array, NDArray[np.int_]]:
        """Bases of their spaces for an ideal sensor, side by side, and where each begins."""
        bases = [shape.ideal for shape in self._shapes]
        return np.concatenate(bases, axis=1), np.cumsum([0, *(basis.shape[1] for basis in bases)])


def _of_robot(effect: Effect) -> bool:
    """Whether only a robot has an effect: it is in its readings, or turns with its axes."""
    if type(effect).reading is not Effect.reading:
        return True
    columns = compose(effect.spec, (effect.spec,)).hold_columns
    return effect.part == "rig" and bool({"roll", "pitch", "yaw"} & {*columns})


def _estimates(shown: Array) -> Array:
    """Turn products of a basis (m, l) with residuals into the l parameters that show most.

    Parameters
    ----------
    shown : (l, k) array, products of the basis with the signatures of all parameters
    """
    from scipy.linalg import qr  # slow to import, and seldom needed

    most = qr(shown, mode="r", pivoting=True)[1][: len(shown)]
    return np.asarray(np.linalg.inv(shown[:, most]))


# --- signatures -----------------------------------------------------------------------------------


class HoldColumns:
    """The columns of a `HoldConditions` with further axes, for arrays of parameters or settings.

    A column that is absent raises `InputError` when a formula uses it. Each is computed once.

    Parameters
    ----------
    hold : HoldConditions
    axes : int, number of axes after that of the holds
    """

    def __init__(self, hold: HoldConditions, axes: int) -> None:
        self._hold, self._axes = hold, axes
        self._computed: dict[str | float, Array] = {}

    def __getattr__(self, name: str) -> Array:
        if name.startswith("_"):  # asked for by what makes a copy, before that has its columns
            raise AttributeError(name)
        if name not in self._computed:
            values = self._hold.column(name)
            self._computed[name] = values.reshape(len(values), *[1] * self._axes)
        return self._computed[name]

    def lagged(self, tau: Array) -> Array:
        """Temperature behind each of some lags (s, 1), (n, s, 1)."""
        return np.stack([self._behind(t) for t in tau.ravel().tolist()], axis=1)[..., None]

    def _behind(self, tau: float) -> Array:
        """Temperature behind a lag, (n,)."""
        if tau not in self._computed:
            self._computed[tau] = self._hold.lagged(tau)
        return self._computed[tau]


def signatures(
    shapes: Sequence[Effect], forces: Array, angles: Array, g: float, hold: HoldColumns
) -> Signature:
    """Evaluate shapes of one effect for the unit vectors of its parameters, in which it is linear.

    Parameters
    ----------
    shapes : s effects of one kind
    forces : (n, 3) array, m/s², in sensor axes
    angles : (n, 2) array, rad, attitude
    g : float, m/s²
    hold : HoldColumns, with two further axes

    Returns
    -------
    Signature
        Of the s k parameters, shape after shape.

    Raises
    ------
    InputError
        If the effect needs a column that the holds lack.
    """
    effect = _together(shapes)
    n, s, k = len(forces), len(shapes), len(effect.parameters)
    p = tuple(np.eye(k))
    f, attitude = (tuple(values.T[:, :, None, None]) for values in (forces, angles))

    def filled(values: Iterable[ArrayLike], count: int) -> Array:
        full = np.zeros((n, count, s, k))
        for i, value in enumerate(values):
            full[:, i] = value
        return full.reshape(n, count, s * k)

    # A formula takes the columns that it needs, and asks for nothing else of the holds.
    columns: Any = hold
    force = filled(effect.output(f, p, g, columns, np), 3)
    if (axes := _axes(effect, k)).any():
        force -= np.tile(np.einsum("nb,abk->nak", forces, axes), s)
    turned = np.zeros((n, 2, s * k))
    if type(effect).reading is not Effect.reading:
        turned = filled(effect.reading(attitude, p, columns, np), 2)
    return Signature(force, turned)


def _axes(effect: Effect, k: int) -> Array:
    """What an effect adds to T, for the unit vectors of its parameters, (3, 3, k)."""
    axes = np.zeros((3, 3, k))
    if type(effect).axes is not Effect.axes:
        for i, row in enumerate(effect.axes(tuple(np.eye(k)), np)):
            for j, value in enumerate(row):
                axes[i, j] = value
    return axes


def _together(shapes: Sequence[Effect]) -> Effect:
    """Shapes of one effect as one, whose settings are arrays (s, 1)."""
    together = type(shapes[0])()
    settings: Any = {
        name: np.array([shape.settings[name] for shape in shapes])[:, None]
        for name in together.settings
    }
    together.settings = settings
    return together
