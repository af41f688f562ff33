"""Which further positions would separate the rivals best."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from accelstudy.diagnosis.space.hypotheses import Frame, Hypothesis
from accelstudy.diagnosis.space.signatures import signature
from accelstudy.effects import Hold
from accelstudy.leveling import roll_pitch
from accelstudy.schemes import get_scheme

Array = NDArray[np.float64]

COUNT = 3
GRID = "fibonacci-60"


@dataclass(frozen=True)
class NextPosition:
    """A position worth measuring; angles in rad, temperature in °C or None."""

    roll: float
    pitch: float
    temperature: float | None
    separates: tuple[str, str]
    gain: float


def next_positions(frame: Frame, rivals: Sequence[Hypothesis]) -> list[NextPosition]:
    """Positions in which two explanations of the same residuals predict most differently.

    Both are fitted to all positions, each together with the parameters of the model. Of a grid of
    attitudes, at the lowest, middle and highest temperature so far, those are chosen one after the
    other whose predictions differ by the largest multiple of the noise of a position.

    Parameters
    ----------
    frame : Frame, of the base fit
    rivals : two hypotheses about effects
    """
    first, second = rivals
    forces, hold = _grid(frame)
    differences = _prediction(frame, first, forces, hold) - _prediction(frame, second, forces, hold)
    sigma = float(np.mean(frame.residuals.sigmas[:, :3]))
    if frame.solution.approach.uses_angles:
        gain = np.sum((differences / sigma) ** 2, axis=1)
    else:
        unit = forces / np.linalg.norm(forces, axis=1, keepdims=True)
        gain = np.sum(unit * differences / sigma, axis=1) ** 2
    chosen: list[int] = []
    for i in np.argsort(-gain, kind="stable"):
        apart = [
            np.linalg.norm(forces[i] - forces[j]) > 0.5 * frame.solution.gravity for j in chosen
        ]
        if all(apart):
            chosen.append(int(i))
        if len(chosen) == COUNT:
            break
    roll, pitch = roll_pitch(tuple(forces.T))
    return [
        NextPosition(
            roll=float(roll[i]),
            pitch=float(pitch[i]),
            temperature=None if hold.temperature is None else float(hold.temperature[i]),
            separates=(first.name, second.name),
            gain=float(np.sqrt(gain[i])),
        )
        for i in chosen
    ]


def _grid(frame: Frame) -> tuple[Array, Hold]:
    """Forces (k, 3) and holds of the positions to choose from, measured after all others."""
    forces = -frame.solution.gravity * get_scheme(GRID).directions
    temperature = frame.hold.temperature
    levels = [None] if temperature is None else [*np.quantile(temperature, [0.0, 0.5, 1.0])]
    grid = np.tile(forces, (len(levels), 1))
    k, n = len(grid), len(frame.forces)

    def after(values: Array | None) -> Array | None:
        """The value that the next position would have."""
        if values is None:
            return None
        step = (values[-1] - values[0]) / max(n - 1, 1)
        return np.full(k, values[-1] + step)

    def usual(values: Array | None) -> Array | None:
        return None if values is None else np.full(k, np.median(values))

    roll, pitch = roll_pitch(tuple(grid.T))
    step = grid - frame.forces[-1]
    hold = Hold(
        temperature=None if temperature is None else np.repeat(np.array(levels, dtype=float), 60),
        time=after(frame.hold.time),
        vibration=usual(frame.hold.vibration),
        roll=roll,
        pitch=pitch,
        yaw=np.zeros(k),
        step_x=step[:, 0],
        step_y=step[:, 1],
        step_z=step[:, 2],
        order=after(frame.hold.order),
    )
    return grid, hold


def _prediction(frame: Frame, hypothesis: Hypothesis, forces: Array, hold: Hold) -> Array:
    """Correction of the base prediction of the output that a hypothesis makes, (k, 3), m/s²."""
    assert hypothesis.effect is not None
    g = frame.solution.gravity
    angles = np.column_stack([hold.column("roll"), hold.column("pitch")])
    residuals = frame.residuals
    model = frame.solution.model

    def columns(at_forces: Array, at_angles: Array, at_hold: Hold) -> tuple[Array, Array]:
        """Derivatives of the output by the parameters of the model, and by those of the effect."""
        base = [
            signature(effect, at_forces, at_angles, g, at_hold).force for effect in model.effects
        ]
        shown = signature(hypothesis.effect, at_forces, at_angles, g, at_hold)  # type: ignore[arg-type]
        shown = shown.reduced(hypothesis.directions)
        turned = np.einsum("nia,nak->nik", _force_by_angles(at_forces, g), shown.angles)
        return np.concatenate(base, axis=2), shown.force + turned

    base, effect = columns(frame.forces, frame.angles, frame.hold)
    shown = np.concatenate([base, effect], axis=2)
    rows = residuals.rows(residuals.jac_observations[..., :3] @ shown)
    solution = np.linalg.lstsq(rows, residuals.errors, rcond=1e-10)[0]
    base, effect = columns(forces, angles, replace(hold))
    return np.concatenate([base, effect], axis=2) @ solution


def _force_by_angles(forces: Array, g: float) -> Array:
    """Derivatives of the specific force by roll and pitch, (n, 3, 2)."""
    roll, pitch = roll_pitch(tuple(forces.T))
    sin_r, cos_r, sin_p, cos_p = np.sin(roll), np.cos(roll), np.sin(pitch), np.cos(pitch)
    zero = np.zeros_like(roll)
    by_roll = g * np.stack([zero, -cos_p * cos_r, cos_p * sin_r], axis=1)
    by_pitch = g * np.stack([cos_p, sin_p * sin_r, sin_p * cos_r], axis=1)
    return np.stack([by_roll, by_pitch], axis=2)
