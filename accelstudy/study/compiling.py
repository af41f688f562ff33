"""Which cells of a study are calibrated by compiled code, and which by NumPy.

Both give the same numbers to 1e-10 of a standard deviation or better, but not the same bits. A
study must have the same bits however it is run. So the choice is made once, when its cells are
planned, and is a part of each cell. It depends on the configuration and on whether the compiler is
installed, and never on jobs, on cores or on what was compiled before. It is among the parameters
of the jobs, so Snakemake runs a cell again when it changes. A job that should compile and has no
compiler ends with an error.

A cell is compiled if NumPy would take longer for the calibrations of all cells with the same code
than the compiler takes for that code.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Hashable, Sequence
from dataclasses import replace
from importlib.util import find_spec

from accelstudy.adjustment.calibration import Block, calibrate
from accelstudy.adjustment.observations import Observations
from accelstudy.approaches import Approach
from accelstudy.basics.errors import InputError
from accelstudy.sensors.sensor import SensorModel
from accelstudy.study.cell import Cell

POSITIONS_PER_PARAMETER = 5_000
"""Positions of all calibrations together, per parameter, from which on compilation saves time.

Measured on one core of a virtual x86-64 server of 2026 with nothing kept on disk: compilation takes
0.1 s more than NumPy's formulas for 12 parameters and 0.3 s for 15, and saves 2.6 µs and 3.8 µs a
position with a robot.
"""


def installed() -> bool:
    """Whether the compiler, the extra `kernel` of the package, is installed."""
    return find_spec("llvmlite") is not None


def with_compiled(cells: Sequence[Cell]) -> list[Cell]:
    """Decide which cells of a study are compiled."""
    if not installed():
        return list(cells)
    positions: Counter[Hashable] = Counter()
    for cell in cells:
        positions[_code(cell)] += cell.replicates * cell.positions.n_positions
    return [
        replace(cell, compiled=True)
        if positions[_code(cell)] >= POSITIONS_PER_PARAMETER * cell.n_unknowns
        else cell
        for cell in cells
    ]


def calibrator(cell: Cell) -> Callable[[SensorModel, Approach, Observations], Block]:
    """Return the function that calibrates the replicates of a cell.

    Raises
    ------
    InputError
        If the cell is compiled, and there is no compiler.
    """
    if not cell.compiled:
        return lambda *problem: Block.of(calibrate(*problem))
    if not installed():
        raise InputError(
            f"{cell.name}: must be compiled, because the study was planned with the compiler, but "
            "llvmlite is not installed here: install accelstudy[kernel], or plan the study without "
            "it"
        )
    from accelstudy.kernel import calibrate as kernel  # loads the compiler

    return kernel.calibrate


def _code(cell: Cell) -> Hashable:
    """What the code depends on. Settings of effects are not part of it, but arguments."""
    kinds = tuple(type(effect) for effect in cell.estimated_model.effects)
    return kinds, cell.approach, cell.noise.sigma_gravity > 0
