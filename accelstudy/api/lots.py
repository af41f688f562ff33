"""Sensors of one type together."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path
from typing import Any

import pandas as pd
from matplotlib.axes import Axes

from accelstudy.api.calibrations import Calibration
from accelstudy.basics.errors import InputError
from accelstudy.basics.progress import say, show
from accelstudy.files.outputs import LOT
from accelstudy.lots.calibrated import CalibratedLot
from accelstudy.lots.output import draw_sensors, lot_document, write_lot
from accelstudy.pages.result import Result


class Lot(Result):
    """What the model of sensors of one type lacks, and a calibration of each of them.

    Attributes
    ----------
    report : accelstudy.lots.calibrated.CalibratedLot, all of it
    """

    kind = LOT

    def __init__(self, report: CalibratedLot) -> None:
        self.report, self.name = report, f"{len(report.lot.sensors)} sensors"

    @cached_property
    def content(self) -> dict[str, Any]:
        """Content of lot.json."""
        return lot_document(self.report)

    @property
    def state(self) -> str:
        """One of no_effect, named, unknown."""
        return self.report.lot.state

    @property
    def effects(self) -> pd.DataFrame:
        """Parameters that the model lacks: mean and scatter over the sensors that have them."""
        rows = [
            {"effect": " or ".join(one["names"]), "share": one["share"], **size}
            for one in self.content["effects"]
            for size in one["parameters"]
        ]
        columns = ["effect", "share", "name", "mean", "scatter", "sigma", "unit"]
        return pd.DataFrame(rows, columns=columns)

    def to_frame(self) -> pd.DataFrame:
        """Return for each sensor which effects its model lacks, and their posterior probability."""
        odd = [one["campaign"] for one in self.content["odd"]]
        rows = pd.DataFrame(self.content["each"]).set_index("campaign")
        rows = rows.assign(effects=rows["names"].str.join(", "), odd=rows.index.isin(odd))
        return rows[["effects", "posterior", "odd", "failed"]]

    @property
    def calibrations(self) -> dict[str, Calibration]:
        """Calibration of each sensor with all that the model lacks, by its campaign."""
        return {
            fit.campaign.name: Calibration(None, fit)
            for fit in self.report.fits
            if not isinstance(fit, InputError)
        }

    def tell(self, place: Path) -> None:
        """Print the verdict."""
        show(self.verdict)
        say(f"report: {place / 'report.html'}")

    def draw(self, ax: Axes) -> None:
        """Draw what each sensor has of the first parameter that the model lacks."""
        draw_sensors(ax, self.report)

    def write(self, folder: Path, place: Path) -> None:
        """Write what `accelstudy lot` does."""
        write_lot(self.report, self.content, folder, place)
