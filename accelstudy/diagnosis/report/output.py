"""The result of `accelstudy.diagnose`: what is told, drawn and written of a diagnosis."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import Any

import pandas as pd
import yaml
from matplotlib.axes import Axes
from numpy.linalg import LinAlgError

from accelstudy.basics import suggestions
from accelstudy.basics.errors import InputError
from accelstudy.basics.progress import say, show, stage, warn
from accelstudy.campaign.calibration.file_format import CalibrationDocument
from accelstudy.campaign.calibration.result import Calibration
from accelstudy.campaign.calibration.sensor_calibration import unknown
from accelstudy.diagnosis.file_format import DiagnosisDocument
from accelstudy.diagnosis.report import document, words
from accelstudy.diagnosis.report.figures import diagnosis_figures, draw_explanations
from accelstudy.diagnosis.result import MISSING, CampaignDiagnosis
from accelstudy.diagnosis.rules import RULES
from accelstudy.drawing.saving import save_all
from accelstudy.drawing.style import COLUMN
from accelstudy.files.outputs import DIAGNOSIS, whole_file
from accelstudy.files.tables import write_table
from accelstudy.pages import write_page
from accelstudy.pages.result import Result
from accelstudy.sensors.frames import FRD, axes_note


class Diagnosis(Result):
    """A diagnosis: which effects, seen in a campaign, a model lacks.

    Attributes
    ----------
    result : accelstudy.diagnosis.result.CampaignDiagnosis, all of it
    source : path of the campaign, for the commands that are suggested
    """

    kind = DIAGNOSIS

    def __init__(self, result: CampaignDiagnosis, source: Path | None = None) -> None:
        self.result, self.name = result, result.campaign.name
        self.source = Path("CAMPAIGN") if source is None else source
        self.size = COLUMN, 25.0 + 8 * len(result.credible_set)

    @cached_property
    def content(self) -> dict[str, Any]:
        """Content of diagnosis.json."""
        calibration = self._calibration
        file: dict[str, Any] = {"file": None, "reason": calibration}
        if not isinstance(calibration, str):
            file = {"file": "calibration.json", "mended": calibration["mended"]}
        return document.diagnosis_document(self.result, file)

    @cached_property
    def _calibration(self) -> dict[str, Any] | str:
        """Content of calibration.json; why there is none if it cannot be assessed."""
        try:
            return document.diagnosed_calibration(self.result)
        except (InputError, LinAlgError) as error:
            return str(error)

    @property
    def calibration(self) -> Calibration:
        """The calibration with what was found; raises `InputError` if there can be none."""
        content = self._calibration
        if isinstance(content, str):
            raise InputError(f"the diagnosis gives no calibration: {content}")
        return Calibration(document.diagnosed_fit(self.result), content)

    @property
    def state(self) -> str:
        """One of no_effect, named, narrowed, learned, unknown, noise_model, gross_error."""
        return self.result.verdict

    @property
    def verdict(self) -> str:
        """What was found, in sentences."""
        return " ".join(words.verdict_lines(self.result))

    @property
    def explanations(self) -> pd.DataFrame:
        """What may be missing, and its posterior probability, most probable first."""
        rows = [(" with ".join(one.names), one.posterior) for one in self.result.credible_set]
        return pd.DataFrame(rows, columns=["explanation", "posterior"])

    def to_frame(self) -> pd.DataFrame:
        """Return the explanations."""
        return self.explanations

    def draw(self, ax: Axes) -> None:
        """Draw the posterior probabilities of the explanations."""
        draw_explanations(ax, self.result.credible_set)

    def write(self, folder: Path, place: Path) -> None:
        """Write what `accelstudy diagnose` does; diagnosis.json comes last."""
        d, calibration = self.result, self._calibration
        content = None if isinstance(calibration, str) else calibration
        with stage("figures and page"):
            positions = document.positions_table(d)
            write_table(folder / "positions.parquet", positions)
            if content is not None:
                CalibrationDocument.write(folder, content)
            with whole_file(folder / "model.yaml") as path:
                text = yaml.safe_dump(document.model_file(d), sort_keys=False, allow_unicode=True)
                path.write_text(text, encoding="utf-8")
            write_page(
                folder / "report.html",
                "diagnosis/report/report.html.j2",
                self.verdict,
                d=d,
                doc=self.content,
                w=words,
                lines=words.verdict_lines(d),
                figures=save_all(diagnosis_figures(d, positions), folder / "figures"),
                calibration=content,
                rules=RULES,
                missing=MISSING,
                next_steps=next_steps(d, content, self.source, place),
            )
            DiagnosisDocument.write(folder, self.content)

    def tell(self, place: Path) -> None:
        """Print the verdict and what is said with it."""
        campaign = self.result.campaign
        for warning in campaign.warnings:
            warn(warning)
        if self.result.recognised is not None:
            warn(f"calibration.json is of mended data: {self.result.recognised.reason}")
        verdict, *lines = words.verdict_lines(self.result)
        show(verdict)
        for line in lines:
            say(line)
        log = campaign.header.log
        if log is not None and log.frame != FRD.name:
            say(axes_note(log.frame))
        say(f"report: {place / 'report.html'}")


def next_steps(
    diagnosis: CampaignDiagnosis,
    calibration: Mapping[str, Any] | None,
    campaign: Path,
    place: Path,
) -> list[tuple[str, str]]:
    """Say what to do next, most urgent first: what for, and the command.

    Parameters
    ----------
    diagnosis : CampaignDiagnosis
    calibration : mapping, of `diagnosed_calibration`; None if there is none
    campaign, place : paths of the folders of the campaign and of the results
    """
    d, steps = diagnosis, []
    chosen = (campaign, d.model.name, d.approach.name, d.campaign.prior)
    result = place / suggestions.HERE
    if d.recognised is not None:
        command = suggestions.calibrate(*chosen)
        steps.append(("Correct the campaign, and calibrate it then", command))
    if d.verdict in ("narrowed", "unknown", "learned"):
        which = "the next positions" if d.next_positions else "positions"
        what = f"Add {which} to the campaign, and diagnose it again"
        steps.append((what, suggestions.diagnose(*chosen)))
    if d.better_for_leveling == "base":
        command = suggestions.calibrate(*chosen)
        return [*steps, ("Calibrate with the base model, which levels better", command)]
    if calibration is None or not calibration["quality"]["plausible"]:
        return steps
    use = "Level a log with the calibration that is beside this page"
    steps.append((use, suggestions.apply(result)))
    if not unknown(d.extended_model.without_rig):
        steps.append(("Take it to a device", suggestions.export("c", result)))
    if d.extended_model is not d.model:
        command = suggestions.calibrate("CAMPAIGN", place / "model.yaml", d.approach.name)
        steps.append(("Calibrate the next campaign with this model", command))
    return steps
