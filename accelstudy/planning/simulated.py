"""The simulation of the candidates at the top of a plan."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from accelstudy.approaches import get_approach
from accelstudy.basics.arrays import Array
from accelstudy.basics.units import STANDARD_GRAVITY
from accelstudy.effects import get_effect
from accelstudy.leveling.distribution import NOISE, Tilt
from accelstudy.planning.candidates import Candidate
from accelstudy.planning.question import Question
from accelstudy.simulation.hold_plan import HoldPlan
from accelstudy.simulation.sessions import Noise
from accelstudy.study.cell import Cell
from accelstudy.study.compiling import with_compiled
from accelstudy.study.statistics import TILT, TILTS, CellStatistics, simulated_statistics

SIGNS = np.array([1.0, -1.0, 1.0])
"""Signs of the parameters of the three axes of the simulated sensor; all have the usual size."""
BOTH = TILTS[-1]
QUOTED = 0.95
"""Share of the calibrations that a plan quotes, whatever is asked for."""


@dataclass(frozen=True)
class SimulatedTilt:
    """The errors of roll and of pitch that simulated calibrations left.

    Attributes
    ----------
    statistics : CellStatistics
    over_sensors : Tilt, by linear theory, if the model neglects effects: sensors differ in these,
        and one is simulated
    """

    statistics: CellStatistics
    over_sensors: Tilt | None = None

    @property
    def rms(self) -> Array:
        """Rms over attitudes and calibrations, (2,), rad."""
        return self.statistics["tilt_rms"].value

    def quantile_of_both(self, probability: float) -> float:
        """Error that roll and pitch both stay below in this share of the calibrations, rad."""
        if self.over_sensors is not None:
            return self.over_sensors.quantile_of_both(probability)
        return float(self.statistics.quantile(TILT, BOTH, probability).value)


def simulate_candidate(
    question: Question, candidate: Candidate, seed: int, replicates: int
) -> SimulatedTilt:
    """Simulate a candidate, with quantiles at the usual share and at that of the question."""
    shares = {QUOTED, question.confidence or QUOTED}
    (cell,) = with_compiled([cell_of(question, candidate, replicates)])
    found = simulated_statistics(cell, seed, np.array(sorted(shares)))
    return SimulatedTilt(found, candidate.tilt if {*candidate.tilt.causes} - {NOISE} else None)


def cell_of(question: Question, candidate: Candidate, replicates: int) -> Cell:
    """Calibrations of the usual sensor of a question, as a cell of a study."""
    equipment, scheme, model = candidate.equipment.name, candidate.scheme, candidate.model
    sizes = {effect: size for effect, size in question.sizes.items() if size}
    truth = dict[str, float]()
    for effect, size in sizes.items():
        names = [parameter.name for parameter in get_effect(effect).parameters]
        truth |= dict(zip(names, SIGNS * size, strict=True))
    angles = get_approach(equipment).uses_angles
    return Cell(
        name="/".join([model.name, scheme.name, equipment]),
        model=model.name,
        effects=model.effect_names,
        simulated_effects=tuple(sizes),
        scheme=scheme.name,
        approach=equipment,
        replicates=replicates,
        noise=Noise(candidate.sigma, question.sigma_angle if angles else 0.0),
        gravity=STANDARD_GRAVITY,
        truth=truth,
        holds=HoldPlan(),
        directions=tuple(map(tuple, scheme.directions.tolist())),
        max_tilt=question.tilt_range,
    )
