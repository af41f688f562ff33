"""The replicates of a cell: simulated and calibrated, and beside that by linear theory."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import islice
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from accelstudy.adjustment.calibration import Block
from accelstudy.simulation.sessions import BLOCK
from accelstudy.study.cell import CHUNK, Cell
from accelstudy.study.compiling import calibrator
from accelstudy.study.monte_carlo.control import Control

Array = NDArray[np.float64]


class Pair(NamedTuple):
    """Replicates as they were simulated and as linear theory has them; None without a control."""

    simulated: Block
    linear: Block | None

    @classmethod
    def joined(cls, pairs: Iterable[Pair]) -> Pair:
        """Join replicates that follow each other."""
        simulated, linear = zip(*pairs, strict=True)
        controlled = linear[0] is not None
        return cls(Block.joined(simulated), Block.joined(linear) if controlled else None)


def blocks(
    cell: Cell, seed: int, first: int, count: int, control: Control | None = None
) -> Iterator[Pair]:
    """Simulate and calibrate blocks of an estimable cell, one after another.

    Parameters
    ----------
    cell : Cell
    seed : int, of the study
    first, count : int, number of the first block, from 0 on, and how many are asked for; there are
        no more than `Cell.n_blocks`
    control : Control, optional
    """
    calibrate, angles = calibrator(cell), cell.conditions.uses_angles
    drawn = cell.ideal.draw_blocks(
        cell.noise,
        cell.replicates,
        range(first, min(first + count, cell.n_blocks)),
        lambda block: np.random.default_rng(cell.seed(seed, block)),
        BLOCK,
        angles=angles,
    )
    for errors, observed in drawn:
        linear = None if control is None else control.block(errors, angles)
        yield Pair(calibrate(cell.estimated_model, cell.conditions, observed), linear)


def chunks(
    cell: Cell, seed: int, first: int, count: int, control: Control | None
) -> tuple[Array, Iterator[tuple[int, Pair]]]:
    """Centre of the estimates, and number and content of chunks of an estimable cell.

    Parameters
    ----------
    cell : Cell
    seed : int, of the study
    first, count : int, number of the first chunk, and how many there are
    control : Control or None

    Returns
    -------
    centre : (u,) array, near the mean of the estimates; the same whichever chunks are asked for
    chunks : iterator of number and Pair
    """
    drawn = blocks(cell, seed, first * CHUNK, count * CHUNK, control)
    opening = list(islice(drawn, CHUNK))

    def each() -> Iterator[tuple[int, Pair]]:
        yield first, Pair.joined(opening)
        for index in range(first + 1, first + count):
            yield index, Pair.joined(islice(drawn, CHUNK))

    pilot = blocks(cell, seed, 0, CHUNK, control) if first else opening
    return _pilot_mean(cell, control, pilot), each()


def _pilot_mean(cell: Cell, control: Control | None, pilot: Iterable[Pair]) -> Array:
    """Mean of the estimates in the first block of a cell in which a calibration converged, (u,).

    It is the truth if no calibration of the first chunk converged.
    """
    for block, linear in pilot:
        if block.converged.any():
            estimates = block.estimates[block.converged]
            if control is not None and linear is not None and block.converged.all():
                return control.theory.reference + (estimates - linear.estimates).mean(axis=0)
            return np.asarray(estimates.mean(axis=0))
    return cell.true_values
