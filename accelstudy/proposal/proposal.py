"""A design in the order of measurement, and the accuracy that it gives."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from accelstudy import __version__
from accelstudy.adjustment.quality import noncentrality
from accelstudy.basics.units import GON, MGON, angles_in
from accelstudy.design.optimal.criteria import Rivals
from accelstudy.design.optimal.search import Design
from accelstudy.design.optimal.spaces import Mountings
from accelstudy.proposal.order import field_order
from accelstudy.proposal.request import Request
from accelstudy.schemes import get_scheme

Array = NDArray[np.float64]

REFERENCE = "mclaren-24"
PLACEMENT = np.radians(5.0)
"""rad, sd about each of two axes by which a block held by hand misses its attitude."""
PLACED = 200
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
    def of(cls, request: Request, found: Design | None = None) -> Proposal:
        """Find the positions, unless they are given, and order them; errors as `Request.find`."""
        design = request.find() if found is None else found
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
        directions = get_scheme(REFERENCE).directions
        if self.request.task.missing(directions):
            return None
        return self.request.task.rms_tilt(directions)

    @property
    def placed(self) -> Array | None:
        """Rms of roll and of pitch, (2,), if a hand misses the attitudes; None without a hand."""
        if self.request.attitudes != "hand":
            return None
        rng = np.random.default_rng(np.random.SeedSequence([self.request.seed, PLACED]))
        missed = self.directions + PLACEMENT * rng.standard_normal((PLACED, *self.directions.shape))
        missed /= np.linalg.norm(missed, axis=2, keepdims=True)
        squares = [self.request.task.rms_tilt(directions) ** 2 for directions in missed]
        return np.sqrt(np.mean(squares, axis=0))

    def nameable(self, directions: Array) -> dict[str, tuple[float, str]]:
        """Size from which each parameter of two rivals can be told from the other effect, SI."""
        criterion, task = self.request.chosen, self.request.task
        if not isinstance(criterion, Rivals):
            return {}
        root = np.sqrt(noncentrality(1) / criterion.left(task.normal(directions)))
        places = np.concatenate([np.flatnonzero(criterion.first), np.flatnonzero(criterion.second)])
        units = {p.name: p.unit for p in task.extended.parameters}
        return {
            task.names[i]: (float(size / task.scale[i]), units[task.names[i]])
            for i, size in zip(places, root, strict=True)
        }

    def made(self) -> Mapping[str, Any]:
        """How it was made and how good it is, as plain data in the units of files."""
        request, noise = self.request, self.request.noise
        with angles_in("gon"):
            constraints = request.constraints.texts
        known = {
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
        return {k: v for k, v in known.items() if v not in (None, [], 0.0) and v == v}


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
