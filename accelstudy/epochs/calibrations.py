"""Calibrations of one sensor, brought to the effects that all of them have.

If one has more effects, its sensor is calibrated again without them, as another one was: noise-free
readings that it would give in evenly spread attitudes, under the conditions of the other session,
by the approach of that.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from accelstudy.adjustment import calibrate
from accelstudy.approaches import get_approach
from accelstudy.basics.errors import InputError
from accelstudy.basics.units import shown_unit, to_display
from accelstudy.basics.wording import comma_list, estimate
from accelstudy.campaign.calibration.document import write_json
from accelstudy.campaign.calibration.fit import fit_campaign
from accelstudy.campaign.calibration.sensor_calibration import KNOWN, USUAL, SensorCalibration
from accelstudy.campaign.session import Campaign
from accelstudy.drawing.saving import save_all
from accelstudy.drawing.style import FULL, INK, new_figure, symbol
from accelstudy.effects import Parameter
from accelstudy.leveling.angles import angles_of
from accelstudy.pages import write_page
from accelstudy.pages.result import Result
from accelstudy.positions.points import evenly_spread
from accelstudy.sensors.models import compose, composition_name
from accelstudy.sensors.sensor import SensorModel
from accelstudy.simulation.sessions import Noise

Array = NDArray[np.float64]

STATES = {True: "unchanged", False: "changed"}
"""States of a result by whether the calibrations agree."""
POSITIONS = 60
"""Attitudes of the calibration that leaves out effects."""
STEP = 1e-2
"""Step of numerical derivatives, in sigmas."""
GOLDEN = (np.sqrt(5) - 1) / 2
PANELS = 3
"""Panels side by side."""


class Calibrations(Result):
    """Calibrations of one sensor, by the effects that all of them have.

    Attributes
    ----------
    calibrations : tuple of n SensorCalibration
    model : SensorModel, the effects that all have
    estimates : (n, p) array, SI
    covariances : (n, p, p) array
    dates : tuple of n datetime; empty if they say nothing of the time
    """

    dates: tuple[datetime, ...] = ()

    def __init__(self, calibrations: Sequence[SensorCalibration]) -> None:
        self.calibrations, self.model = tuple(calibrations), _common_model(calibrations)
        fewest = sorted(calibrations, key=lambda one: len(one.model.effects))[:2]
        each = [brought_to(one, self.model, fewest[one is fewest[0]]) for one in calibrations]
        self.estimates = np.array([estimates for estimates, _ in each])
        self.covariances = np.array([covariance for _, covariance in each])

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Parameters that all calibrations have."""
        return self.model.parameters

    @property
    def dof(self) -> Array:
        """Degrees of freedom by which the noise was estimated, (n,); inf if it is known."""
        return np.array([one.dof for one in self.calibrations])

    @property
    def sigmas(self) -> Array:
        """Sigmas of `estimates`."""
        return np.sqrt(np.diagonal(self.covariances, axis1=1, axis2=2))

    def left_out(self, one: SensorCalibration) -> list[str]:
        """Effects of a calibration that the common model lacks."""
        common = [effect.spec for effect in self.model.effects]
        return [effect.spec for effect in one.model.effects if effect.spec not in common]

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


def _common_model(calibrations: Sequence[SensorCalibration]) -> SensorModel:
    """Model of the effects that all calibrations have.

    Raises
    ------
    InputError
        If one of them has no sigmas, if they have no effect in common, or if their parameters do
        not mean the same because the readings were converted in another way. The line names the
        calibration by its number and its campaign.
    """
    common = [effect.spec for effect in calibrations[0].model.effects]
    for number, one in enumerate(calibrations, start=1):
        where = f"calibration {number} ({one.content['campaign']})"
        if not np.isfinite(one.covariance).all():
            raise InputError(
                f"{where}: no sigmas; calibrate with more positions, or state the noise of the "
                "campaign"
            )
        if one.content["nominal"] != calibrations[0].content["nominal"]:
            raise InputError(
                f"{where}: nominal: other scales or offsets from counts to m/s^2 than in the first "
                "calibration, so their parameters do not mean the same; import both logs with the "
                "same ones"
            )
        own = [effect.spec for effect in one.model.effects]
        if not (left := [spec for spec in common if spec in own]):
            raise InputError(
                f"{where}: effects: none in common with those before: {comma_list(own)} here, "
                f"{comma_list(common)} there"
            )
        common = left
    return compose(composition_name(compose("common", tuple(common)).effects), tuple(common))


def brought_to(
    calibration: SensorCalibration, model: SensorModel, like: SensorCalibration
) -> tuple[Array, Array]:
    """Parameters (p,) and covariance matrix (p, p) of a model with fewer effects.

    Parameters
    ----------
    calibration : SensorCalibration
    model : SensorModel, with some of its effects
    like : SensorCalibration, whose session and approach leave out the others
    """
    own, given, covariance = calibration.model, calibration.parameters, calibration.covariance
    if len(own.effects) == len(model.effects):
        order = [own.parameter_names.index(name) for name in model.parameter_names]
        return given[order], covariance[np.ix_(order, order)]
    directions = evenly_spread(POSITIONS)
    session = session_like(like, directions)
    approach = get_approach(str(like.content["approach"] or "gravity"))

    def readings(parameters: Array) -> Array:
        forces = -session.gravity * directions
        return own.sense(forces, parameters, session.gravity, session.hold)

    fit = fit_campaign(replace(session, forces=readings(given)), model, approach)
    steps = STEP * np.sqrt(np.diag(covariance))
    stepped = np.concatenate([given + np.diag(steps), given - np.diag(steps)])
    angles = fit.observed.angles
    observed = replace(
        fit.observed,
        forces=np.array([readings(parameters) for parameters in stepped]),
        angles=None if angles is None else np.repeat(angles, len(stepped), axis=0),
        initial=fit.parameters,
    )
    found = calibrate(model, approach, observed).parameters[:, : model.n_parameters]
    above, below = np.split(found, 2)
    slopes = ((above - below) / (2 * steps[:, None])).T
    return fit.parameters, slopes @ covariance @ slopes.T


def session_like(like: SensorCalibration, directions: Array) -> Campaign:
    """Session in which gravity has some directions, under the conditions of a calibration."""
    n, forces = len(directions), -like.gravity * directions
    columns = {}
    for k, (column, name) in enumerate(KNOWN.items(), start=1):
        low, high = like.ranges.get(name, USUAL[column])
        columns[column] = low + (high - low) * (GOLDEN * k * np.arange(n) % 1.0)
    return Campaign(
        "comparison",
        np.arange(1, n + 1),
        forces,
        like.gravity,
        sigma_force=Noise().sigma_force,
        angles=angles_of(forces),
        sigma_angle=Noise().sigma_angle,
        yaw=np.zeros(n),
        **columns,
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
