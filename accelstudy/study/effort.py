"""Estimate of what a study takes, before it starts: calibrations, time, memory and disk.

The rates were measured on one core of a virtual x86-64 server of 2026 (NumPy with one thread), by
`simulate_batch`, `summarise_batch` and `leveling_sensitivity`: 6 to 15 parameters, 18 to 1000
positions. There the estimates are right within a factor of two; on another machine they scale with
its speed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from accelstudy.basics.errors import InputError
from accelstudy.sensors.models import get_model
from accelstudy.simulation.sessions import BLOCK
from accelstudy.study.batches import batches
from accelstudy.study.cell import Cell
from accelstudy.study.cells import rare_cells
from accelstudy.study.config import StudyConfig
from accelstudy.study.monte_carlo.distributions import EXACT

SECONDS_TO_KEEP, SECONDS_TO_SUM = 9e-6, 4e-6
"""To write and summarise a calibration, or only to summarise it. The adjustment adds to this, per
position and parameter, by gravity, with the robot, and by compiled code:"""
SECONDS_BY_GRAVITY, SECONDS_WITH_ROBOT, SECONDS_COMPILED = 0.11e-6, 0.26e-6, 0.03e-6
SECONDS_PER_CELL = 0.1
"""For its linear theory and the distribution of its tilt error, however few its calibrations."""
SECONDS_PER_VALUE, SECONDS_PER_RESAMPLE = 0.4e-6, 0.6e-9
"""Sensitivity: per base sample, input and attitude, and for each bootstrap resample of it."""
SECONDS_PER_JOB = 3.0
"""To start Python, twice for each batch of cells and once for each of the other jobs."""
OTHER_JOBS = 10

BYTES_ON_DISK = 24
"""Per calibration and parameter that is kept."""
BYTES_OF_SKETCHES = 1e6
"""Per cell in a job that keeps no replicates."""
BYTES_IN_MEMORY = 350e6
"""Of a job with any number of calibrations, as it holds one chunk at a time. The positions of
a block add to it, and the values of kept calibrations for exact quantiles:"""
BYTES_PER_POSITION, BYTES_PER_VALUE = 200, 8

MOST_HOURS, MOST_DISK = 50_000, 10e12
"""Six years on one core, and bytes: the most that a well-equipped group could have."""


@dataclass(frozen=True)
class Effort:
    """What a study takes.

    Attributes
    ----------
    cells : int
    calibrations : int, if all cells can be estimated
    seconds : float, on one core
    memory : float, bytes, of a job at the same time
    disk : float, bytes
    """

    cells: int
    calibrations: int
    seconds: float
    memory: float
    disk: float

    def __str__(self) -> str:
        minutes = self.seconds / 60
        time = f"{minutes:.2g} min" if minutes < 100 else f"{minutes / 60:.3g} h"
        return (
            f"{self.cells} cells, up to {self.calibrations} calibrations: "
            f"about {time} on one core, {_size(self.memory)} of memory for a job, "
            f"{_size(self.disk)} on disk"
        )


def study_effort(study: StudyConfig, cells: Sequence[Cell]) -> Effort:
    """Estimate what a study takes; its `cells` are given, as they are made already.

    Raises
    ------
    InputError
        If no machine can do it; the message names the key.
    """
    rare = rare_cells(study, cells)
    effort = Effort(
        cells=len(cells),
        calibrations=sum(cell.replicates for cell in (*cells, *rare)),
        seconds=sum(_seconds(study, cell) for cell in (*cells, *rare))
        + _seconds_of_sensitivity(study)
        + SECONDS_PER_JOB * (sum(1 + len(batch.jobs) for batch in batches(cells)) + OTHER_JOBS),
        memory=max((_memory(study, cell) for cell in cells), default=0.0),
        disk=_disk(study, cells),
    )
    hours = effort.seconds / 3600
    if _seconds_of_sensitivity(study) / 3600 > MOST_HOURS:
        raise InputError(
            f"sensitivity: takes about {hours:.2g} h on one core, and {MOST_HOURS} h is the most; "
            "lower base_samples or resamples, or take fewer attitudes"
        )
    or_sum = ", or keep: summary" if _keeps(study) else ""
    if hours > MOST_HOURS or effort.disk > MOST_DISK:
        raise InputError(
            f"grids: {effort.calibrations} calibrations take about {hours:.2g} h on one core and "
            f"{_size(effort.disk)} on disk; {MOST_HOURS} h and {_size(MOST_DISK)} are the most: "
            f"lower replicates, or take fewer cells{or_sum}"
        )
    return effort


def _keeps(study: StudyConfig) -> bool:
    return study.keep == "replicates"


def _seconds(study: StudyConfig, cell: Cell) -> float:
    rate = SECONDS_WITH_ROBOT if cell.conditions.uses_angles else SECONDS_BY_GRAVITY
    if cell.compiled:
        rate = SECONDS_COMPILED
    terms = cell.positions.n_positions * cell.n_unknowns
    around = SECONDS_TO_KEEP if _keeps(study) else SECONDS_TO_SUM
    return SECONDS_PER_CELL + cell.replicates * (around + rate * terms)


def _memory(study: StudyConfig, cell: Cell) -> float:
    memory = BYTES_IN_MEMORY + BLOCK * cell.positions.n_positions * BYTES_PER_POSITION
    if _keeps(study):
        values = 3 * cell.n_unknowns + 2  # errors, sds, those of effects, tilt errors
        memory += min(cell.replicates, EXACT) * values * BYTES_PER_VALUE
    return memory


def _disk(study: StudyConfig, cells: Sequence[Cell]) -> float:
    """Bytes on disk: of kept calibrations, or of sketches, which hardly grow with their number."""
    if _keeps(study):
        return sum(BYTES_ON_DISK * cell.replicates * cell.n_unknowns for cell in cells)
    jobs = sum(len(batch.jobs) for batch in batches(cells))
    return BYTES_OF_SKETCHES * (len(cells) + jobs)


def _seconds_of_sensitivity(study: StudyConfig) -> float:
    settings = study.sensitivity
    if settings is None:
        return 0.0
    parameters = get_model(settings.model, study.models).n_parameters
    inputs = 3 + 2 * (3 + parameters)  # of the forces alone, and with either calibration
    attitudes = len(settings.roll_gon) * len(settings.pitch_gon)
    seconds = SECONDS_PER_VALUE + SECONDS_PER_RESAMPLE * settings.resamples
    return seconds * settings.base_samples * inputs * attitudes


def _size(size: float) -> str:
    units = ((1e12, "TB"), (1e9, "GB"), (1e6, "MB"))
    unit, name = next((pair for pair in units if size >= pair[0]), (1.0, "bytes"))
    return f"{size / unit:.{'2g' if size < 100 * unit else '0f'}} {name}"
