"""A study of one cell, in memory."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import pandas as pd

from accelstudy.api.given import of_type, quantity, table_html
from accelstudy.approaches import get_approach
from accelstudy.basics.errors import InputError
from accelstudy.basics.units import STANDARD_GRAVITY, Given
from accelstudy.leveling.error import ATTITUDES, MAX_TILT_GON
from accelstudy.planning.quantities import QUANTITIES
from accelstudy.schemes import get_scheme
from accelstudy.sensors.models import get_model
from accelstudy.simulation.hold_plan import HoldPlan
from accelstudy.simulation.sessions import Noise
from accelstudy.study.cell import Cell
from accelstudy.study.monte_carlo.distributions import simulated_distributions
from accelstudy.study.monte_carlo.statistics import Statistics

LEVELING = {"max_tilt_gon": MAX_TILT_GON, "attitudes": ATTITUDES}
"""Where the tilt error is evaluated, as in a study by default."""
GRAVITY = Given("m/s^2", "", "Local gravity.")


@dataclass(frozen=True, repr=False)
class Simulation:
    """Simulated calibrations of one set-up, summed up.

    Attributes
    ----------
    cell : Cell, the set-up
    statistics : Statistics
    """

    cell: Cell
    statistics: Statistics

    def __repr__(self) -> str:
        return f"Simulation({self.cell.name!r}, {self.statistics.converged} calibrations)"

    def _repr_html_(self) -> str:
        return table_html("Simulation", repr(self), self.parameters)

    @property
    def parameters(self) -> pd.DataFrame:
        """Bias and standard deviation of each estimated parameter with their errors, SI.

        The errors are standard errors by the number of replicates.
        """
        bias, sd = self.statistics.bias, self.statistics.sd
        units = self.cell.parameter_units
        return pd.DataFrame(
            {
                "truth": self.cell.true_values,
                "bias": bias.value,
                "bias_error": bias.error,
                "sd": sd.value,
                "sd_error": sd.error,
                "unit": list(units.values()),
            },
            index=pd.Index(units, name="name"),
        )

    @property
    def tilt(self) -> pd.DataFrame:
        """Rms tilt error of roll and of pitch that the calibration leaves up to 50 gon, rad."""
        rms = self.statistics.tilt_rms
        index = pd.Index(["roll", "pitch"], name="angle")
        table = pd.DataFrame({"rms": rms.value, "rms_error": rms.error}, index=index)
        table.attrs["units"] = {"rms": "rad", "rms_error": "rad"}
        return table


def simulate(
    model: str,
    scheme: str,
    approach: str,
    *,
    sigma: float | str,
    robot_accuracy: float | str = "3.2 mgon",
    gravity: float | str = STANDARD_GRAVITY,
    truth: Mapping[str, float] | None = None,
    replicates: int = 1000,
    seed: int = 1,
) -> Simulation:
    """Simulate the calibrations of one set-up.

    Parameters
    ----------
    model, scheme, approach : str, names or files
    sigma : float in m/s² or str with a unit, of the mean of a position
    robot_accuracy : float in rad or str with a unit, of the robot's roll and pitch
    gravity : float in m/s² or str with a unit
    truth : mapping of parameter to true value, SI; 0 if omitted
    replicates, seed : int

    Raises
    ------
    InputError
        If a name or a value is wrong, or the positions do not determine the model.
    """
    for name, value in {"model": model, "scheme": scheme, "approach": approach}.items():
        of_type(name, value, str, expected="a name")
    for name, count, least in (("replicates", replicates, 2), ("seed", seed, 0)):
        of_type(name, count, int, expected="a whole number")
        if count < least:
            raise InputError(f"{name}: must be at least {least}, not {count}")
    composed, positions = get_model(model), get_scheme(scheme)
    effects = tuple(effect.spec for effect in composed.effects)
    cell = Cell(
        f"{composed.name} {positions.name} {approach}",
        composed.name,
        effects,
        effects,
        positions.name,
        get_approach(approach).name,
        replicates,
        Noise(
            quantity("sigma", sigma, QUANTITIES["sigma"]),
            quantity("robot_accuracy", robot_accuracy, QUANTITIES["robot_accuracy"]),
        ),
        quantity("gravity", gravity, GRAVITY),
        dict(truth or {}),
        HoldPlan(),
    )
    composed.vector(cell.truth)
    if not cell.estimability.estimable:
        raise InputError(f"{cell.name}: {cell.estimability.reason}")
    return Simulation(cell, simulated_distributions(cell, seed, LEVELING)[0])
