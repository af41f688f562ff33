"""A batch: many campaigns, each calibrated by itself, and one overview of all."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import Any

import pandas as pd
from matplotlib.axes import Axes

from accelstudy.approaches import Approach
from accelstudy.basics import suggestions
from accelstudy.basics.arguments import path_of
from accelstudy.basics.errors import InputError
from accelstudy.basics.levels import ACCEPTED, BLIND, IMPLAUSIBLE, REJECTED, UNCHECKED
from accelstudy.basics.names import distinct, path_name
from accelstudy.basics.progress import say, show, track, warn
from accelstudy.basics.units import MGON, display_unit, to_display
from accelstudy.basics.wording import one_line, plural
from accelstudy.campaign.calibration.fit import fit_campaign
from accelstudy.campaign.calibration.result import Calibration
from accelstudy.campaign.format import read_campaign
from accelstudy.campaign.session import Campaign
from accelstudy.files.outputs import BATCH
from accelstudy.files.tables import write_table
from accelstudy.pages import write_page
from accelstudy.pages.result import Result
from accelstudy.sensors.sensor import SensorModel

FAILED = "not calibrated"
"""State of a campaign that cannot be calibrated."""
STATES = (FAILED, IMPLAUSIBLE, REJECTED, UNCHECKED, ACCEPTED)
"""States of campaigns, the worst first, which is that of their batch."""
EACH = "each"
"""Folder of the calibrations."""
COLUMNS = {
    "campaign": "name",
    "error": "error",
    "source": "source",
    "sensor": "sensor",
    "model": "model",
    "approach": "approach",
    "gravity_mps2": "gravity_mps2",
    "n_positions": "n_positions",
    "redundancy": "redundancy",
    "sigma_priori_mps2": "sigma_position_priori_mps2",
    "sigma_posteriori_mps2": "sigma_position_posteriori_mps2",
    "sigma_source": "sigma_source",
    "p_value": "quality.global_test.p_value",
    "accepted": "quality.global_test.accepted",
    "state": "quality.state",
    "suspects": "suspects",
    "rms_norm_residual_mps2": "rms_norm_residual_mps2",
    "held_out_mps2": "quality.held_out.rms_mps2",
    "held_out_roll_mgon": "quality.held_out.rms_roll_mgon",
    "held_out_pitch_mgon": "quality.held_out.rms_pitch_mgon",
    "tilt_roll_mgon": "quality.tilt_rms_mgon.roll",
    "tilt_pitch_mgon": "quality.tilt_rms_mgon.pitch",
    "verdict": "quality.verdict",
    "warnings": "warnings",
}
"""Columns of the table of campaigns, and their keys in calibration.json."""
PARAMETERS = ("value", "sigma", "ci95", "sigma_priori", "sigma_posteriori", "unit")
"""Columns of the table of parameters, besides campaign and parameter."""


class Batch(Result):
    """Many campaigns, each calibrated by itself; what cannot be calibrated stops no other.

    Attributes
    ----------
    calibrations : mapping of names of campaigns to Calibration
    failed : mapping of names of campaigns to what is wrong
    sources : mapping of all names to the folders of the campaigns
    """

    kind = BATCH

    def __init__(
        self,
        campaigns: Sequence[Campaign | str | PathLike[str]],
        model: SensorModel,
        approach: Approach | None = None,
    ) -> None:
        """Calibrate campaigns, or those of folders.

        Raises
        ------
        InputError
            If none can be calibrated.
        """
        self.name = plural(len(campaigns), "campaign")
        self.sources: dict[str, str] = {}
        self.calibrations: dict[str, Calibration] = {}
        self.failed: dict[str, str] = {}
        self._chosen = {"model": model.name, "approach": approach and approach.name}
        expected = "Campaigns or their folders"
        paths = [
            one.name if isinstance(one, Campaign) else path_of("campaigns", one, expected)
            for one in campaigns
        ]
        names = [path_name(Path(os.path.abspath(path)).name, "campaign") for path in paths]
        self.sources.update(zip(distinct(names), map(os.path.normpath, paths), strict=True))
        each = zip(track(campaigns, "campaigns"), self.sources.items(), strict=True)
        for given, (name, source) in each:
            try:
                campaign = given if isinstance(given, Campaign) else read_campaign(source)
                fit = fit_campaign(campaign, model, approach)
                self.calibrations[name] = Calibration(fit, source=Path(source))
            except InputError as error:
                self.failed[name] = one_line(error).removeprefix(f"{name}: ")
        if not self.calibrations:
            name, reason = next(iter(self.failed.items()))
            others = f" (and {len(self.failed) - 1} more)" if len(self.failed) > 1 else ""
            raise InputError(f"no campaign can be calibrated: {name}: {reason}{others}")

    @cached_property
    def content(self) -> Mapping[str, Any]:
        """State, verdict, and what is said of each campaign."""
        states = [row["state"] for row in self._rows]
        implausible = states.count(IMPLAUSIBLE)
        n = len(self.calibrations) - implausible
        doubt = f", {implausible} implausible" if implausible else ""
        return {
            "state": next(state for state in STATES if state in states),
            "verdict": f"{n} of {len(self.sources)} campaigns calibrated{doubt}",
            "campaigns": self._rows,
        }

    @cached_property
    def _rows(self) -> list[dict[str, Any]]:
        """The table of campaigns, a mapping for each."""
        failed = {
            name: {**self._chosen, "error": error, "quality": {"state": FAILED}}
            for name, error in self.failed.items()
        }
        calibrated = {
            name: {
                **one.content,
                "suspects": ", ".join(
                    str(n["position"]) for n in one.content["quality"]["suspects"]
                ),
                "warnings": "\n".join(one.warnings),
            }
            for name, one in self.calibrations.items()
        }
        documents = failed | calibrated
        rows = [{**documents[k], "name": k, "source": v} for k, v in self.sources.items()]
        flat = pd.json_normalize(rows).reindex(columns=[*COLUMNS.values()]).astype(object)
        table = flat.where(flat.notna(), None).set_axis([*COLUMNS], axis=1)
        return [{str(k): v for k, v in row.items()} for row in table.to_dict("records")]

    def to_frame(self) -> pd.DataFrame:
        """Return a row for each campaign, as campaigns.parquet has them."""
        return pd.DataFrame(self._rows, columns=[*COLUMNS]).convert_dtypes()

    @property
    def parameters(self) -> pd.DataFrame:
        """A row for each parameter of each campaign, SI."""
        each = {name: one.content["parameters"] for name, one in self.calibrations.items()}
        tables = {name: pd.DataFrame(rows)[["name", *PARAMETERS]] for name, rows in each.items()}
        table = pd.concat(tables, names=["campaign"]).reset_index("campaign")
        return table.rename(columns={"name": "parameter"}).reset_index(drop=True)

    def draw(self, ax: Axes) -> None:
        """Draw the tilt error that each calibration leaves."""
        table = self.to_frame()
        for angle in ("roll", "pitch"):
            shown = to_display(table[f"tilt_{angle}_mgon"].astype(float) * MGON, "rad")
            ax.plot(range(len(table)), shown, "o", label=angle)
        ax.set_xticks(range(len(table)), table["campaign"], rotation=90)
        ax.set(ylabel=f"tilt error left / {display_unit('rad')}", yscale="log")
        ax.legend()

    def tell(self, place: Path) -> None:
        """Print what is wrong with campaigns, and how many are calibrated."""
        for name, error in self.failed.items():
            warn(f"not calibrated: {name}: {error}")
        show(self.verdict)
        say(f"report: {place / 'report.html'}")

    def write(self, folder: Path, place: Path) -> None:
        """Write two tables, an overview, and what `accelstudy calibrate` does of each campaign."""
        for name, calibration in self.calibrations.items():
            (own := folder / EACH / name).mkdir(parents=True)
            calibration.write(own, place / EACH / name)
        write_table(folder / "parameters.parquet", self.parameters)
        write_page(
            folder / "report.html",
            "campaign/batch.html.j2",
            self.verdict,
            verdict=self.verdict,
            rows=sorted(self._rows, key=lambda row: STATES.index(row["state"])),
            each=EACH,
            blind=BLIND,
            next_steps=[*self._next_steps(place)],
        )
        write_table(folder / "campaigns.parquet", self.to_frame())

    def _next_steps(self, place: Path) -> Iterator[tuple[str, str]]:
        """What to do with the first good campaign, and with the first doubtful one."""
        good = [row for row in self._rows if row["state"] in (ACCEPTED, UNCHECKED)]
        for row in good[:1]:
            command = suggestions.apply(place / EACH / row["campaign"] / suggestions.HERE)
            yield "Level a log, for example", command
        doubtful = [row for row in self._rows if row["state"] in (REJECTED, IMPLAUSIBLE)]
        for row in doubtful[:1]:
            command = suggestions.diagnose(row["source"], row["model"], row["approach"])
            yield "Find what is wrong or missing, for example", command
