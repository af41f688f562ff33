"""A lot: what the model of its type lacks, a calibration of each sensor, and what it writes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from accelstudy.approaches import Approach
from accelstudy.basics import suggestions
from accelstudy.basics.errors import InputError
from accelstudy.basics.levels import MAX_TILT_GON
from accelstudy.basics.names import distinct, path_name
from accelstudy.basics.progress import say, show
from accelstudy.basics.units import GON
from accelstudy.basics.wording import probability
from accelstudy.campaign.calibration.file_format import CalibrationDocument
from accelstudy.campaign.calibration.fit import usual_approach
from accelstudy.campaign.calibration.result import Calibration
from accelstudy.campaign.sensor_type import TYPE_FILE
from accelstudy.campaign.session import Campaign
from accelstudy.drawing.saving import save_all
from accelstudy.drawing.style import FULL, new_figure, say_empty
from accelstudy.files.outputs import LOT
from accelstudy.lots.calibration import LotCalibration
from accelstudy.lots.evidence import Sensor, either
from accelstudy.lots.file_format import LotDocument
from accelstudy.lots.lot import LotDiagnosis, weigh_lot
from accelstudy.lots.passes import LEVEL
from accelstudy.lots.type_file import write_type
from accelstudy.lots.type_parameter import TypeParameter
from accelstudy.pages import render_lines, write_page
from accelstudy.pages.result import Result
from accelstudy.sensors.sensor import SensorModel

EACH = "each"
"""Folder of the calibrations of the sensors."""
MIN_SENSORS = 2
"""Sensors of the smallest lot."""


@dataclass(frozen=True, eq=False, repr=False)
class Lot(Result):
    """What the model of sensors of one type lacks, and a calibration of each of them.

    Attributes
    ----------
    calibration : accelstudy.lots.calibration.LotCalibration, of the sensors and of their type
    left_out : mapping of campaigns that are not in the lot to why
    """

    kind, document = LOT, LotDocument

    calibration: LotCalibration
    left_out: Mapping[str, str]

    @property
    def diagnosis(self) -> LotDiagnosis:
        """All that is missing."""
        return self.calibration.diagnosis

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
        campaigns : of the sensors; those of one name get their numbers behind it, and those of one
            log count once; what cannot be judged by itself, as it leaves no redundancy, is left out
        model : SensorModel
        approach : Approach; by default robot-aided where a campaign has the robot's angles
        seed : int, of the draws
        cores : int, as in `weigh_lot`

        Raises
        ------
        InputError
            If fewer than two campaigns can be judged.
        """
        usable, left_out, first = list[Sensor](), dict[str, str](), dict[bytes, str]()
        names = distinct([campaign.name for campaign in campaigns])
        seeds = np.random.SeedSequence(seed).spawn(len(names))
        for unnamed, own, draws in zip(campaigns, names, seeds, strict=True):
            campaign = unnamed.with_header(name=own)
            # Noise never repeats: the same numbers are the same log, whatever its folder.
            if (same := first.setdefault(campaign.forces.tobytes(), own)) != own:
                left_out[own] = f"has the readings of {same}; each sensor counts once"
                continue
            by = approach or usual_approach(campaign)
            sensor = Sensor(campaign, model, by, draws)
            try:
                sensor.fit()
                usable.append(sensor)
            except InputError as error:
                left_out[own] = str(error).removeprefix(f"{own}: ")
        reasons = [f"{name}: {why}" for name, why in left_out.items()]
        if len(usable) < MIN_SENSORS:
            raise InputError([*reasons, "a lot has two sensors or more; `diagnose` takes one"][0])
        for reason in reasons:
            say(f"not in the lot: {reason}")
        return cls(LotCalibration.of(weigh_lot(usable, cores)), left_out)

    @property
    def calibrations(self) -> dict[str, Calibration]:
        """Calibration of each sensor with all that the model lacks, by its campaign."""
        return {fit.campaign.name: Calibration(fit) for fit in self.calibration.fits.values()}

    @property
    def state(self) -> str:
        """One of no_effect, named, unknown."""
        if not self.diagnosis.missing or self.diagnosis.only_odd:
            return "no_effect"
        return "named" if self.diagnosis.effects else "unknown"

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
            alternatives=[
                f"{either(one.names[:3])} ({probability(one.posterior)})" for one in d.alternatives
            ],
            tested_alone=sum(one.p_value < LEVEL for one in d.evidence),
            named_alone=sum(max(one.odds, key=one.odds.__getitem__) in first for one in d.evidence),
            missing=[either(one.names) for one in d.effects if one.spec],
            max_tilt=MAX_TILT_GON * GON,
        )

    @cached_property
    def content(self) -> dict[str, Any]:
        """Content of lot.json, in SI."""
        d, failed, sizes = self.diagnosis, self.calibration.failed, self.calibration.sizes
        return LotDocument.content({
            "sensors": len(d.last.sensors),
            "anything": {"p_value": d.p_value, "missing": d.missing, "level": LEVEL},
            "effects": [one._replace(parameters=sizes(one)) for one in d.effects],
            "explained": d.explained,
            "close": d.close,
            "alternatives": d.alternatives,
            "odd": [*d.odd.values()],
            "each": [{**dict(one), "failed": failed.get(one.campaign)} for one in d.each],
            "left_out": [{"campaign": name, "reason": why} for name, why in self.left_out.items()],
            "tilt": self.calibration.tilt,
            "verdict": " ".join(self.sentences),
        })  # fmt: skip

    @property
    def effects(self) -> pd.DataFrame:
        """Parameters that the model lacks: mean and scatter over the sensors that have them."""
        rows = pd.json_normalize(self.content["effects"], "parameters", ["names", "share"])
        columns = ["effect", "share", "name", "mean", "scatter", "sigma", "unit"]
        rows = rows.reindex(columns=["names", *columns[1:]])
        return rows.assign(names=rows["names"].map(" or ".join)).set_axis(columns, axis=1)

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
        for i, fit in self.calibration.fits.items():
            its_own = folder / EACH / f"{i + 1:04d}-{path_name(fit.campaign.name, 'sensor')}"
            its_own.mkdir(parents=True)
            CalibrationDocument.write(its_own, Calibration(fit).content)
        steps = []
        if write_type(self.calibration, folder):
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

    @cached_property
    def _drawn(self) -> Sequence[TypeParameter]:
        """Parameters that are drawn: all that the model lacks."""
        return [one for found in self.diagnosis.effects for one in self.calibration.sizes(found)]

    def draw(self, ax: Axes) -> None:
        """Draw what each sensor has of the first parameter that the model lacks."""
        self._draw_each([ax])

    def figure(self) -> Figure:
        """Draw what each sensor has of all that the model lacks, a parameter a row."""
        rows = max(len(self._drawn), 1)
        figure = new_figure(FULL, 24 + 30 * rows)
        self._draw_each([*figure.subplots(rows, 1, sharex=True, squeeze=False)[:, 0]])
        figure.suptitle(
            "Each sensor with its 95 % interval; band: the type, ± 2 scatter; circle: odd"
        )
        return figure

    def _draw_each(self, panels: Sequence[Axes]) -> None:
        """Draw as many parameters as there are panels."""
        for ax, parameter in zip(panels, self._drawn, strict=False):
            parameter.draw(ax)
        if not self._drawn:
            say_empty(panels[0], "nothing of the catalogue was found")
        panels[-1].set_xlabel("sensor")
