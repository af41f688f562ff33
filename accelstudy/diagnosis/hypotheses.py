"""What could be missing: every effect of the catalogue, in every shape that is worth a search."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from accelstudy.adjustment.quality import Solution
from accelstudy.diagnosis.residuals import Residuals, ideal_residuals
from accelstudy.diagnosis.signatures import signature
from accelstudy.effects import Effect, Hold, effect_names, get_effect
from accelstudy.errors import InputError
from accelstudy.leveling import roll_pitch

Array = NDArray[np.float64]

VISIBLE = 3e-3
"""An effect is invisible where the model absorbs all but this share of its signature."""
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
    basis : (r, l) array, orthonormal, of the space of its signature in the residuals
    ideal : (r, l) array, likewise for an ideal sensor, where what is equal is exactly so
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
        """Return the effect without parameters that no position shows."""
        kept = tuple(np.flatnonzero(np.any(self.directions != 0, axis=1)).tolist())
        if self.effect is None or len(kept) != self.dim:
            return self.effect
        return self.effect.only(kept)

    @property
    def smooth(self) -> str | None:
        """Name of the setting with which the effect changes smoothly, if it has one."""
        hypers = () if self.effect is None else self.effect.hypers
        return next((hyper.name for hyper in hypers if hyper.smooth), None)

    @property
    def value(self) -> float:
        """Value of the smooth setting."""
        assert self.effect is not None
        assert self.smooth is not None
        return self.effect.shape[self.smooth]


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
    hold : Hold, with what is implied filled in
    """

    solution: Solution
    residuals: Residuals
    ideal: Residuals
    forces: Array
    sensed: Array
    angles: Array
    hold: Hold

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
        return cls(
            solution=solution,
            residuals=Residuals.of(solution),
            ideal=ideal,
            forces=forces,
            sensed=np.asarray(np.linalg.solve(t, forces.T).T),
            angles=angles,
            hold=implied_hold(solution, angles),
        )

    def hypothesis(self, effect: Effect) -> Hypothesis | None:
        """Return what an effect would leave in the residuals; None if nothing."""
        g = self.solution.gravity
        shown = signature(effect, self.forces, self.angles, g, self.hold)
        projected = self.ideal.project(self.ideal.whitened(shown))
        directions = span(projected, self.ideal.size(shown, g))
        if not directions.shape[1]:
            return None
        actual = signature(effect, self.sensed, self.angles, g, self.hold).reduced(directions)
        return Hypothesis(
            name=effect.name,
            spec=effect.spec,
            effect=effect,
            directions=directions,
            basis=orthonormal(self.residuals.project(self.residuals.whitened(actual))),
            ideal=orthonormal(projected @ directions),
        )


@dataclass(frozen=True)
class Setting:
    """A calibrated session and the hypotheses about it.

    Attributes
    ----------
    frame : Frame
    candidates : dict of name to hypotheses, one per shape
    invisible : tuple of str, effects of rank 0
    untestable : dict of name to the reason why it cannot be tested
    """

    frame: Frame
    candidates: Mapping[str, Sequence[Hypothesis]]
    invisible: tuple[str, ...]
    untestable: Mapping[str, str]

    def hypothesis(self, effect: Effect) -> Hypothesis | None:
        """Return what an effect would leave in the residuals; None if nothing."""
        return self.frame.hypothesis(effect)

    @property
    def bases(self) -> dict[str, list[Array]]:
        """Bases of all shapes of each candidate."""
        return {name: [h.basis for h in shapes] for name, shapes in self.candidates.items()}

    def nearest(self, hypothesis: Hypothesis) -> tuple[tuple[str, float], ...]:
        """Other effects and their largest canonical cosines, nearest first."""
        near = {
            name: max(float(cosines(hypothesis.ideal, h.ideal)[0]) for h in shapes)
            for name, shapes in self.candidates.items()
            if name not in (OUTLIER, hypothesis.name)
        }
        return tuple(sorted(near.items(), key=lambda item: -item[1]))

    @property
    def all(self) -> list[Hypothesis]:
        """All shapes of all candidates."""
        return [h for shapes in self.candidates.values() for h in shapes]


def span(projected: Array, sizes: Array | None = None, tolerance: float = VISIBLE) -> Array:
    """Directions (k, l) in which columns, relative to their sizes, span a space; l is its rank."""
    norms = np.linalg.norm(projected, axis=0) if sizes is None else sizes
    scale = np.where(norms > 0, norms, 1.0)
    _, values, right = np.linalg.svd(projected / scale, full_matrices=False)
    return (right[values > tolerance] / scale).T


def orthonormal(columns: Array) -> Array:
    """Orthonormal basis of independent columns."""
    if not columns.shape[1]:
        return columns
    norms = np.linalg.norm(columns, axis=0)
    left, _, _ = np.linalg.svd(columns / np.where(norms > 0, norms, 1.0), full_matrices=False)
    return left


def cosines(a: Array, b: Array) -> Array:
    """Canonical cosines of two spaces with orthonormal bases, descending."""
    return np.clip(np.linalg.svd(a.T @ b, compute_uv=False), 0.0, 1.0)


def implied_hold(solution: Solution, angles: Array) -> Hold:
    """Complete the holds with what is implied: the attitude, and yaw 0 where none is given."""
    hold = solution.observed.hold or Hold()
    yaw = np.zeros(len(angles)) if hold.yaw is None else hold.yaw
    return replace(hold, roll=angles[:, 0], pitch=angles[:, 1], yaw=yaw)


def setting_of(solution: Solution, names: Iterable[str] | None = None) -> Setting:
    """Evaluate the catalogue for a calibrated session.

    Parameters
    ----------
    solution : Solution
    names : effects to look at; all that are not in the model by default
    """
    frame = Frame.of(solution)
    residuals, hold, forces = frame.residuals, frame.hold, frame.forces
    known = {effect.name for effect in solution.model.effects}
    candidates: dict[str, list[Hypothesis]] = {}
    invisible, untestable = [], {}
    for name in effect_names() if names is None else names:
        if name in known:
            continue
        try:
            shapes = [
                frame.hypothesis(effect)
                for effect in get_effect(name).candidates(hold, forces, solution.gravity)
            ]
        except InputError as error:
            untestable[name] = str(error)
            continue
        seen = [shape for shape in shapes if shape is not None]
        fitting = [shape for shape in seen if shape.dim < residuals.redundancy]
        if fitting:
            candidates[name] = fitting
        elif seen:
            untestable[name] = (
                f"its {seen[0].dim} parameters need more than the {residuals.redundancy} redundant "
                "conditions there are"
            )
        else:
            invisible.append(name)
    outliers = list(outlier_hypotheses(residuals))
    if outliers:
        candidates[OUTLIER] = outliers
    return Setting(
        frame=frame,
        candidates=candidates,
        invisible=tuple(invisible),
        untestable=untestable,
    )


def outlier_hypotheses(residuals: Residuals) -> Iterable[Hypothesis]:
    """One hypothesis per position: that its conditions are shifted by anything."""
    n, c = residuals.whitening.shape[:2]
    for i in range(n):
        projected = residuals.basis[i * c : (i + 1) * c].T
        directions = span(projected, np.ones(c), 1e-3)
        if 0 < directions.shape[1] < residuals.redundancy:
            basis = orthonormal(projected @ directions)
            yield Hypothesis(OUTLIER, f"{OUTLIER}({i})", None, directions, basis, basis)


def same_space(a: Hypothesis, b: Hypothesis) -> bool:
    """Whether two hypotheses cannot be told apart in these positions."""
    if a.dim != b.dim:
        return False
    cross = a.ideal.T @ b.ideal
    # The squares of the cosines sum to that of the entries: most pairs need no decomposition.
    if float(np.vdot(cross, cross)) <= a.dim * ALIKE**2:
        return False
    return bool(cosines(a.ideal, b.ideal)[-1] > ALIKE)
