"""The candidates at the top of a plan as cells of a study, and their simulation."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from accelstudy.adjustment.calibration import Block
from accelstudy.basics.units import GON, MGON, STANDARD_GRAVITY, recorded_unit, to_recorded
from accelstudy.effects import get_effect
from accelstudy.leveling.error import ATTITUDES
from accelstudy.plan.candidates import Candidate
from accelstudy.plan.optimised import is_best
from accelstudy.plan.question import Question
from accelstudy.schemes.files import held
from accelstudy.study.cell import Cell
from accelstudy.study.cells import study_cells
from accelstudy.study.config import parse_study
from accelstudy.study.monte_carlo.followed import cell_tilt_error
from accelstudy.study.monte_carlo.simulate import blocks

Array = NDArray[np.float64]

SIGNS = (1.0, -1.0, 1.0)
"""Signs of the parameters of the three axes of the simulated sensor; all have the usual size."""
ALWAYS = ("bias", "scale", "nonorthogonality")
"""Effects that every simulated sensor has."""


@dataclass(frozen=True)
class Simulated:
    """The errors of roll and of pitch that simulated calibrations left.

    Attributes
    ----------
    cell : str, name of the cell in the study of the plan
    rms : (2,) array, rad, over attitudes and calibrations
    error : (2,) array, rad, standard error of `rms`
    per_calibration : (R, 2) array, rad, rms over attitudes that each calibration left
    simulated : int, calibrations, of which R converged
    """

    cell: str
    rms: Array
    error: Array
    per_calibration: Array
    simulated: int

    def quantile(self, probability: float) -> Array:
        """Error of each angle by itself that this share of the calibrations stayed below, (2,)."""
        return np.quantile(self.per_calibration, probability, axis=0)

    def of_both(self, probability: float) -> float:
        """Error that roll and pitch both stayed below in this share of the calibrations, rad."""
        return float(np.quantile(self.per_calibration.max(axis=1), probability))

    def accuracy(self, confidence: float | None) -> float:
        """Tilt accuracy by the measure that is asked for, rad."""
        return float(self.rms.max()) if confidence is None else self.of_both(confidence)

    def uncertainty(self, confidence: float | None) -> float:
        """Standard error of `accuracy`, rad, by the number of calibrations.

        That of a quantile follows from the share that it may be wrong by: half the distance of the
        quantiles that lie one standard deviation of this share below and above.
        """
        if confidence is None:
            return float(self.error[self.rms.argmax()])
        step = np.sqrt(confidence * (1 - confidence) / len(self.per_calibration))
        ends = np.clip(confidence + step * np.array([-1, 1]), 0, 1)
        return float(np.ptp(np.quantile(self.per_calibration.max(axis=1), ends))) / 2


def study_of(
    question: Question, chosen: Sequence[Candidate], seed: int, replicates: int
) -> dict[str, Any]:
    """Configuration of a study whose cells are the chosen candidates.

    It can overlay `config/config.yaml`, and is also complete by itself.
    """
    sigma = chosen[0].sigma
    planned = ("cross_axis_misalignment", "quadratic_scale", "cubic_scale")
    sensor = {effect: _quantity(question, effect) for effect in (*ALWAYS, *planned)}
    names = [candidate.scheme.name for candidate in chosen if is_best(candidate.scheme)]
    of_files = {name: held(name) for name in names}
    has = [effect for effect in planned if any(sensor[effect]["value"])]
    return {
        "study": "plan",
        "seed": seed,
        "gravity_mps2": STANDARD_GRAVITY,
        "noise": {
            "sensor": {"sigma_mps2": sigma, "per": "position"},
            "robot": {"sigma_mgon": _tidy(question.sigma_angle / MGON)},
            "gravity": {"sigma_mps2": 0.0, "error_mps2": 0.0},
            "effects": [],
        },
        "sensor": sensor,
        "simulated_effects": [*ALWAYS, *has],
        **({"schemes": of_files} if of_files else {}),
        "leveling": {"max_tilt_gon": _tidy(question.tilt_range / GON), "attitudes": ATTITUDES},
        "presets": None,
        "sensitivity": None,
        "paper": False,
        "grids": [
            {
                "models": candidate.model.name,
                "schemes": question.written(candidate.scheme),
                "approaches": candidate.equipment.name,
                "replicates": replicates,
                **({} if candidate.sigma == sigma else {"sensor_sigma_mps2": candidate.sigma}),
            }
            for candidate in chosen
        ],
    }


def simulate(config: dict[str, Any]) -> list[Simulated]:
    """Simulate the cells of a study of `study_of`, in the order of its candidates.

    The same cells give the same numbers in the workflow.
    """
    study = parse_study(config)
    leveling = study.leveling.model_dump()
    by_cell: dict[str, Simulated] = {}
    order = []
    for grid in config["grids"]:
        (cell,) = study_cells(parse_study({**config, "grids": [grid]}))
        order.append(cell.name)
        if cell.name not in by_cell:
            by_cell[cell.name] = _simulated(cell, study.seed, leveling)
    return [by_cell[name] for name in order]


def _simulated(cell: Cell, seed: int, leveling: dict[str, Any]) -> Simulated:
    block = Block.joined(blocks(cell, seed, 0, cell.n_blocks))
    estimates = block.estimates[block.converged]
    tilt = cell_tilt_error(cell, estimates.mean(axis=0), leveling)
    per_calibration = tilt.rms(estimates)
    square = per_calibration**2
    rms = np.sqrt(square.mean(axis=0))
    error = square.std(axis=0) / np.sqrt(len(square)) / (2 * rms)
    return Simulated(cell.name, rms, error, per_calibration, len(block.converged))


def _quantity(question: Question, effect: str) -> dict[str, Any]:
    """True parameters of an effect as a configuration has them."""
    unit = get_effect(effect).parameters[0].unit
    size = true_size(question, effect)
    value = [_tidy(sign * float(to_recorded(size, unit))) for sign in SIGNS]
    return {"value": value, "unit": recorded_unit(unit)}


def true_size(question: Question, effect: str) -> float:
    """Size of an effect of the simulated sensor, SI; 0 if it does not have the effect."""
    if effect == "cross_axis_misalignment":  # its tilt refers to its own axes
        return 0.0
    if effect in question.sizes:
        return question.sizes[effect].value
    stated: float | None = getattr(question.sheet, effect)
    low, high = get_effect(effect).typical
    return math.sqrt(low * high) if stated is None else stated


def _tidy(value: float) -> float:
    return float(f"{value:.6g}") + 0.0
