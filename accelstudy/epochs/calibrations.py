"""What a comparison and a history have in common: calibrations of one sensor with one model."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from accelstudy.basics.errors import InputError
from accelstudy.basics.units import shown_unit, to_display
from accelstudy.basics.wording import comma_list, estimate
from accelstudy.campaign.calibration.document import write_json
from accelstudy.campaign.calibration.sensor_calibration import SensorCalibration
from accelstudy.drawing.saving import save_all
from accelstudy.drawing.style import FULL, INK, new_figure, symbol
from accelstudy.effects import Parameter
from accelstudy.leveling.error import ATTITUDES, TiltError, cap_forces, tilt_error
from accelstudy.pages import write_page
from accelstudy.pages.result import Result

Array = NDArray[np.float64]

STATES = {True: "unchanged", False: "changed"}
"""States of a result by whether the calibrations agree."""
PANELS = 3
"""Panels side by side."""


class Calibrations(Result):
    """Calibrations of one sensor with one model.

    Attributes
    ----------
    calibrations : tuple of n SensorCalibration
    model : SensorModel
    estimates : (n, p) array, SI
    covariances : (n, p, p) array
    dates : tuple of n datetime; empty if they say nothing of the time
    """

    dates: tuple[datetime, ...] = ()

    def __init__(self, calibrations: Sequence[SensorCalibration]) -> None:
        _check_alike(calibrations)
        self.calibrations, self.model = tuple(calibrations), calibrations[0].model
        names = [one.model.parameter_names for one in calibrations]
        orders = [[own.index(name) for name in names[0]] for own in names]
        each = [*zip(calibrations, orders, strict=True)]
        self.estimates = np.array([one.parameters[order] for one, order in each])
        self.covariances = np.array([one.covariance[np.ix_(order, order)] for one, order in each])

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Parameters of the model."""
        return self.model.parameters

    @property
    def dof(self) -> Array:
        """Degrees of freedom by which the noise was estimated, (n,); inf if it is known."""
        return np.array([one.dof for one in self.calibrations])

    @property
    def sigmas(self) -> Array:
        """Sigmas of `estimates`."""
        return np.sqrt(np.diagonal(self.covariances, axis1=1, axis2=2))

    def tilt_error(self, first: Array, second: Array, tilt_range: float) -> TiltError:
        """Tilt error by one set of parameters for another, in conditions of the last session."""
        last = self.calibrations[-1]
        forces = cap_forces(tilt_range, ATTITUDES, last.gravity)
        forces, hold = last.with_conditions(forces, self.model.hold_columns)
        return tilt_error(self.model, first, self.model, second, forces, last.gravity, hold)

    @property
    @abstractmethod
    def sentences(self) -> list[str]:
        """What was found, in sentences; the verdict comes first."""

    @property
    @abstractmethod
    def statements(self) -> Sequence[tuple[str, ...]]:
        """Changes of each parameter, in words."""

    def _write(self, folder: Path, figures: Mapping[str, Callable[[], Figure]]) -> None:
        """Write the page with figures, and the JSON file."""
        write_page(
            folder / "report.html",
            "epochs/report.html.j2",
            self.verdict,
            doc=self.content,
            h=self,
            lines=self.sentences,
            figures=save_all(figures, folder / "figures"),
        )
        write_json(folder / self.kind.marker, self.content)

    def parameters_figure(
        self, title: str, at: NDArray[Any], draw_more: Callable[[Axes, int], None]
    ) -> Figure:
        """Draw each parameter in all calibrations with 95 % intervals.

        Parameters
        ----------
        title : str
        at : (n,) array, where the calibrations stand
        draw_more : function that adds to the panel of a parameter, by its number
        """
        rows = -(-len(self.parameters) // PANELS)
        figure = new_figure(FULL, 12 + 36 * rows)
        panels = figure.subplots(rows, PANELS, sharex=True, squeeze=False).ravel()
        for k, (ax, parameter) in enumerate(zip(panels, self.parameters, strict=False)):
            unit, found = parameter.unit, self.statements[k]
            values, halves = (
                to_display(v[:, k], unit) for v in (self.estimates, 1.96 * self.sigmas)
            )
            ax.errorbar(at, values, halves, fmt="o", color=INK, capsize=2, linewidth=0.8, ms=3)
            draw_more(ax, k)
            ax.set_title(symbol(parameter.name) + (f" ({' and '.join(found)})" if found else ""))
            ax.set_ylabel(shown_unit(unit))
            ax.tick_params(axis="x", labelbottom=k + PANELS >= len(self.parameters))
        for ax in panels[len(self.parameters) :]:
            ax.set_visible(False)
        figure.suptitle(title)
        return figure


def _check_alike(calibrations: Sequence[SensorCalibration]) -> None:
    """Check that the parameters of all calibrations are known, and mean the same.

    Raises
    ------
    InputError
        If one of them has no sigmas, or other effects or another conversion of its readings than
        the first. The line names the calibration by its number and its campaign.
    """
    first, names = calibrations[0], [effect.spec for effect in calibrations[0].model.effects]
    for number, one in enumerate(calibrations, start=1):
        where = f"calibration {number} ({one.content['campaign']})"
        if not np.isfinite(one.covariance).all():
            raise InputError(
                f"{where}: no sigmas; calibrate with more positions, or state the noise of the "
                "campaign"
            )
        if one.content["nominal"] != first.content["nominal"]:
            raise InputError(
                f"{where}: nominal: other scales or offsets from counts to m/s^2 than in the first "
                "calibration, so their parameters do not mean the same; import both logs with the "
                "same ones"
            )
        own = [effect.spec for effect in one.model.effects]
        if {*own} != {*names}:
            raise InputError(
                f"{where}: effects: {comma_list(own)}, but {comma_list(names)} in the first "
                "calibration; calibrate both campaigns with one `--model`"
            )


def size_text(size: float, unit: str) -> str:
    """Show a size to two digits."""
    return f"{estimate(size, size, unit)[1]} {shown_unit(unit)}".strip()


def change_text(parameter: Parameter, value: float, sigma: float) -> str:
    """Name a parameter with its change, or its rate, and the sigma of that; in SI."""
    shown, uncertain = estimate(value, sigma, parameter.unit)
    sign = "" if shown.startswith("−") else "+"
    return f"{parameter.name} by {sign}{shown} ± {uncertain} {shown_unit(parameter.unit)}".strip()


def largest_texts(parameters: Sequence[Parameter], sizes: Sequence[float] | Array) -> list[str]:
    """Name the largest of the sizes in each unit, with its parameter."""
    found: dict[str, tuple[float, str]] = {}
    for parameter, size in zip(parameters, sizes, strict=True):
        before = found.get(parameter.unit, (0.0, ""))
        found[parameter.unit] = max(before, (float(size), parameter.name))
    return [f"{size_text(size, unit)} in {name}" for unit, (size, name) in found.items()]
