"""What could be missing: every effect of the catalogue, in every shape that is worth a search."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import takewhile
from typing import TypeAlias, overload

import numpy as np
from numpy.typing import NDArray

from accelstudy.adjustment.quality import Solution, root_of
from accelstudy.basics.errors import InputError
from accelstudy.diagnosis.space.residuals import Residuals, ideal_residuals, position_products
from accelstudy.diagnosis.space.signatures import Moments, Signature, signatures
from accelstudy.diagnosis.space.slopes import Slopes
from accelstudy.diagnosis.space.spaces import VISIBLE, Bases, spans
from accelstudy.effects import Effect, HoldConditions, effect_names, get_effect
from accelstudy.leveling.angles import roll_pitch

Array = NDArray[np.float64]

ROUNDING = 1e-9
"""Share of a signature that may be left of nothing by rounding."""
AT_ONCE = 10_000_000
"""Numbers that are worked on at once, about."""
ALIKE = 0.9999
"""Canonical cosine above which two signatures are the same."""

OUTLIER = "outlier_position"


@dataclass(frozen=True)
class Hypothesis:
    """One shape of one thing that may be missing.

    Attributes
    ----------
    name : str, canonical name
    spec : str, name with settings; of an outlier the index of its position
    effect : Effect; None for what is no effect of the sensor or the rig
    directions : (k, l) array, combinations of the parameters that the positions show
    basis : (m, l) array, orthonormal, of the space of its signature in the residuals
    ideal : (m, l) array, likewise for an ideal sensor, where what is equal is exactly so
    """

    name: str
    spec: str
    effect: Effect | None
    directions: Array
    basis: Array
    ideal: Array

    @property
    def dim(self) -> int:
        """Number of parameters that show."""
        return self.basis.shape[1]

    @property
    def shown(self) -> Effect | None:
        """Return the effect with as many of its parameters as the positions can tell apart.

        Those that no position shows are left out. Where only combinations show, the parameters that
        are kept stand for them, and the others are zero.
        """
        if self.effect is None or self.dim == len(self.effect.parameters):
            return self.effect
        from scipy.linalg import qr  # slow to import, and seldom needed

        order = qr(self.directions.T, mode="r", pivoting=True)[1]
        return self.effect.only(tuple(sorted(order[: self.dim].tolist())))

    @property
    def smooth(self) -> str | None:
        """Name of the setting with which the effect changes smoothly, if it has one.

        An effect that lacks what the setting shapes is no neighbour of those that do not.
        """
        if self.effect is None:
            return None
        values = self.effect.settings
        smooth = (s.name for s in self.effect.takes if s.smooth and values[s.name] != s.none)
        return next(smooth, None)

    @property
    def place(self) -> int:
        """Index of the position that a hypothesis of a bumped position is about."""
        assert self.effect is None
        return int(self.spec[len(OUTLIER) + 1 : -1])

    @property
    def value(self) -> float:
        """Value of the smooth setting; NaN if it has none."""
        if self.effect is None or self.smooth is None:
            return np.nan
        return self.effect.settings[self.smooth]


@dataclass(frozen=True)
class EffectShapes(Bases, Sequence[Hypothesis]):
    """Shapes of one effect.

    Attributes
    ----------
    hypotheses : tuple of Hypothesis, whose bases are columns of `together`
    """

    hypotheses: tuple[Hypothesis, ...]

    @classmethod
    def of(cls, hypotheses: Sequence[Hypothesis]) -> EffectShapes:
        """Gather shapes."""
        own = Bases.beside_each_other([h.basis for h in hypotheses])
        shared = zip(hypotheses, own.split(), strict=True)
        return cls(own.together, own.dims, tuple(replace(h, basis=q) for h, q in shared))

    def drawn(self, places: NDArray[np.int_], amounts: Array) -> Array:
        """Sums of the columns of some bases by amounts (Σ l,) of one after the other, (b, m)."""
        dims = self.dims[places]
        rows = np.repeat(np.arange(len(places)), dims)
        first = np.repeat(self.ends[places] - (np.cumsum(dims) - dims), dims)
        columns = np.zeros((len(places), self.together.shape[1]))
        columns[rows, first + np.arange(len(rows))] = amounts
        return np.asarray(columns @ self.together.T)

    def __len__(self) -> int:
        return len(self.hypotheses)

    @overload
    def __getitem__(self, index: int) -> Hypothesis: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[Hypothesis, ...]: ...
    def __getitem__(self, index: int | slice) -> Hypothesis | tuple[Hypothesis, ...]:
        return self.hypotheses[index]


@dataclass(frozen=True)
class BumpedPositions(Sequence[Hypothesis]):
    """One hypothesis per position: that its conditions are shifted by anything.

    Its space is spanned by R E_i H_i, with E_i the columns of the unit matrix that belong to the
    position and H_i H_iᵀ = R_ii⁺, so that z has H_iᵀ z_i in it.

    Attributes
    ----------
    residuals : Residuals
    places : (s,) int array, the positions that are controlled by others
    root : (s, c, c) array, H of these; columns of zeros for what is not controlled
    dims : (s,) int array
    """

    residuals: Residuals
    places: NDArray[np.int_]
    root: Array
    dims: NDArray[np.int_]

    @classmethod
    def of(cls, residuals: Residuals) -> BumpedPositions:
        """All positions that the others control."""
        root, rank = root_of(residuals.blocks)
        places = np.flatnonzero((rank > 0) & (rank < residuals.redundancy))
        return cls(residuals, places, root[places], rank[places])

    def parts(self, errors: Array) -> Array:
        """Squares of what residuals (..., m) have in each of them, (..., s)."""
        parts = position_products(errors, self.root, self.places)
        return np.sum([part**2 for part in parts], axis=0)

    def __len__(self) -> int:
        return len(self.places)

    @overload
    def __getitem__(self, index: int) -> Hypothesis: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[Hypothesis, ...]: ...
    def __getitem__(self, index: int | slice) -> Hypothesis | tuple[Hypothesis, ...]:
        if isinstance(index, slice):
            return tuple(self[i] for i in range(*index.indices(len(self))))
        place = int(self.places[index])
        where, directions = self.rows_of(int(index))
        rows = np.zeros((len(self.residuals.design), directions.shape[1]))
        rows[where] = directions
        basis = self.residuals.project(rows)
        return Hypothesis(OUTLIER, f"{OUTLIER}({place})", None, directions, basis, basis)

    def drawn(self, places: NDArray[np.int_], amounts: Array) -> Array:
        """Sums of the columns of some bases by amounts (Σ l,) of each, (b, m), but for R."""
        n, c = len(self.residuals.whitening), self.root.shape[-1]
        each = np.zeros((len(places), c))
        # The columns of H that are zero are the first ones.
        each[np.arange(c) >= c - self.dims[places, None]] = amounts
        sums = np.zeros((len(places), len(self.residuals.design)))
        blocks = sums[:, : n * c].reshape(-1, n, c)
        blocks[np.arange(len(places)), self.places[places]] = np.einsum(
            "bij,bj->bi", self.root[places], each
        )
        return sums

    def rows_of(self, index: int) -> tuple[slice, Array]:
        """Rows of the conditions of one position, and its H there, (c, l); R E H is a basis."""
        place, root = int(self.places[index]), self.root[index]
        c = len(root)
        return slice(place * c, (place + 1) * c), root[:, np.any(root != 0, axis=0)]


Shapes: TypeAlias = EffectShapes | BumpedPositions
"""All shapes of one thing that may be missing: a sequence of hypotheses, and their spaces."""


@dataclass(frozen=True)
class Frame:
    """One calibrated session, in which effects are evaluated.

    Attributes
    ----------
    solution : Solution
    residuals : Residuals
    ideal : Residuals, of an ideal sensor in the same positions
    forces : (n, 3) array, m/s², of the ideal sensor
    sensed : (n, 3) array, m/s², the same along the sensitive axes as the base fit finds them
    angles : (n, 2) array, rad, attitude as it is read or, without a robot, as the forces say
    moments : Moments, of the holds with what is implied filled in
    """

    solution: Solution
    residuals: Residuals
    ideal: Residuals
    forces: Array
    sensed: Array
    angles: Array
    moments: Moments

    @property
    def hold(self) -> HoldConditions:
        """The holds with what is implied filled in."""
        return self.moments.hold

    @classmethod
    def of(cls, solution: Solution) -> Frame:
        """Frame of a calibration at its solution."""
        ideal, forces = ideal_residuals(solution)
        observed, model = solution.observed, solution.model
        if observed.angles is not None and solution.approach.uses_angles:
            angles = np.asarray(observed.angles[0])
        else:
            angles = np.column_stack(roll_pitch(tuple(forces.T)))
        t = model.axes_matrix(solution.parameters[: model.n_parameters])
        frame = cls(
            solution=solution,
            residuals=Residuals.of(solution),
            ideal=ideal,
            forces=forces,
            sensed=np.asarray(np.linalg.solve(t, forces.T).T),
            angles=angles,
            moments=Moments(implied_hold(solution, angles), rates=observed.slope is not None),
        )
        return frame.with_slopes()

    def signature(self, effect: Effect) -> Signature:
        """Signature of an effect of the sensor."""
        return self.signatures((effect,))

    def signatures(self, shapes: Sequence[Effect], ideal: bool = False) -> Signature:
        """Signatures of shapes of an effect of the sensor, or of an ideal one, side by side."""
        forces = self.forces if ideal else self.sensed
        return signatures(shapes, forces, self.angles, self.solution.gravity, self.moments)

    def with_slopes(self) -> Frame:
        """Add the slopes within the holds, as far as they add to what the means say."""
        without = replace(self, moments=Moments(self.hold, rates=False))
        slopes = Slopes.of(self.solution.observed, self.forces)
        if slopes is None:
            return without
        own = [self.signature(effect) for effect in self.solution.model.effects]
        rows = slopes.beside(self.residuals, self.solution.parameters, own, self.of_time())
        if rows is None:
            return without
        return replace(
            self,
            residuals=self.residuals.with_slopes(rows),
            ideal=self.ideal.with_slopes(replace(rows, errors=0 * rows.errors)),
        )

    def of_time(self) -> Iterator[Signature]:
        """Signatures of the effects beside the model that change the output within a hold."""
        known = {effect.name for effect in self.solution.model.effects}
        for name in effect_names():
            if name in known:
                continue
            try:
                shapes = get_effect(name).candidates(self.hold, self.forces, self.solution.gravity)
                shown = self.signatures(shapes).split(len(shapes)) if shapes else []
            except InputError:  # a column is absent
                continue
            yield from takewhile(lambda one: bool(one.rate.any()), shown)

    def hypotheses(self, shapes: Sequence[Effect]) -> list[Hypothesis | None]:
        """Return what shapes of an effect would leave in the residuals; None for nothing."""

        def of_each(columns: Array) -> Array:
            """Columns (m, s k) of all shapes as those of each, (s, m, k)."""
            return np.moveaxis(columns.reshape(len(columns), len(shapes), -1), 1, 0)

        shown = self.signatures(shapes, ideal=True)
        # A fit is made to the means, so they have to show the effect.
        means = self.ideal.positions
        projected = of_each(means.project(means.whitened(shown)))
        sizes = means.size(shown, self.solution.gravity).reshape(len(shapes), -1)
        directions, ideal, seen = spans(projected, sizes, VISIBLE)
        if self.ideal.slopes:
            projected = of_each(self.ideal.project(self.ideal.whitened(shown)))
            ideal = spans(projected @ directions, None, ROUNDING)[1]
        columns = of_each(self.residuals.project(self.residuals.whitened(self.signatures(shapes))))
        # A force that passes a knee at the ideal sensor may not do so along the real axes.
        sizes = np.linalg.norm(projected @ directions, axis=1)
        also, basis, rank = spans(columns @ directions, sizes, ROUNDING)
        for i in np.flatnonzero(rank < seen):
            directions[i] = directions[i] @ also[i]
            ideal[i] = spans((projected[i] @ directions[i])[None], None, ROUNDING)[1][0]
        return [
            Hypothesis(
                name=effect.name,
                spec=effect.spec,
                effect=effect,
                directions=directions[i, :, : rank[i]],
                basis=basis[i, :, : rank[i]],
                ideal=ideal[i, :, : rank[i]],
            )
            if rank[i]
            else None
            for i, effect in enumerate(shapes)
        ]


@dataclass(frozen=True)
class ExaminedFit:
    """A calibrated session and the hypotheses about it, evaluated when they are asked for first.

    Attributes
    ----------
    frame : Frame
    """

    frame: Frame

    @property
    def candidates(self) -> Mapping[str, Shapes]:
        """Shapes of what may be missing, by its name."""
        return self._catalogue[0]

    @property
    def invisible(self) -> tuple[str, ...]:
        """Effects of rank 0."""
        return self._catalogue[1]

    @property
    def untestable(self) -> Mapping[str, str]:
        """Why an effect cannot be tested, by its name."""
        return self._catalogue[2]

    @cached_property
    def _catalogue(self) -> tuple[dict[str, Shapes], tuple[str, ...], dict[str, str]]:
        """Evaluate the effects that are not in the model, and bumped positions."""
        frame, solution = self.frame, self.frame.solution
        residuals = frame.residuals
        known = {effect.name for effect in solution.model.effects}
        candidates: dict[str, Shapes] = {}
        invisible, untestable = [], {}
        for name in effect_names():
            if name in known:
                continue
            try:
                effects = get_effect(name).candidates(frame.hold, frame.forces, solution.gravity)
                size = max(1, AT_ONCE // residuals.design.size)
                parts = [effects[i : i + size] for i in range(0, len(effects), size)]
                shapes = [shape for part in parts for shape in frame.hypotheses(part)]
            except InputError as error:
                untestable[name] = str(error)
                continue
            seen = [shape for shape in shapes if shape is not None]
            fitting = [shape for shape in seen if shape.dim < residuals.positions.redundancy]
            if fitting:
                candidates[name] = EffectShapes.of(fitting)
            elif seen:
                untestable[name] = (
                    f"its {seen[0].dim} parameters need more than the "
                    f"{residuals.positions.redundancy} redundant conditions there are"
                )
            else:
                invisible.append(name)
        bumped = BumpedPositions.of(residuals)
        if len(bumped):
            candidates[OUTLIER] = bumped
        return candidates, tuple(invisible), untestable

    def hypothesis(self, effect: Effect) -> Hypothesis | None:
        """Return what an effect would leave in the residuals; None if nothing."""
        return self.frame.hypotheses((effect,))[0]

    def alike(self, others: Sequence[Hypothesis]) -> set[str]:
        """Effects of which a shape cannot be told from one of other hypotheses."""
        dims = np.array([other.dim for other in others])
        products = self._ideals.parts(np.concatenate([other.ideal.T for other in others]))
        # The squares of the cosines sum to those of all products: most need no decomposition.
        squares = np.add.reduceat(products, np.cumsum(dims) - dims, axis=0)
        found: set[str] = set()
        for i, k in np.argwhere(squares > dims[:, None] * ALIKE**2).tolist():
            shape = self._shapes[k]
            if shape.name not in found and same_space(others[i], shape):
                found.add(shape.name)
        return found

    def nearest(self, hypothesis: Hypothesis) -> tuple[tuple[str, float], ...]:
        """Other effects and their largest canonical cosines, nearest first."""
        products = hypothesis.ideal.T @ self._ideals.together
        largest = np.zeros(len(self._shapes))
        for d in np.unique(self._ideals.dims):
            own = np.flatnonzero(self._ideals.dims == d)
            blocks = products[:, self._ideals.ends[own][:, None] + np.arange(d)]
            values = np.linalg.svd(np.swapaxes(blocks, 0, 1), compute_uv=False)[:, 0]
            largest[own] = np.minimum(values, 1.0)
        near: dict[str, float] = {}
        for shape, cosine in zip(self._shapes, largest.tolist(), strict=True):
            if shape.name != hypothesis.name:
                near[shape.name] = max(near.get(shape.name, 0.0), cosine)
        return tuple(sorted(near.items(), key=lambda item: -item[1]))

    @cached_property
    def _shapes(self) -> list[Hypothesis]:
        """All shapes of all effects."""
        effects = (one for one in self.candidates.values() if isinstance(one, EffectShapes))
        return [shape for shapes in effects for shape in shapes]

    @cached_property
    def _ideals(self) -> Bases:
        """Their spaces for an ideal sensor."""
        return Bases.beside_each_other([shape.ideal for shape in self._shapes])


def cosines(a: Array, b: Array) -> Array:
    """Canonical cosines of two spaces with orthonormal bases, descending."""
    return np.clip(np.linalg.svd(a.T @ b, compute_uv=False), 0.0, 1.0)


def implied_hold(solution: Solution, angles: Array) -> HoldConditions:
    """Complete the holds with what is implied: the attitude, and yaw 0 where none is given."""
    hold = solution.observed.hold or HoldConditions()
    yaw = np.zeros(len(angles)) if hold.yaw is None else hold.yaw
    return replace(hold, roll=angles[:, 0], pitch=angles[:, 1], yaw=yaw)


def examine(solution: Solution) -> ExaminedFit:
    """Examine a calibrated session."""
    return ExaminedFit(Frame.of(solution))


def same_space(a: Hypothesis, b: Hypothesis) -> bool:
    """Whether two hypotheses cannot be told apart in these positions."""
    if a.dim != b.dim:
        return False
    return bool(cosines(a.ideal, b.ideal)[-1] > ALIKE)
