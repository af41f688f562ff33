"""What a cell is: one model, scheme, approach and noise that a study simulates."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields, replace
from functools import cached_property
from typing import Any

import numpy as np

from accelstudy.adjustment.linear_theory import LinearTheory
from accelstudy.approaches import Approach, get_approach
from accelstudy.basics.arrays import Array
from accelstudy.basics.levels import MAX_TILT_GON
from accelstudy.basics.units import GON, MGON
from accelstudy.design.estimability import Estimability, estimability
from accelstudy.effects import HoldConditions
from accelstudy.leveling.error import ATTITUDES, TiltError, cap_forces, tilt_error
from accelstudy.schemes import Scheme, get_scheme
from accelstudy.sensors.models import compose
from accelstudy.sensors.sensor import SensorModel
from accelstudy.simulation.hold_plan import HoldPlan
from accelstudy.simulation.sessions import Noise, Session, session

MEGABYTES, BYTES_PER_ESTIMATE = 1000, 150
"""Memory of a job: at least, and for each estimate of its largest cell."""


@dataclass(frozen=True)
class Cell:
    """One set-up, complete in itself.

    Parameters
    ----------
    name : str, unique within the study
    model : str, name of the model that is estimated
    effects : tuple of str, its effects
    simulated_effects : tuple of str, the effects of the simulated sensor
    scheme, approach : str
    replicates : int
    noise : Noise
    gravity : float, true local gravity, m/s²
    truth : dict of parameter name to true value, SI
    holds : HoldPlan, conditions of the holds
    compiled : bool, whether compiled code calibrates it; see `accelstudy.study.compiling`
    directions : tuple of (x, y, z), of a scheme that was read from a file; None of any other
    max_tilt : float, rad, largest tilt at which the tilt error is evaluated
    attitudes : int, least number of attitudes, spread evenly over these tilts
    """

    name: str
    model: str
    effects: tuple[str, ...]
    simulated_effects: tuple[str, ...]
    scheme: str
    approach: str
    replicates: int
    noise: Noise
    gravity: float
    truth: dict[str, float]
    holds: HoldPlan
    compiled: bool = False
    directions: tuple[tuple[float, ...], ...] | None = None
    max_tilt: float = MAX_TILT_GON * GON
    attitudes: int = ATTITUDES

    @cached_property
    def estimated_model(self) -> SensorModel:
        """The model of the adjustment."""
        return compose(self.model, self.effects)

    @cached_property
    def simulated_model(self) -> SensorModel:
        """The model of the simulated sensor."""
        if self.simulated_effects == self.effects:
            return self.estimated_model
        return compose("simulated", self.simulated_effects)

    @cached_property
    def positions(self) -> Scheme:
        """The scheme."""
        if self.directions is None:
            return get_scheme(self.scheme)
        return Scheme(self.scheme, self.scheme, np.array(self.directions), "generated", "")

    @cached_property
    def conditions(self) -> Approach:
        """The approach."""
        return get_approach(self.approach)

    @cached_property
    def hold(self) -> HoldConditions:
        """Conditions of the holds, without columns that follow from their attitudes."""
        return self.holds.hold(self.positions.n_positions)

    @cached_property
    def ideal(self) -> Session:
        """A session without noise."""
        model, directions = self.simulated_model, self.positions.directions
        return session(model, model.vector(self.truth), directions, self.gravity, self.hold)

    @cached_property
    def estimability(self) -> Estimability:
        """What the positions determine."""
        set_up = self.positions, self.estimated_model, self.conditions, self.noise
        return estimability(*set_up, self.gravity, self.hold)

    @cached_property
    def linear_theory(self) -> LinearTheory | None:
        """Linear theory at the calibration of that session; None if it does not converge."""
        observed = self.ideal.observations(self.noise)
        return LinearTheory.of(self.estimated_model, self.conditions, observed)

    @cached_property
    def tilt_error(self) -> TiltError:
        """Tilt error that its calibrations leave, about the calibration without noise."""
        simulated, estimated = self.simulated_model, self.estimated_model
        theory = self.linear_theory
        reference = self.true_values if theory is None else theory.reference
        forces = cap_forces(self.max_tilt, self.attitudes, self.gravity)
        return tilt_error(
            simulated,
            simulated.vector(self.truth),
            estimated,
            reference[: estimated.n_parameters],
            forces,
            self.gravity,
            self.holds.use(forces, self.positions.n_positions),
        )

    @cached_property
    def true_values(self) -> Array:
        """True value of each parameter that is estimated, (u,), SI; 0 where the sensor has none."""
        truth = {**self.truth, "g": self.gravity}
        return np.array([truth.get(name, 0.0) for name in self.parameter_units])

    @cached_property
    def parameter_units(self) -> dict[str, str]:
        """SI unit of each parameter that is estimated; gravity is the last one if observed."""
        units = {p.name: p.unit for p in self.estimated_model.parameters}
        return {**units, "g": "m/s^2"} if self.noise.sigma_gravity > 0 else units

    @property
    def n_unknowns(self) -> int:
        """Number of parameters that are estimated, gravity included."""
        return len(self.parameter_units)

    @property
    def labels(self) -> dict[str, Any]:
        """Columns by which the cell is found in every table."""
        return {
            "cell": self.name,
            "model": self.model,
            "scheme": self.scheme,
            "approach": self.approach,
            "sensor_sigma_mps2": self.noise.sigma_force,
            "robot_sigma_mgon": self.noise.sigma_angle / MGON,
            "gravity_sigma_mps2": self.noise.sigma_gravity,
            "gravity_error_mps2": self.noise.gravity_error,
        }

    def seed(self, seed: int, block: int) -> np.random.SeedSequence:
        """Seed of one block of replicates.

        It depends on the study's seed, the definition of the cell and the block only. So no other
        cell or block changes it.
        """
        return np.random.SeedSequence([seed, *self._words], spawn_key=(block,))

    @cached_property
    def _words(self) -> list[int]:
        """Hash of what defines the cell."""
        identity = [
            list(self.effects),
            list(self.simulated_effects),
            self.scheme,
            self.approach,
            # Noise effects count only where there are some. So the seeds of cells without them did
            # not change when noise effects were added.
            {key: value for key, value in asdict(self.noise).items() if value != ()},
        ]
        holds = replace(self.holds, seed=HoldPlan().seed)
        if holds != HoldPlan():
            identity.append(asdict(holds))
        digest = hashlib.sha256(json.dumps(identity).encode()).digest()
        return list(np.frombuffer(digest, dtype="<u4").tolist())

    def __getstate__(self) -> dict[str, Any]:
        """What a job gets: without the models and positions that it composes itself."""
        return {field.name: getattr(self, field.name) for field in fields(self)}


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
