"""Calibrations of one sensor with one model, at two times or more: what changed, and how."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from datetime import date as calendar_date
from datetime import datetime
from functools import cached_property
from itertools import zip_longest
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from accelstudy.basics.arrays import Array
from accelstudy.basics.dates import read_date
from accelstudy.basics.errors import InputError, key, locate_errors
from accelstudy.basics.levels import REFUTATION_LEVEL
from accelstudy.basics.units import GON, MGON, shown_unit, to_display
from accelstudy.basics.wording import comma_list, estimate, plural
from accelstudy.campaign.calibration.sensor_calibration import SensorCalibration
from accelstudy.drawing.saving import save_all
from accelstudy.drawing.style import FULL, INK, group_colour, group_of, new_figure, symbol
from accelstudy.epochs.congruence import LEVEL, Congruence
from accelstudy.epochs.course import POSSIBLE, YEAR, ParameterCourse
from accelstudy.epochs.file_format import Calibration, HistoryDocument, Parameter, Test, Tilt
from accelstudy.epochs.interval import Interval
from accelstudy.files.outputs import HISTORY
from accelstudy.leveling.error import ATTITUDES, TiltError, cap_forces, tilt_error
from accelstudy.pages import render_lines, write_page
from accelstudy.pages.result import Result

MIN_COURSE = 3
"""Calibrations of which a line leaves a degree of freedom."""
MIN_DIFFERENCE = 1e-12
"""rad, largest difference of tilts that rounding may cause."""
PANELS = 3
"""Panels side by side."""


class History(Result):
    """Calibrations of one sensor over time: what changed, and what drifts or scatters.

    What changed is told by all parameters together, with their whole covariance matrices. Of two
    calibrations that is all; of three or more each parameter that changed is a line over time,
    or a step, beside which sessions scatter.

    Attributes
    ----------
    sessions : tuple of n SensorCalibration, in the order of time
    model : SensorModel
    estimates : (n, p) array, SI
    covariances : (n, p, p) array
    sigmas : (n, p) array
    dof : (n,) array, degrees of freedom of these; inf with stated noise
    dates : tuple of n datetime, or empty if there are two without any
    tilt_range : float, rad, over which tilts are compared
    change : accelstudy.epochs.congruence.Congruence, of all parameters
    courses : tuple of p accelstudy.epochs.course.ParameterCourse; empty for two calibrations
    interval : accelstudy.epochs.interval.Interval, how long the last calibration stays good enough;
        None if no accuracy was given
    """

    kind, document = HISTORY, HistoryDocument
    size = FULL, 70.0

    def __init__(
        self,
        calibrations: Sequence[SensorCalibration],
        dates: Sequence[datetime],
        tilt_range: float,
        accuracy: float | None = None,
        confidence: float = 0.95,
    ) -> None:
        """Put calibrations in the order of time.

        Parameters
        ----------
        calibrations, dates : of one sensor; two may have no dates, and are in their order then
        tilt_range : float, rad
        accuracy, confidence : as in `Interval`; None for no interval

        Raises
        ------
        InputError
            If they are fewer than two, of one date, or of different models.
        """
        if (n := len(calibrations)) < 2 or (accuracy is not None and n < MIN_COURSE):
            least = "two or more" if accuracy is None else "three or more to tell an interval"
            raise InputError(f"a history has {least}, not {n}")
        if dates and len(set(dates)) < 2 and n >= MIN_COURSE:
            raise InputError(f"{key('dates')}: all are the same; a rate needs two dates or more")
        order = sorted(range(n), key=dates.__getitem__) if dates else range(n)
        self.sessions = tuple(calibrations[i] for i in order)
        self.dates = tuple(dates[i] for i in order) if dates else ()
        _check_alike(self.sessions)
        self.model, self.tilt_range = self.sessions[0].model, tilt_range
        names = self.model.parameter_names
        places = [[one.model.parameter_names.index(x) for x in names] for one in self.sessions]
        noise = [_judge_noise(one, n) for one in self.sessions]
        each = [*zip(self.sessions, noise, places, strict=True)]
        self.estimates = np.array([one.parameters[at] for one, _, at in each])
        self.covariances = np.array([full[np.ix_(at, at)] for _, (full, _), at in each])
        self.sigmas = np.sqrt(np.diagonal(self.covariances, axis1=1, axis2=2))
        self.dof = np.array([dof for _, dof in noise])
        self.interval = None if accuracy is None else Interval(self, accuracy, confidence)

    @property
    def name(self) -> str:  # type: ignore[override]
        """What the calibrations are of: two campaigns, or a sensor over time."""
        campaigns = [one.campaign for one in self.calibrations]
        return " and ".join(campaigns) if len(campaigns) == 2 else self.sensor or campaigns[0]

    @property
    def sensor(self) -> str | None:
        """What was calibrated; None if no campaign says it."""
        return next((x for one in self.sessions if (x := one.document.sensor)), None)

    @property
    def effects(self) -> list[str]:
        """Effects that all calibrations have."""
        return [effect.spec for effect in self.model.effects]

    @cached_property
    def calibrations(self) -> list[Calibration]:
        """Campaigns with their dates, in the order of time."""
        each = zip_longest(self.sessions, (date.isoformat() for date in self.dates))
        return [Calibration(campaign=one.document.campaign, date=date) for one, date in each]

    @property
    def years(self) -> Array:
        """Times of the calibrations, (n,), in years since the last one; −1 and 0 without dates."""
        if not self.dates:
            return np.array([-1.0, 0.0])
        return np.array([(date - self.dates[-1]).total_seconds() / YEAR for date in self.dates])

    @cached_property
    def change(self) -> Congruence:
        """Congruence of all parameters."""
        return Congruence(self.estimates, self.covariances, self.dof)

    @property
    def test(self) -> Test:
        """Congruence test of all parameters."""
        return self.change.test

    @property
    def state(self) -> str:
        """Whether anything changed."""
        return "unchanged" if self.test.congruent else "changed"

    @cached_property
    def courses(self) -> list[ParameterCourse]:
        """Each parameter over time; none of two calibrations.

        Of two tests of each parameter that changed one may fail by chance, for a drift or a
        scatter, of which one is there: so all of them together have the level of one.
        """
        if len(self.sessions) < MIN_COURSE:
            return []
        level = LEVEL / self.model.n_parameters
        each = zip(self.estimates.T, np.square(self.sigmas).T, strict=True)
        return [ParameterCourse(self.years, *one, self.dof, level) for one in each]

    def tilt_error(self, first: Array, second: Array) -> TiltError:
        """Tilt error by one set of parameters for another, in conditions of the last session."""
        last = self.sessions[-1]
        forces = cap_forces(self.tilt_range, ATTITUDES, last.gravity)
        forces, hold = last.with_conditions(forces, self.model.hold_columns)
        return tilt_error(self.model, first, self.model, second, forces, last.gravity, hold)

    @cached_property
    def tilt(self) -> Tilt:
        """Rms by which roll and pitch differ, and that which chance would give.

        Readings are those of the sensor as it was at first; they are leveled as if it had not
        changed, and as it is at last.
        """
        error = self.tilt_error(self.estimates[0], self.estimates[-1])
        covariance = self.covariances[0] + self.covariances[-1]
        by_chance = np.einsum("auw,uw->a", error.quadratic, covariance)
        plain = np.where(error.constant > MIN_DIFFERENCE**2, error.constant, 0.0)
        (roll, pitch), (roll_by_chance, pitch_by_chance) = np.sqrt([plain, by_chance]) / MGON
        return Tilt(
            roll_mgon=roll,
            pitch_mgon=pitch,
            roll_by_chance_mgon=roll_by_chance,
            pitch_by_chance_mgon=pitch_by_chance,
            max_tilt_gon=self.tilt_range / GON,
        )

    @cached_property
    def parameters(self) -> list[Parameter]:
        """What each parameter does over time: nothing is found of one that did not change."""
        steady = 1 - self.years / self.years[0] if self.years[0] else np.array([0.0, 1.0])
        detectable, changed = self.change.detectable(steady), self.change.fewest_changes
        names, table = self.model.parameter_names, list[Parameter]()
        for k, parameter in enumerate(self.model.parameters):
            course = self.courses[k] if self.courses else None
            values, sigmas = self.estimates[:, k], self.sigmas[:, k]
            found = course.found if course else ("changed",)
            instead = self.change.instead_of(k) if k in changed else ()
            entry = {
                "name": parameter.name,
                "unit": parameter.unit,
                "values": values.tolist(),
                "sigmas": sigmas.tolist(),
                "change": values[-1] - values[0],
                "sigma": np.hypot(sigmas[0], sigmas[-1]),
                "detectable": detectable[k],
                "found": found if k in changed else (),
                "or": [names[i] for i in instead],
                "rate": course and course.rate,
                "scatter": course and course.scatter,
                "step": course and course.step,
            }
            table.append(Parameter.model_validate(entry))
        return table

    @cached_property
    def verdict(self) -> str:
        """What changed, drifts and scatters, and what it matters."""
        return " ".join(self.sentences)

    @cached_property
    def sentences(self) -> list[str]:
        """The verdict, sentence by sentence."""
        by_size = sorted(self.parameters, key=lambda one: one.detectable or 0.0)
        largest = {one.unit: one for one in by_size}

        def step_text(p: Parameter) -> str:
            assert p.step is not None
            after, before = (self.dates[k - 1].date() for k in (p.step.after, p.step.before))
            return f"{change_text(p, p.step.size, p.step.sigma)} between {after} and {before}"

        def texts(word: str, text: Callable[[Any], str]) -> list[str]:
            return [text(one) for one in self.parameters if word in one.found]

        return render_lines(
            "epochs/wording.txt.j2",
            "history",
            self,
            steps=texts("steps", step_text),
            possible=[
                step_text(p)
                for p in self.parameters
                if p.found and p.step and p.step.probability > POSSIBLE.get(p.found[0], 1.0)
            ],
            drifts=texts("drifts", lambda p: change_text(p, p.rate.per_year, p.rate.sigma)),
            scatters=texts("scatters", lambda p: f"{p.name} by {size_text(p.scatter.sd, p.unit)}"),
            changed=texts("changed", lambda p: change_text(p, p.change, p.sigma)),
            least=[
                f"{size_text(p.detectable or 0.0, p.unit)} in {p.name}"
                for p in self.parameters
                if largest[p.unit] is p
            ],
        )

    def to_frame(self) -> pd.DataFrame:
        """Return the change of each parameter, its rate a year and scatter, and what was found."""
        rows = pd.json_normalize([one.model_dump() for one in self.parameters]).set_index("name")
        rows["found"] = rows["found"].str.join(", ")
        names = {"rate.per_year": "rate_per_year", "rate.sigma": "sigma_rate"}
        rates = {**names, "scatter.sd": "scatter"} if self.courses else {}
        columns = ["change", "sigma", "detectable", *rates, "unit", "found"]
        return rows[columns].rename(columns=rates)

    def write(self, folder: Path, place: Path) -> None:
        """Write the page with its figure, and the JSON file."""
        write_page(
            folder / "report.html",
            "epochs/report.html.j2",
            self.verdict,
            doc=self.content,
            h=self,
            lines=self.sentences,
            figure=save_all({"history": self.figure}, folder / "figures")["history"],
        )
        super().write(folder, place)

    @property
    def _times(self) -> NDArray[Any]:
        """Times of the calibrations, for the axis of a figure: dates, or words without any."""
        if not self.dates:
            return np.array(["first", "second"])
        return np.array(self.dates, dtype="datetime64[us]")

    def draw(self, ax: Axes) -> None:
        """Draw the deviation of each parameter from the first calibration, over its sigma."""
        off = (self.estimates - self.estimates[0]) / self.sigmas
        ax.plot(self._times, off, "o-", markersize=3, label=self.model.parameter_names)
        ax.set(
            xlabel="date" if self.dates else "calibration", ylabel="change since the first / sigma"
        )
        ax.legend(ncols=4)

    def figure(self) -> Figure:
        """Draw each parameter in all calibrations with 95 % intervals, and its line."""
        rows = -(-len(self.parameters) // PANELS)
        figure = new_figure(FULL, 12 + 36 * rows)
        panels = figure.subplots(rows, PANELS, sharex=True, squeeze=False).ravel()
        for k, ax in enumerate(panels[: len(self.parameters)]):
            self._draw_parameter(ax, k)
            ax.tick_params(axis="x", labelbottom=k + PANELS >= len(self.parameters))
        for ax in panels[len(self.parameters) :]:
            ax.set_visible(False)
        lines = ", and lines; dotted: no drift found" if self.courses else ""
        figure.suptitle(f"Calibrations with 95 % intervals{lines}")
        return figure

    def _draw_parameter(self, ax: Axes, k: int) -> None:
        """Draw the calibrations of a parameter, and its line."""
        parameter, times = self.parameters[k], self._times
        unit, found = parameter.unit, parameter.found
        values, halves = (to_display(v[:, k], unit) for v in (self.estimates, 1.96 * self.sigmas))
        ax.errorbar(times, values, halves, fmt="o", color=INK, capsize=2, linewidth=0.8, ms=3)
        ax.set_title(symbol(parameter.name) + (f" ({' and '.join(found)})" if found else ""))
        ax.set_ylabel(shown_unit(unit))
        if self.dates:
            from matplotlib.dates import AutoDateLocator, ConciseDateFormatter

            locator = AutoDateLocator(minticks=2, maxticks=5)  # type: ignore[no-untyped-call]
            formatter = ConciseDateFormatter(locator)  # type: ignore[no-untyped-call]
            ax.xaxis.set(major_locator=locator, major_formatter=formatter)
        if self.courses:
            model = self.courses[k].model
            style = "-" if {"drifts", "steps"} & {*found} else ":"
            values = to_display(model.design @ model.estimates, unit)
            ax.plot(times, values, style, color=group_colour(group_of(parameter.name)))


def _judge_noise(calibration: SensorCalibration, n: int) -> tuple[Array, float]:
    """Covariance matrix of a calibration, and its degrees of freedom, among n calibrations.

    Of many calibrations some have residuals that are smaller by chance than the stated noise, and
    would seem to differ from all others. So a stated noise is taken for too large only at one level
    for all of them.
    """
    document = calibration.document
    test, variance = document.quality.global_test, document.variance_of_unit_weight
    quoted = calibration.covariance, calibration.dof
    if test is None or not variance or test.accepted or test.statistic > test.dof:
        return quoted
    refuted = test.p_value < REFUTATION_LEVEL / n
    return quoted if refuted else (quoted[0] / variance, test.sigma_dof or np.inf)


def _check_alike(calibrations: Sequence[SensorCalibration]) -> None:
    """Check that the parameters of all calibrations are known, and mean the same.

    Raises
    ------
    InputError
        If one of them has no sigmas, or other effects or another conversion of its readings than
        the first. The line names the calibration by its number and its campaign.
    """
    names = [effect.spec for effect in calibrations[0].model.effects]
    for number, one in enumerate(calibrations, start=1):
        own = [effect.spec for effect in one.model.effects]
        if not np.isfinite(one.covariance).all():
            why = "no sigmas; calibrate with more positions, or state the noise of the campaign"
        elif one.document.nominal != calibrations[0].document.nominal:
            why = (
                "nominal: other scales or offsets from counts to m/s^2 than in the first "
                "calibration, so their parameters do not mean the same; import both logs with the "
                "same ones"
            )
        elif {*own} != {*names}:
            why = (
                f"effects: {comma_list(own)}, but {comma_list(names)} in the first calibration; "
                "calibrate both campaigns with one model"
            )
        else:
            continue
        raise InputError(f"calibration {number} ({one.document.campaign}): {why}")


def dates_of(
    calibrations: Sequence[SensorCalibration],
    dates: Sequence[str | calendar_date],
    names: Sequence[str],
) -> list[datetime]:
    """Dates of calibrations that are given, or those of the campaigns; two may have none.

    Parameters
    ----------
    calibrations : sequence of SensorCalibration
    dates : sequence of str or date, of each calibration; none for those of the campaigns
    names : sequence of str, what messages call the calibrations

    Raises
    ------
    InputError
        If a date is missing or wrong.
    """
    if dates and len(dates) != len(calibrations):
        raise InputError(
            f"{key('dates')}: {plural(len(dates), 'date')} for "
            f"{plural(len(calibrations), 'calibration')}; give one for each, in their order, as "
            "2026-03-01"
        )
    stated = list[datetime]()
    for i, (one, name) in enumerate(zip(calibrations, names, strict=True)):
        date = dates[i] if dates else one.document.date
        if date is None and len(calibrations) < MIN_COURSE:
            return []
        if date is None:
            raise InputError(
                f"{name}: date: missing; give `dates` for each calibration, or calibrate "
                "again with `date` in the header of the campaign"
            )
        with locate_errors(key("dates") if dates else f"{name}: date"):
            stated.append(read_date(date))
    return stated


def check_different(calibrations: Sequence[SensorCalibration], names: Sequence[str]) -> None:
    """Raise `InputError` if a calibration is given twice."""
    first: dict[bytes, str] = {}
    for one, name in zip(calibrations, names, strict=True):
        # Noise never repeats: the same numbers are one campaign, whatever the file is called.
        if (same := first.setdefault(one.parameters.tobytes(), name)) is not name:
            raise InputError(f"{name}: has the numbers of {same}; each counts once")


def size_text(size: float, unit: str) -> str:
    """Show a size to two digits."""
    return f"{estimate(size, size, unit)[1]} {shown_unit(unit)}".strip()


def change_text(parameter: Parameter, value: float, sigma: float) -> str:
    """Name a parameter with its change, or its rate, and the sigma of that; in SI."""
    shown, uncertain = estimate(value, sigma, parameter.unit)
    sign, unit = "" if shown.startswith("−") else "+", shown_unit(parameter.unit)
    return f"{parameter.name} by {sign}{shown} ± {uncertain} {unit}".strip()
