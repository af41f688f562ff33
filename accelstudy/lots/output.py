"""A lot: what the model of its type lacks, a calibration of each sensor, and what it writes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from accelstudy.approaches import Approach
from accelstudy.basics import suggestions
from accelstudy.basics.errors import InputError
from accelstudy.basics.names import path_name
from accelstudy.basics.progress import say, show
from accelstudy.basics.units import GON, MGON, shown_unit, to_display
from accelstudy.basics.wording import probability
from accelstudy.campaign.calibration.campaign_fit import CampaignFit
from accelstudy.campaign.calibration.figures import SUSPECT
from accelstudy.campaign.calibration.file_format import CalibrationDocument
from accelstudy.campaign.calibration.fit import fit_campaign, usual_approach
from accelstudy.campaign.calibration.result import Calibration
from accelstudy.campaign.sensor_type import TYPE_FILE
from accelstudy.campaign.session import Campaign
from accelstudy.diagnosis.decision.problem import fit_base
from accelstudy.drawing.saving import save_all
from accelstudy.drawing.style import (
    FULL,
    INK,
    MISSING,
    group_colour,
    group_of,
    new_figure,
    say_empty,
    symbol,
)
from accelstudy.files.outputs import LOT
from accelstudy.leveling.error import (
    ATTITUDES,
    MAX_TILT_GON,
    cap_forces,
    holds_in_use,
    tilt_error,
)
from accelstudy.lots.evidence import either
from accelstudy.lots.file_format import LotDocument, Tilt
from accelstudy.lots.lot import LotDiagnosis, weigh_lot
from accelstudy.lots.passes import LEVEL, LotEffect
from accelstudy.lots.type_file import TypeParameter, write_type
from accelstudy.pages import render_lines, write_page
from accelstudy.pages.result import Result
from accelstudy.sensors.models import compose
from accelstudy.sensors.sensor import SensorModel

Array = NDArray[np.float64]

EACH = "each"
"""Folder of the calibrations of the sensors."""
MIN_SENSORS = 2
"""Sensors of the smallest lot."""


@dataclass(frozen=True, eq=False, repr=False)
class Lot(Result):
    """What the model of sensors of one type lacks, and a calibration of each of them.

    Attributes
    ----------
    diagnosis : accelstudy.lots.lot.LotDiagnosis, all that is missing
    model : SensorModel, that was diagnosed, without what was found
    fits : mapping of the numbers of sensors to calibrations with the model of the type
    failed : mapping of campaigns to why they have none
    left_out : mapping of campaigns that are not in the lot to why
    """

    kind, document = LOT, LotDocument

    diagnosis: LotDiagnosis
    model: SensorModel
    fits: Mapping[int, CampaignFit]
    failed: Mapping[str, str]
    left_out: Mapping[str, str]

    @property
    def name(self) -> str:  # type: ignore[override]
        """How many sensors there are."""
        return f"{len(self.diagnosis.last.sensors)} sensors"

    @classmethod
    def of(
        cls,
        campaigns: Sequence[Campaign],
        model: SensorModel,
        approach: Approach | None = None,
        seed: int = 1,
        cores: int = 1,
    ) -> Lot:
        """Say what the model of sensors of one type lacks, and calibrate each of them.

        Parameters
        ----------
        campaigns, model, approach, seed, cores : as in `weigh_lot`; campaigns of one name get their
            numbers behind it, and those of one log count once; what cannot be judged by itself, as
            it leaves no redundancy, is left out

        Raises
        ------
        InputError
            If fewer than two campaigns can be judged.
        """
        usable, without, first = list[Campaign](), dict[str, str](), dict[bytes, str]()
        names = [campaign.name for campaign in campaigns]
        for number, (given, name) in enumerate(zip(campaigns, names, strict=True), start=1):
            own = name if names.count(name) == 1 else f"{name} ({number})"
            campaign = given.with_header(name=own)
            # Noise never repeats: the same numbers are the same log, whatever its folder.
            if (same := first.setdefault(campaign.forces.tobytes(), own)) != own:
                without[own] = f"{own}: has the readings of {same}; each sensor counts once"
                continue
            try:
                fit_base(campaign, model, approach or usual_approach(campaign))
                usable.append(campaign)
            except InputError as error:
                without[own] = str(error)
        if len(usable) < MIN_SENSORS:
            why = next(iter(without.values()), "")
            raise InputError(why or "CAMPAIGN: a lot has two sensors or more; `diagnose` takes one")
        for name, why in without.items():
            say(f"not in the lot: {name}: {why.removeprefix(f'{name}: ')}")
        diagnosis = weigh_lot(usable, model, approach, seed, cores)
        fits, failed = dict[int, CampaignFit](), dict[str, str]()
        for i, sensor in enumerate(diagnosis.last.sensors):
            try:
                fits[i] = fit_campaign(sensor.campaign, sensor.model, sensor.approach)
            except InputError as error:
                failed[sensor.campaign.name] = str(error)
        return cls(diagnosis, model, fits, failed, without)

    @property
    def usual(self) -> dict[int, CampaignFit]:
        """Calibrations of the sensors that are not odd, by their numbers."""
        return {i: self.fits[i] for i in self.diagnosis.last.usual if i in self.fits}

    @property
    def calibrations(self) -> dict[str, Calibration]:
        """Calibration of each sensor with all that the model lacks, by its campaign."""
        return {fit.campaign.name: Calibration(fit) for fit in self.fits.values()}

    @cached_property
    def parameters(self) -> dict[str, TypeParameter]:
        """Parameters of the model of the type; of an effect, over the sensors that have it."""
        diagnosis, n = self.diagnosis, len(self.diagnosis.last.sensors)
        model, each = diagnosis.model, diagnosis.each
        values, sigmas = np.full((2, n, model.n_parameters), np.nan)
        for i, fit in self.fits.items():
            values[i], sigmas[i] = fit.parameters, np.sqrt(self._variances(i, fit))
        usual = np.isin(np.arange(n), diagnosis.last.usual)
        having = {
            name: np.array([found.names[0] in one.names for one in each])
            for found in diagnosis.effects
            for name in _parameters_of(found)
        }
        return {
            p.name: TypeParameter(
                p.name, p.unit, stays, values[:, j], sigmas[:, j], usual,
                having.get(p.name, np.ones(n, dtype=bool)),
            )
            for j, (p, stays) in enumerate(zip(model.parameters, model.stays.tolist(), strict=True))
        }  # fmt: skip

    def _sizes(self, found: LotEffect) -> list[TypeParameter]:
        """Parameters of an effect that was found."""
        return [self.parameters[name] for name in _parameters_of(found)]

    def _variances(self, i: int, fit: CampaignFit) -> Array:
        """Variances of the parameters of a sensor, (u,), by what all sensors tell of its noise.

        Its own estimate has few degrees of freedom: taken as it is, what is not known of the noise
        would look like scatter of the parameters.
        """
        own, noise = fit.sigma**2, self.diagnosis.last.sensors[i].noise
        if fit.noise.trusted or noise is None:
            return own
        r, ratio = fit.solution.redundancy, (noise.sigma / fit.sigma_position_posteriori) ** 2
        return own * float((r + noise.freedom * ratio) / (r + noise.freedom))

    @cached_property
    def tilt(self) -> Tilt | None:
        """Rms tilt error of the sensors by what their model lacked.

        It is over tilts up to `MAX_TILT_GON`, in the conditions of the campaigns, of sensors that
        are not odd, and without what the uncertainty of the parameters adds. None if nothing of the
        catalogue was found, or no sensor tells it.
        """
        squares = []
        if any(found.spec is not None for found in self.diagnosis.effects):
            for fit in self.usual.values():
                with suppress(InputError):
                    squares.append(_squared_error(fit, self.model))
        if not squares:
            return None
        roll, pitch = np.sqrt(np.maximum(np.mean(squares, axis=0), 0.0)) / MGON
        return Tilt(roll_mgon=roll, pitch_mgon=pitch, max_tilt_gon=MAX_TILT_GON)

    @property
    def state(self) -> str:
        """One of no_effect, named, unknown."""
        return self.diagnosis.state

    @cached_property
    def sentences(self) -> list[str]:
        """What the model lacks, what it is worth, which sensors are odd; the verdict is first."""
        d = self.diagnosis
        first = d.effects[0].names if d.effects else ()
        return render_lines(
            "lots/wording.txt.j2",
            "verdict",
            self,
            d,
            either,
            closest=[either(names[:3]) for names in d.close],
            alternatives=[f"{either(names[:3])} ({probability(p)})" for names, p in d.alternatives],
            alone=sum(one.p_value < LEVEL for one in d.evidence),
            single=sum(max(one.odds, key=one.odds.__getitem__) in first for one in d.evidence),
            max_tilt=MAX_TILT_GON * GON,
        )

    @cached_property
    def content(self) -> dict[str, Any]:
        """Content of lot.json, in SI."""
        d = self.diagnosis
        return LotDocument.content({
            "sensors": len(d.last.sensors),
            "anything": {"p_value": d.p_value, "missing": d.missing, "level": LEVEL},
            "effects": [one._replace(parameters=self._sizes(one)) for one in d.effects],
            "explained": d.explained,
            "close": d.close,
            "alternatives": d.alternatives,
            "odd": d.last.odd,
            "each": [one._replace(failed=self.failed.get(one.campaign)) for one in d.each],
            "left_out": [{"campaign": name, "reason": why} for name, why in self.left_out.items()],
            "tilt": self.tilt,
            "verdict": " ".join(self.sentences),
        })  # fmt: skip

    @property
    def effects(self) -> pd.DataFrame:
        """Parameters that the model lacks: mean and scatter over the sensors that have them."""
        rows = pd.json_normalize(self.content["effects"], "parameters", ["names", "share"])
        columns = ["effect", "share", "name", "mean", "scatter", "sigma", "unit"]
        rows = rows.reindex(columns=["names", *columns[1:]])
        return rows.assign(names=rows["names"].str.join(" or ")).set_axis(columns, axis=1)

    def to_frame(self) -> pd.DataFrame:
        """Return for each sensor which effects its model lacks, and their posterior probability."""
        odd = [one["campaign"] for one in self.content["odd"]]
        rows = pd.DataFrame(self.content["each"]).set_index("campaign")
        rows = rows.assign(effects=rows["names"].str.join(", "), odd=rows.index.isin(odd))
        return rows[["effects", "posterior", "odd", "failed"]]

    def tell(self, place: Path) -> None:
        """Print the verdict."""
        show(self.verdict)
        say(f"report: {place / 'report.html'}")

    def write(self, folder: Path, place: Path) -> None:
        """Write what `accelstudy lot` does."""
        for i, fit in self.fits.items():
            its_own = folder / EACH / f"{i + 1:04d}-{path_name(fit.campaign.name, 'sensor')}"
            its_own.mkdir(parents=True)
            CalibrationDocument.write(its_own, Calibration(fit).content)
        steps = []
        if write_type(self, folder):
            of_type, approach = place / TYPE_FILE, self.diagnosis.last.sensors[0].approach
            command = suggestions.calibrate("CAMPAIGN", of_type, approach.name, of_type)
            steps.append(("Calibrate the next sensor of the type, with what these tell", command))
        write_page(
            folder / "report.html",
            "lots/report.html.j2",
            self.verdict,
            doc=self.content,
            state=self.state,
            lines=self.sentences,
            either=either,
            figures=save_all({"sensors": self.figure}, folder / "figures"),
            next_steps=steps,
        )
        files = (path for path in folder.rglob("*") if path.is_file())
        names = sorted(path.relative_to(folder).as_posix() for path in files)
        LotDocument.write(folder, {**self.content, "files": names})

    @property
    def _drawn(self) -> Sequence[TypeParameter | None]:
        """Parameters that are drawn; None stands for those of a lot in which there are none."""
        return [one for found in self.diagnosis.effects for one in self._sizes(found)] or [None]

    def draw(self, ax: Axes) -> None:
        """Draw what each sensor has of the first parameter that the model lacks."""
        _draw_parameter(ax, self._drawn[0])
        ax.set_xlabel("sensor")

    def figure(self) -> Figure:
        """Draw what each sensor has of all that the model lacks, a parameter a row."""
        figure = new_figure(FULL, 24 + 30 * len(self._drawn))
        panels = figure.subplots(len(self._drawn), 1, sharex=True, squeeze=False)[:, 0]
        for ax, parameter in zip(panels, self._drawn, strict=True):
            _draw_parameter(ax, parameter)
        panels[-1].set_xlabel("sensor")
        figure.suptitle(
            "Each sensor with its 95 % interval; band: the type, ± 2 scatter; circle: odd"
        )
        return figure


def _parameters_of(found: LotEffect) -> Sequence[str]:
    """Names of the parameters of what was found; none of what is no effect."""
    return () if found.spec is None else compose(found.spec, (found.spec,)).parameter_names


def _squared_error(fit: CampaignFit, model: SensorModel) -> Array:
    """Square of the error less that by noise: of nested models the difference of covariances."""
    base = replace(fit_campaign(fit.campaign, model, fit.approach), judgement=fit.noise)
    f_b = cap_forces(MAX_TILT_GON * GON, ATTITUDES, fit.gravity)
    hold = holds_in_use(fit.campaign.hold, fit.campaign.n_positions, f_b)
    error = tilt_error(
        fit.model, fit.parameters, model, base.parameters, f_b, fit.gravity, hold
    ).constant
    by_noise = fit.tilt.parameters**2 - base.tilt.parameters**2
    return np.asarray(error - by_noise)


def _draw_parameter(ax: Axes, parameter: TypeParameter | None) -> None:
    """Draw a parameter of each sensor with its interval, the type as a band, and odd sensors."""
    if parameter is None:
        say_empty(ax, "nothing of the catalogue was found")
        return
    name, unit, strange = parameter.name, parameter.unit, ~parameter.usual
    places = np.arange(1, len(parameter.values) + 1)
    colour = group_colour(group_of(name))
    each, sigma = (to_display(x, unit) for x in (parameter.values, parameter.sigmas))
    mean, scatter = (float(to_display(x, unit)) for x in (parameter.mean, parameter.scatter))
    ax.axhspan(mean - 2 * scatter, mean + 2 * scatter, color=MISSING)
    ax.axhline(mean, color=colour, linewidth=0.8)
    ax.axhline(0, color=INK, linewidth=0.8)
    ax.errorbar(places, each, 1.96 * sigma, fmt="o", color=colour, capsize=2)
    ax.plot(places[strange], each[strange], "o", markersize=9, markerfacecolor="none",
            color=SUSPECT)  # fmt: skip
    ax.set_ylabel(f"{symbol(name)} / ({shown_unit(unit)})")
