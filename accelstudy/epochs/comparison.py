"""Two calibrations of one sensor: whether it changed, in what, and what it matters.

What changed is told by all parameters together, with their whole covariance matrices.
"""

from __future__ import annotations

from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from numpy.typing import NDArray

from accelstudy.basics.units import GON, MGON
from accelstudy.campaign.calibration.document import json_content
from accelstudy.campaign.calibration.sensor_calibration import SensorCalibration
from accelstudy.drawing.style import INK, group_colour, group_of, symbol
from accelstudy.epochs.calibrations import (
    STATES,
    Calibrations,
    change_text,
    largest_texts,
)
from accelstudy.epochs.congruence import LEVEL, Differences
from accelstudy.files.outputs import COMPARISON
from accelstudy.pages import render_lines

MIN_DIFFERENCE = 1e-12
"""rad, largest difference that rounding may cause."""


class Comparison(Calibrations):
    """Two calibrations of one sensor: whether it changed, in what, and what it matters.

    Attributes
    ----------
    calibrations : tuple of SensorCalibration, the older one first
    model : SensorModel
    estimates : (2, p) array, SI
    covariances : (2, p, p) array
    tilt_range : float, rad, over which tilts are compared
    """

    kind = COMPARISON

    def __init__(
        self, first: SensorCalibration, second: SensorCalibration, tilt_range: float
    ) -> None:
        super().__init__((first, second))
        self.tilt_range = tilt_range
        self.name = " and ".join(one.content["campaign"] for one in self.calibrations)

    @cached_property
    def change(self) -> Differences:
        """The second calibration less the first, for the test of congruence."""
        dof = float(self.dof[0]), float(self.dof[1])
        return Differences(self.estimates[1] - self.estimates[0], tuple(self.covariances), dof)

    @cached_property
    def statements(self) -> list[tuple[str, ...]]:
        """Whether each parameter changed, in words."""
        changed = self.change.fewest_changes
        return [("changed",) * (i in changed) for i in range(len(self.parameters))]

    def instead_of(self, place: int) -> list[str]:
        """Names of parameters that may have changed instead of one that did."""
        return [self.model.parameter_names[i] for i in self.change.instead_of(place)]

    @cached_property
    def tilt(self) -> NDArray[np.float64]:
        """Rms by which roll and pitch differ, and that which chance would give, (2, 2), rad.

        Readings are those of the sensor as it was at first; they are leveled as if it had not
        changed, and as it is at last.
        """
        first, second = self.estimates
        error = self.tilt_error(first, second, self.tilt_range)
        by_chance = np.einsum("auw,uw->a", error.quadratic, self.change.covariance)
        plain = np.where(error.constant > MIN_DIFFERENCE**2, error.constant, 0.0)
        return np.sqrt([plain, by_chance])

    @cached_property
    def sentences(self) -> list[str]:
        """Whether the sensor changed, in what, and what it matters; the verdict comes first."""
        changes = [
            change_text(
                self.parameters[i], float(self.change.differences[i]), float(self.change.sigmas[i])
            )
            for i in self.change.fewest_changes
        ]
        least = largest_texts(self.parameters, self.change.detectable)
        return render_lines("epochs/wording.txt.j2", "comparison", self, changes, least)

    @cached_property
    def content(self) -> dict[str, Any]:
        """Content of comparison.json, in SI but for keys that name another unit."""
        change, (first, second) = self.change, self.calibrations
        (roll, pitch), (roll_by_chance, pitch_by_chance) = self.tilt / MGON
        content: dict[str, Any] = json_content({
            "schema_version": 1,
            "first": first.content["campaign"],
            "second": second.content["campaign"],
            "state": STATES[change.test.congruent],
            "test": {
                "statistic": change.test.statistic,
                "dof": change.test.dof,
                "p_value": change.test.p_value,
                "level": LEVEL,
            },
            "parameters": [
                {
                    "name": parameter.name,
                    "first": self.estimates[0, i],
                    "second": self.estimates[1, i],
                    "change": change.differences[i],
                    "sigma": change.sigmas[i],
                    "detectable": change.detectable[i],
                    "unit": parameter.unit,
                    "changed": i in change.fewest_changes,
                    "or": self.instead_of(i) if i in change.fewest_changes else [],
                }
                for i, parameter in enumerate(self.parameters)
            ],
            "covariance": change.covariance,
            "tilt": {
                "roll_mgon": roll,
                "pitch_mgon": pitch,
                "roll_by_chance_mgon": roll_by_chance,
                "pitch_by_chance_mgon": pitch_by_chance,
                "max_tilt_gon": self.tilt_range / GON,
            },
            "verdict": " ".join(self.sentences),
        })  # fmt: skip
        return content

    def to_frame(self) -> pd.DataFrame:
        """Return both values of each parameter, the change with its sigma, and what was found."""
        rows = pd.DataFrame(self.content["parameters"]).set_index("name")
        return rows[["first", "second", "change", "sigma", "detectable", "unit", "changed"]]

    def write(self, folder: Path, place: Path) -> None:
        """Write what `accelstudy compare` does."""

        def name(ax: Axes, k: int) -> None:
            ax.set_xticks([0, 1], ["first", "second"])
            ax.set_xlim(-0.5, 1.5)

        title = "Calibrations with 95 % intervals"
        self._write(folder, {"changes": lambda: self.parameters_figure(title, np.arange(2), name)})

    def draw(self, ax: Axes) -> None:
        """Draw the change of each parameter over its sigma, with the interval that holds 95 %."""
        ax.axhline(0, color=INK, linewidth=0.8)
        for i, parameter in enumerate(self.parameters):
            colour = group_colour(group_of(parameter.name))
            filled = colour if self.statements[i] else "white"
            size = self.change.differences[i] / self.change.sigmas[i]
            ax.errorbar(i, size, 1.96, fmt="o", color=colour, markerfacecolor=filled, capsize=2.5)
        ax.set_xticks(range(len(self.parameters)), [symbol(p.name) for p in self.parameters])
        ax.set(ylabel="change / sigma")
