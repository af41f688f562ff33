"""The candidates at the top of a plan as cells of a study, and their simulation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.arguments import tidy
from accelstudy.basics.units import GON, MGON, STANDARD_GRAVITY, recorded_unit, to_recorded
from accelstudy.effects import get_effect
from accelstudy.leveling.error import ATTITUDES
from accelstudy.planning.candidates import Candidate
from accelstudy.planning.question import NONLINEAR, Question, usual_size
from accelstudy.schemes.files import held
from accelstudy.study.config import parse_study
from accelstudy.study.estimate import Estimates
from accelstudy.study.statistics import ANGLES, TILT, TILTS, CellStatistics, simulated_statistics

Array = NDArray[np.float64]

SIGNS = (1.0, -1.0, 1.0)
"""Signs of the parameters of the three axes of the simulated sensor; all have the usual size."""
BOTH = TILTS[-1]
QUOTED_SHARES = (0.025, 0.95, 0.975)
"""Shares of the calibrations that a plan quotes."""
BASE_EFFECTS = ("bias", "scale", "nonorthogonality")
"""Effects that every simulated sensor has."""


@dataclass(frozen=True)
class SimulatedTilt:
    """The errors of roll and of pitch that simulated calibrations left.

    Attributes
    ----------
    cell : str, name of the cell in the study of the plan
    statistics : CellStatistics
    """

    cell: str
    statistics: CellStatistics

    @property
    def rms(self) -> Array:
        """Rms over attitudes and calibrations, (2,), rad."""
        return self.statistics["tilt_rms"].value

    @property
    def error(self) -> Array:
        """Standard error of `rms`, (2,), rad."""
        return self.statistics["tilt_rms"].error

    def quantile(self, probability: float) -> Array:
        """Error of each angle by itself that this share of the calibrations stayed below, (2,)."""
        return np.array([float(self._bound(name, probability).value) for name in ANGLES])

    def quantile_of_both(self, probability: float) -> float:
        """Error that roll and pitch both stayed below in this share of the calibrations, rad."""
        return float(self._bound(BOTH, probability).value)

    def uncertainty(self, confidence: float | None) -> float:
        """Standard error of `Question.accuracy`, rad, by the number of calibrations."""
        if confidence is None:
            return float(self.error[self.rms.argmax()])
        return float(self._bound(BOTH, confidence).error)

    def _bound(self, name: str, probability: float) -> Estimates:
        return self.statistics.quantile(TILT, name, probability)


def study_of(
    question: Question, chosen: Sequence[Candidate], seed: int, replicates: int
) -> dict[str, Any]:
    """Configuration of a study whose cells are the chosen candidates.

    It can overlay `config/config.yaml`, and is also complete by itself.
    """
    sigma = chosen[0].sigma
    planned = ("cross_axis_misalignment", *NONLINEAR)
    sensor = {effect: _quantity(question, effect) for effect in (*BASE_EFFECTS, *planned)}
    names = [candidate.scheme.name for candidate in chosen if candidate.search]
    of_files = {name: held(name) for name in names}
    has = [effect for effect in planned if any(sensor[effect]["value"])]
    return {
        "study": "plan",
        "seed": seed,
        "gravity_mps2": STANDARD_GRAVITY,
        "noise": {
            "sensor": {"sigma_mps2": sigma, "per": "position"},
            "robot": {"sigma_mgon": tidy(question.sigma_angle / MGON, 6)},
            "gravity": {"sigma_mps2": 0.0, "error_mps2": 0.0},
            "effects": [],
        },
        "sensor": sensor,
        "simulated_effects": [*BASE_EFFECTS, *has],
        **({"schemes": of_files} if of_files else {}),
        "leveling": {"max_tilt_gon": tidy(question.tilt_range / GON, 6), "attitudes": ATTITUDES},
        "presets": None,
        "sensitivity": None,
        "paper": False,
        "grids": [
            {
                "models": candidate.model.name,
                "schemes": candidate.scheme.name,
                "approaches": candidate.equipment.name,
                "replicates": replicates,
                **({} if candidate.sigma == sigma else {"sensor_sigma_mps2": candidate.sigma}),
            }
            for candidate in chosen
        ],
    }


def simulate_candidates(question: Question, config: dict[str, Any]) -> list[SimulatedTilt]:
    """Simulate the cells of a study of `study_of`, in the order of its candidates.

    The same cells give the same numbers in the workflow. There are quantiles at some usual shares,
    and at that of the question.
    """
    study, shares = parse_study(config), {*QUOTED_SHARES, question.confidence} - {None}
    levels = np.sort([*shares])
    cells = [parse_study({**config, "grids": [grid]}).cells[0] for grid in config["grids"]]
    by_name = {
        name: SimulatedTilt(name, simulated_statistics(cell, study.seed, levels))
        for name, cell in {cell.name: cell for cell in cells}.items()
    }
    return [by_name[cell.name] for cell in cells]


def _quantity(question: Question, effect: str) -> dict[str, Any]:
    """True parameters of an effect as a configuration has them."""
    unit = get_effect(effect).parameters[0].unit
    size = true_size(question, effect)
    value = [tidy(sign * float(to_recorded(size, unit)), 6) for sign in SIGNS]
    return {"value": value, "unit": recorded_unit(unit)}


def true_size(question: Question, effect: str) -> float:
    """Size of an effect of the simulated sensor, SI; 0 if it does not have the effect."""
    if effect == "cross_axis_misalignment":  # its tilt refers to its own axes
        return 0.0
    if effect in question.sizes:
        return question.sizes[effect]
    stated: float | None = getattr(question.sheet, effect)
    return usual_size(effect) if stated is None else stated
