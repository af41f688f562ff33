"""A design in the order of measurement, the accuracy that it gives, and its file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

from accelstudy import __version__
from accelstudy.adjustment.quality import noncentrality
from accelstudy.basics.units import GON, MGON, angles_in, to_recorded
from accelstudy.design.criteria import RIDGE, MeanSquare
from accelstudy.design.information import position_rows
from accelstudy.design.search import Design, rounded
from accelstudy.design.spaces import Mountings, attitudes
from accelstudy.design.task import Task
from accelstudy.positions.choice import first_best
from accelstudy.proposal.request import Request
from accelstudy.schemes import get_scheme
from accelstudy.sensors.models import compose
from accelstudy.simulation.hold_plan import HoldPlan

Array = NDArray[np.float64]

REFERENCE = "mclaren-24"
PLACEMENT = np.radians(5.0)
"""rad, sd about each of two axes by which a block held by hand misses its attitude."""
MISPLACED_SETS = 200
"""Number of simulated sets of misplaced positions."""


@dataclass(frozen=True, eq=False)
class Proposal:
    """Positions to take, in order.

    Attributes
    ----------
    request : Request
    design : Design
    directions : (n, 3) array of unit vectors, in the order of measurement, as in the file
    """

    request: Request
    design: Design
    directions: Array

    @classmethod
    def of(cls, request: Request) -> Proposal:
        """Find the positions, and order them; errors as `Search.design`."""
        design = request.search.design(request.starts)
        space, groups = request.space, None
        if isinstance(space, Mountings):
            groups = _fewest_axes(space, design.directions)
        order = field_order(request.task, design.directions, groups)
        return cls(request, design, design.directions[order])

    @property
    def turns(self) -> Array:
        """Angle from the position before, rad, (n,); NaN for the first."""
        cosines = np.sum(self.directions[1:] * self.directions[:-1], axis=1)
        return np.array([np.nan, *np.arccos(np.clip(cosines, -1, 1))])

    @property
    def axes(self) -> list[str] | None:
        """Horizontal axis of each position's mounting, if mountings were asked for."""
        space = self.request.space
        if not isinstance(space, Mountings):
            return None
        chosen = _fewest_axes(space, self.directions)
        return [" ".join(f"{c:g}" for c in space.axes[i]) for i in chosen]

    @property
    def rms(self) -> Array:
        """Expected rms of roll and of pitch, rad, (2,)."""
        return self.request.task.rms_tilt(self.directions)

    @property
    def reference(self) -> Array | None:
        """The same with the positions of `REFERENCE`; None if these do not determine the model."""
        rms = self.request.task.rms_tilt(get_scheme(REFERENCE).directions)
        return rms if np.isfinite(rms).all() else None

    @property
    def placed(self) -> Array | None:
        """Rms of roll and of pitch, (2,), if a hand misses the attitudes; None without a hand."""
        if self.request.attitudes != "hand":
            return None
        rng = np.random.default_rng(np.random.SeedSequence([self.request.seed, MISPLACED_SETS]))
        missed = self.directions + PLACEMENT * rng.standard_normal(
            (MISPLACED_SETS, *self.directions.shape)
        )
        missed /= np.linalg.norm(missed, axis=2, keepdims=True)
        squares = [self.request.task.rms_tilt(directions) ** 2 for directions in missed]
        return np.sqrt(np.mean(squares, axis=0))

    def nameable(self, directions: Array) -> dict[str, tuple[float, str]]:
        """Size from which each parameter of two rivals can be told from the other effect, SI."""
        criterion, task = self.request.chosen, self.request.task
        if not self.request.discriminate:
            return {}
        assert isinstance(criterion, MeanSquare)
        size = np.sqrt(noncentrality(1) * criterion.squares(task.normal(directions)))
        places = np.concatenate([task.places(effect) for effect in task.neglected])
        units = {p.name: p.unit for p in task.extended.parameters}
        return {
            task.names[i]: (float(one / task.scale[i]), units[task.names[i]])
            for i, one in zip(places, size, strict=True)
        }

    def made(self) -> Mapping[str, Any]:
        """How it was made and how good it is, as plain data in the units of files."""
        request, noise = self.request, self.request.noise
        with angles_in("gon"):
            constraints = request.constraints.texts
        content = {
            "version": __version__,
            "criterion": f"{request.chosen.name}: {request.chosen.text}",
            "model": request.task.model.name,
            "approach": request.approach,
            "tilt_range_gon": _brief(request.tilt_range / GON),
            "sigma_mps2": _brief(noise.sigma_force),
            "robot_sigma_mgon": _brief(noise.sigma_angle / MGON),
            "gravity_sigma_mps2": _brief(noise.sigma_gravity),
            "attitudes": request.space.text,
            "constraints": constraints,
            "prior": list(request.prior),
            "after": None if request.after is None else get_scheme(request.after).name,
            "neglected": list(request.neglect),
            "discriminate": list(request.discriminate or ()),
            "seed": request.seed,
            "starts": request.starts,
            "efficiency": _brief(self.design.efficiency),
            "rms_roll_mgon": _brief(self.rms[0] / MGON),
            "rms_pitch_mgon": _brief(self.rms[1] / MGON),
        }
        return {k: v for k, v in content.items() if v not in (None, [], 0.0) and v == v}


def _fewest_axes(space: Mountings, directions: Array) -> NDArray[np.int_]:
    """Axis of each position, (n,), such that as few axes as possible serve all."""
    axes = np.array(space.axes) / np.linalg.norm(space.axes, axis=1, keepdims=True)
    fits = np.abs(directions @ axes.T) < 1e-6
    left, chosen = np.ones(len(directions), dtype=bool), np.zeros(len(directions), dtype=int)
    while left.any():
        best = int(np.argmax(fits[left].sum(axis=0)))
        taken = left & fits[:, best]
        if not taken.any():
            break
        chosen[taken] = best
        left &= ~taken
    return chosen


def _brief(value: float) -> float:
    return float(f"{value:.6g}")


Order = NDArray[np.int_]

TOURS = 12
MAX_TOUR_RATIO = 1.15
"""Length, relative to the shortest tour found, up to which a tour that separates drifts better is
taken."""


def field_order(task: Task, directions: Array, groups: Order | None = None) -> Order:
    """Order positions (n, 3) for the field.

    The order is a round trip of small turns. The last position is near the first, so a steady
    change with time is not mistaken for an effect of the attitude. Several round trips are tried,
    each with several first positions. The one is taken in which a linear drift of the biases can be
    told best from the parameters of the model.

    Parameters
    ----------
    task : Task
    directions : (n, 3) array of unit vectors
    groups : (n,) array, optional
        Positions of one group (mounting) stay together.
    """
    groups = np.zeros(len(directions), dtype=int) if groups is None else groups
    angles = np.arccos(np.clip(directions @ directions.T, -1, 1))
    members = [np.flatnonzero(groups == g) for g in np.unique(groups)]
    rng = np.random.default_rng(np.random.SeedSequence(len(directions)))
    trips: list[tuple[float, Order]] = []
    for _ in range(TOURS):
        parts = [_round_trip(angles, rng.permutation(group)) for group in members]
        trips.append((sum(_length(angles, part) for part in parts), np.concatenate(parts)))
    longest = MAX_TOUR_RATIO * min(length for length, _ in trips) + 1e-9
    turns = range(len(directions) if len(members) == 1 else 1)
    near = [[np.roll(tour, turn) for turn in turns] for length, tour in trips if length <= longest]
    shown = np.concatenate([_drift_shown(task, directions[tours]) for tours in near])
    return np.concatenate(near)[first_best(-shown)]


def _length(angles: Array, tour: Order) -> float:
    return float(angles[tour, np.roll(tour, -1)].sum())


def _round_trip(angles: Array, tour: Order) -> Order:
    """Shorten a round trip by reversing parts of it until no reversal shortens it (2-opt)."""
    n, shorter = len(tour), True
    while shorter and n > 3:
        shorter = False
        for i in range(n - 1):
            ahead = np.roll(tour, -1)
            j = np.arange(i + 1, n)
            gain = (
                angles[tour[i], ahead[i]]
                + angles[tour[j], ahead[j]]
                - angles[tour[i], tour[j]]
                - angles[ahead[i], ahead[j]]
            )
            best = first_best(-gain)
            if gain[best] > 1e-9:
                tour = tour.copy()
                tour[i + 1 : j[best] + 1] = tour[i + 1 : j[best] + 1][::-1]
                shorter = True
    return tour


def _drift_shown(task: Task, directions: Array) -> Array:
    """Share of a drift of the biases that the parameters cannot imitate; the smallest axis.

    directions : (k, n, 3) array, of k orders. Returns (k,).
    """
    effects = [effect.spec for effect in task.model.effects]
    model = compose("drifting", (*effects, "bias_drift"))
    (k, n), u = directions.shape[:2], task.model.n_parameters
    hold = HoldPlan().hold(n).take(np.tile(np.arange(n), k))
    hold = replace(hold, time=np.tile(np.linspace(-1.0, 1.0, n), k))
    fixed_gravity = replace(task.noise, sigma_gravity=0.0)
    flat = directions.reshape(-1, 3)
    rows = position_rows(model, task.approach, fixed_gravity, flat, task.gravity, hold)
    rows = rows.reshape(k, -1, rows.shape[-1])
    rows = rows / np.linalg.norm(rows, axis=1, keepdims=True)
    normal = rows.swapaxes(1, 2) @ rows
    of_drift, cross = normal[:, u:, u:], normal[:, :u, u:]
    inside = np.linalg.solve(normal[:, :u, :u] + RIDGE * np.eye(u), cross)
    left = of_drift - cross.swapaxes(1, 2) @ inside
    return np.asarray(np.diagonal(left, axis1=1, axis2=2).min(axis=1))


def write_design(
    path: Path,
    name: str,
    title: str,
    source: str,
    directions: Array,
    made: Mapping[str, Any],
    columns: Mapping[str, Sequence[Any]] | None = None,
) -> None:
    """Write a scheme that `accelstudy.schemes.get_scheme` reads.

    Parameters
    ----------
    path : Path
    name, title, source : str, of the scheme
    directions : (n, 3) array of unit vectors
    made : mapping, plain data: how it was made, and how good it is
    columns : mapping of name to n values, optional, further columns of the positions
    """
    roll, pitch = (to_recorded(attitudes(directions), "rad") / 1000).T
    positions = [
        {
            "position": i + 1,
            "roll_gon": _gon(roll[i]),
            "pitch_gon": _gon(pitch[i]),
            **{key: values[i] for key, values in (columns or {}).items()},
        }
        for i in range(len(directions))
    ]
    content = {
        "scheme": name,
        "title": title,
        "source": source,
        "design": dict(made),
        "positions": positions,
        "directions": rounded(directions).tolist(),
    }
    head = (
        "# Positions for a calibration, in the order in which to take them. Any configuration and\n"
        "# command takes this file as a scheme; `directions` is what counts: gravity in the body\n"
        "# frame.\n"
    )
    text = yaml.safe_dump(
        content, sort_keys=False, allow_unicode=True, default_flow_style=None, width=100
    )
    path.write_text(head + text, encoding="utf-8")


def _gon(angle: float) -> float:
    return round(float(angle), 3) + 0.0
