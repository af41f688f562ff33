"""How the replicates of a cell are summed up: moments, and sketches of distributions."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from accelstudy.adjustment.calibration import Block
from accelstudy.leveling.error import TiltError
from accelstudy.study.cell import Cell
from accelstudy.study.monte_carlo.averaged import Averaged
from accelstudy.study.monte_carlo.control import Control
from accelstudy.study.monte_carlo.followed import LINEAR, Distributed, Followed
from accelstudy.study.monte_carlo.moments import EDGES, Moments, apart_by_quantile, paired_moments
from accelstudy.study.monte_carlo.replicates import Pair
from accelstudy.study.monte_carlo.sketch import Key, Sketch

Array = NDArray[np.float64]


class Summed:
    """How the replicates of a cell are summed up.

    Parameters
    ----------
    cell : Cell
    control : Control or None
    tilt : TiltError
    centre : (u,) array, about which errors are taken
    """

    def __init__(self, cell: Cell, control: Control | None, tilt: TiltError, centre: Array) -> None:
        followed = Followed.of(cell)
        design = cell.estimability
        self.averaged = Averaged(followed, centre, design.cofactors, tilt)
        self.distributed = Distributed(followed, design.redundancy, tilt)
        count = len(self.distributed.keys)
        self._edges = np.full((count, len(EDGES)), np.nan)
        if control is not None:
            self._edges = control.quantiles(EDGES, exact=False)

    def moments(self, chunk: Pair) -> Moments:
        """Moments of one chunk."""
        block, linear = chunk
        averaged, followed = self.averaged, self.averaged.followed
        x = averaged.of(block)
        y = np.zeros_like(x) if linear is None else averaged.of(linear)
        values = followed.values(block)
        return Moments(
            simulated=len(x),
            converged=len(values),
            redundancy=block.redundancy,
            centre=averaged.centre,
            **paired_moments(x, y, block.converged),
            apart=self._apart(block, linear),
            correlation_sum=block.correlation_sum,
            first=values[0] if len(values) else np.full(len(followed.keys), np.nan),
        )

    def _apart(self, block: Block, linear: Block | None) -> Array:
        """Differences from linear theory, see `Moments.apart`."""
        if linear is None:
            return np.zeros((3, len(self._edges), len(EDGES) + 1))
        expected = self.distributed.of(linear)[block.converged]
        differences = self.distributed.of(block) - expected
        each = zip(differences.T, expected.T, self._edges, strict=True)
        return np.stack([apart_by_quantile(*one) for one in each], axis=1)


class CellSketches:
    """Sketches of the quantities of a cell, and of the same quantities of linear theory.

    Parameters
    ----------
    distributed : Distributed
    """

    def __init__(self, distributed: Distributed) -> None:
        self.distributed = distributed
        self.by_key: dict[Key, Sketch] = {}

    def add(self, pair: Pair) -> None:
        """Count replicates."""
        for prefix, block in (("", pair.simulated), (LINEAR, pair.linear)):
            if block is None or not block.converged.any():
                continue
            for (quantity, name), values in zip(
                self.distributed.keys, self.distributed.of(block).T, strict=True
            ):
                self.by_key.setdefault((prefix + quantity, name), Sketch()).add(values)
