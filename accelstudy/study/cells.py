"""The cells of a study: the combinations that its grids name, and which of them are compiled."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import product
from typing import TYPE_CHECKING

from accelstudy.approaches import approach_names, get_approach
from accelstudy.basics.units import MGON
from accelstudy.effects import get_effect
from accelstudy.noise_effects import get_noise_effect
from accelstudy.schemes import scheme_names
from accelstudy.schemes.files import held
from accelstudy.sensors.models import get_model
from accelstudy.simulation.sessions import Noise
from accelstudy.study.cell import Cell
from accelstudy.study.compiling import with_compiled

if TYPE_CHECKING:
    from accelstudy.study.config import Grid, StudyConfig


MEGABYTES, BYTES_PER_ESTIMATE = 1000, 120
"""Memory of a job: at least, and for each estimate of its largest cell."""


def study_cells(study: StudyConfig) -> list[Cell]:
    """All cells of a study, in the order of its configuration, without repetition.

    A cell that occurs more than once, such as in Table 1 and in a grid, runs once, with the largest
    number of replicates.
    """
    cells: dict[str, Cell] = {}
    for grid in study.all_grids:
        for cell in _grid_cells(study, grid):
            earlier = cells.get(cell.name)
            if earlier is None or cell.replicates > earlier.replicates:
                cells[cell.name] = cell
    return with_compiled(list(cells.values()))


def fanned_out(cells: Sequence[Cell], pattern: str) -> dict[str, list[Cell]]:
    """Cells by what they have in common, named by a pattern such as "{model}/{approach}"."""
    groups: dict[str, list[Cell]] = {}
    for cell in cells:
        name = pattern.format(model=cell.model, scheme=cell.scheme, approach=cell.approach)
        groups.setdefault(name, []).append(cell)
    return groups


def memory(cells: Sequence[Cell]) -> int:
    """Memory that a job of cells needs, megabytes."""
    estimates = max(cell.replicates * cell.n_unknowns for cell in cells)
    return MEGABYTES + round(BYTES_PER_ESTIMATE * estimates / 1e6)


def _grid_cells(study: StudyConfig, grid: Grid) -> Iterable[Cell]:
    noise = study.noise
    schemes = scheme_names() if grid.schemes == ["all"] else grid.schemes
    approaches = approach_names() if grid.approaches == ["all"] else grid.approaches
    for model, scheme, approach, sensor, robot, gravity, error in product(
        study.model_names(grid.models),
        schemes,
        approaches,
        grid.sensor_sigma_mps2 or [noise.sensor.sigma_mps2],
        grid.robot_sigma_mgon or [noise.robot.sigma_mgon],
        grid.gravity_sigma_mps2 or [noise.gravity.sigma_mps2],
        grid.gravity_error_mps2 or [noise.gravity.error_mps2],
    ):
        uses_angles = get_approach(approach).uses_angles
        if not uses_angles:  # the same cell whatever the robot's accuracy
            robot = noise.robot.sigma_mgon
        settings = {
            "sensor_sigma_mps2": (sensor, noise.sensor.sigma_mps2),
            "robot_sigma_mgon": (robot, noise.robot.sigma_mgon),
            "gravity_sigma_mps2": (gravity, noise.gravity.sigma_mps2),
            "gravity_error_mps2": (error, noise.gravity.error_mps2),
        }
        changed = [
            f"{key}={_shown(value)}" for key, (value, usual) in settings.items() if value != usual
        ]
        effects = tuple(e.spec for e in get_model(model, study.models).effects)
        simulated = (
            effects
            if study.simulated_effects == ["model"]
            else tuple(get_effect(e).spec for e in study.simulated_effects)
        )
        file = held(scheme)
        yield Cell(
            name="/".join([model, scheme, approach, *changed]),
            model=model,
            effects=effects,
            simulated_effects=simulated,
            scheme=scheme,
            approach=approach,
            replicates=grid.replicates,
            noise=Noise(
                study.position_sigma(sensor),
                robot * MGON if uses_angles else 0.0,
                gravity,
                error,
                tuple(get_noise_effect(spec).spec for spec in noise.effects),
            ),
            gravity=study.gravity_mps2,
            truth=study.truth(dict.fromkeys([*effects, *simulated])),
            holds=study.hold_plan,
            directions=None if file is None else tuple(map(tuple, file["directions"])),
        )


def _shown(value: float) -> str:
    """Show a number briefly, but never two numbers alike."""
    short = f"{value:g}"
    return short if float(short) == value else repr(value)
