"""The result of `accelstudy.diagnose`: what is told, drawn and written of a diagnosis."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import asdict
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from numpy.linalg import LinAlgError

from accelstudy.basics import plugins, suggestions
from accelstudy.basics.arrays import CachedTable
from accelstudy.basics.errors import InputError
from accelstudy.basics.names import MAX_NAME_BYTES
from accelstudy.basics.progress import say, show, stage, warn
from accelstudy.basics.units import GON, MGON
from accelstudy.campaign.calibration.document import calibration_document
from accelstudy.campaign.calibration.file_format import CalibrationDocument
from accelstudy.campaign.calibration.result import Calibration
from accelstudy.campaign.calibration.sensor_calibration import unknown_to_devices
from accelstudy.diagnosis.decision.statement import Part
from accelstudy.diagnosis.file_format import DiagnosisDocument
from accelstudy.diagnosis.report import words
from accelstudy.diagnosis.report.figures import diagnosis_figures, draw_explanations
from accelstudy.diagnosis.result import MISSING, CampaignDiagnosis, TiltErrors
from accelstudy.diagnosis.rules import RULES
from accelstudy.drawing.saving import save_all
from accelstudy.drawing.style import COLUMN
from accelstudy.files.outputs import DIAGNOSIS, write_yaml
from accelstudy.files.tables import write_table
from accelstudy.pages import write_page
from accelstudy.pages.result import Result
from accelstudy.sensors.frames import FRD, axes_note
from accelstudy.sensors.models import MODELS, composition_name


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

    @property
    def state(self) -> str:
        """One of no_effect, named, narrowed, learned, unknown, noise_model, gross_error."""
        return self.result.verdict

    @cached_property
    def sentences(self) -> list[str]:
        """What was found; the verdict is first."""
        return words.verdict_lines(self.result)

    @property
    def verdict(self) -> str:
        """What was found, in sentences."""
        return " ".join(self.sentences)

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

    # --- the calibration ----------------------------------------------------------------------

    @property
    def calibration(self) -> Calibration:
        """The calibration with what was found; raises `InputError` if there can be none."""
        if isinstance(self._calibration, str):
            raise InputError(f"the diagnosis gives no calibration: {self._calibration}")
        return self._calibration

    @cached_property
    def _calibration(self) -> Calibration | str:
        """The calibration with what was found; why there is none if it cannot be assessed."""
        warnings = words.render("warnings", self.result)
        try:
            fit = self.result.final_fit
            content = calibration_document(fit, self.result.recognised, warnings)
        except (InputError, LinAlgError) as error:
            return str(error)
        return Calibration(fit, content)

    # --- the files ----------------------------------------------------------------------------

    @cached_property
    def content(self) -> dict[str, Any]:
        """Content of diagnosis.json; in SI but for keys that name another unit."""
        d, test, calibration = self.result, self.result.base_fit.global_test, self._calibration
        file: dict[str, Any] = {"file": None, "reason": calibration}
        if isinstance(calibration, Calibration):
            file = {"file": "calibration.json", "mended": calibration.content["mended"]}
        return DiagnosisDocument.content({
            "campaign": d.campaign.name,
            "approach": d.base.approach.name,
            "model": d.model.name,
            "axes": FRD.name,
            "verdict": d.verdict,
            "reason": "; ".join(words.clauses(d.reason)),
            "fits": d.fits,
            "global_test": {
                "statistic": d.base.omega,
                "dof": d.base.redundancy,
                "p_value": test and test.p_value,
                "sigma": "known" if d.sigma_known else "unknown",
            },
            "noise": {
                "sigma_mps2": d.final_fit.sigma_position,
                "sigma_source": "a-priori" if d.noise.trusted else "residuals",
                "tests": d.noise_tests,
            },
            "screening": {
                "p_value": d.problem.p_value,
                "simulations": d.problem.chance.simulations,
                "candidates": [*d.problem.field.names],
            },
            "posterior": d.probabilities,
            "credible_set": d.credible_set,
            "certain": [self._certain(part) for part in d.finding.statement.certain],
            "effects": d.effects,
            "suspects": [{"position": label, "p_value": p} for label, p in d.suspects.items()],
            "shape": self._shape(),
            "like": d.like,
            "gap": self._gap(),
            "invisible_effects": d.frame.tested.invisible,
            "untestable_effects": d.frame.tested.untestable,
            "upper_limits": d.upper_limits,
            "next_positions": d.next_positions,
            "redundancy": d.frame.residuals.redundancy,
            "n_positions": d.campaign.n_positions,
            "warnings": d.campaign.warnings,
            "rules": asdict(RULES),
            "calibration": file,
        })  # fmt: skip

    def _certain(self, part: Part) -> dict[str, Any]:
        """Describe what is certain, with the effect of the extended model that stands for it."""
        names = [name.name for name in part.names]
        found = (one for one in self.result.found if one.name in names and one.parameters)
        added = next(found, None)
        spec, parameters = (None, ()) if added is None else (added.spec, added.parameters)
        return {**vars(part), "names": names, "spec": spec, "parameters": parameters}

    def _shape(self) -> dict[str, Any] | None:
        """Describe the function that was learned, if one was."""
        if (shape := self.result.shape) is None:
            return None
        coordinate, target = shape.place
        return {
            "coordinate": coordinate,
            "target": target,
            "axes": shape.axes,
            "subject": words.subject(shape),
            "function": shape.function,
        }

    def _gap(self) -> dict[str, Any]:
        """Describe how far the disagreement shrinks by what was found."""
        d, confirmation = self.result, self.result.confirmation
        variances, test = d.variances, confirmation.test
        tilt = dict.fromkeys(TiltErrors._fields)
        if d.leveling is not None:
            tilt = {name: value / MGON for name, value in d.leveling._asdict().items()}
        return {
            "sigma0_squared": {"before": variances["base"], "after": variances.get("extended")},
            "held_out_mse": test or dict.fromkeys(("before", "after", "floor")),
            "held_out_z": test and test.z,
            "held_out_positions": d.campaign.positions[list(test.held) if test else []],
            "leveling_rms_mgon": tilt,
            "better_for_leveling": d.better_for_leveling,
            "confirmed": confirmation.confirmed,
            "confirmed_statement": confirmation.statement,
            "confirmed_names": confirmation.names,
            "reason": confirmation.reason,
        }

    @CachedTable
    def positions(self) -> pd.DataFrame:
        """One row per position, in SI unless the name of a column says otherwise.

        Columns
        -------
        position, time_s, roll_gon, pitch_gon, temperature_degC : what was measured; NaN if it was
            not
        split : "fit", "held-out", or "left out" of the final fit as an outlier
        residual_*_before_mps2, residual_*_after_mps2 : what the readings lack of the conditions, by
            the base fit and by the final one: the output less that in the robot's attitude, or the
            norm of f_b less gravity
        """
        d, campaign, test = self.result, self.result.campaign, self.result.confirmation.test
        split = np.where(d.used_positions, "fit", "left out").astype(object)
        if test is not None:
            split[list(test.held)] = "held-out"
        roll, pitch = d.frame.angles.T / GON
        columns = {
            "position": campaign.positions,
            "time_s": np.nan if campaign.time is None else campaign.time,
            "roll_gon": roll,
            "pitch_gon": pitch,
            "temperature_degC": np.nan if campaign.temperature is None else campaign.temperature,
            "split": split,
        }
        table = pd.DataFrame(columns)
        fits = (
            ("before", d.base, np.arange(campaign.n_positions)),
            ("after", d.final.solution, np.flatnonzero(d.used_positions)),
        )
        for when, fitted, rows in fits:
            names = ("norm",) if fitted.misclosures.shape[1] == 1 else ("x", "y", "z")
            for name, values in zip(names, fitted.misclosures.T, strict=True):
                table[f"residual_{name}_{when}_mps2"] = pd.Series(values, rows)
        return table

    @property
    def model_content(self) -> dict[str, Any]:
        """Content of model.yaml: the extended model, for wherever a model is asked for."""
        base, extended = self.result.model, self.result.extended_model
        added = extended.effect_names[len(base.effects) :]
        name = "-".join([re.sub(r"[^A-Za-z0-9_-]+", "-", composition_name(base.effects)), *added])
        if name in MODELS or len(name) > MAX_NAME_BYTES:
            name = "extended"
        return {
            **plugins.file_key(),
            "models": {name: [effect.spec for effect in extended.effects]},
        }

    def write(self, folder: Path, place: Path) -> None:
        """Write what `accelstudy diagnose` does; diagnosis.json comes last."""
        d, calibration = self.result, self._calibration
        content = None if isinstance(calibration, str) else calibration.content
        with stage("figures and page"):
            write_table(folder / "positions.parquet", self.positions)
            if content is not None:
                CalibrationDocument.write(folder, content)
            write_yaml(folder / "model.yaml", self.model_content)
            write_page(
                folder / "report.html",
                "diagnosis/report/report.html.j2",
                self.verdict,
                d=d,
                doc=self.content,
                w=words,
                lines=self.sentences,
                figures=save_all(diagnosis_figures(d, self.positions), folder / "figures"),
                calibration=content,
                rules=RULES,
                missing=MISSING,
                next_steps=self._next_steps(content, place),
            )
            DiagnosisDocument.write(folder, self.content)

    def _next_steps(
        self, calibration: Mapping[str, Any] | None, place: Path
    ) -> list[tuple[str, str]]:
        """Say what to do next, most urgent first: what for, and the command.

        Parameters
        ----------
        calibration : mapping, content of calibration.json; None if there is none
        place : path of the folder of the results
        """
        d, steps = self.result, []
        chosen = (self.source, d.model.name, d.base.approach.name, d.campaign.prior)
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
        if not unknown_to_devices(d.extended_model.without_rig):
            steps.append(("Take it to a device", suggestions.export("c", result)))
        if d.extended_model is not d.model:
            command = suggestions.calibrate("CAMPAIGN", place / "model.yaml", d.base.approach.name)
            steps.append(("Calibrate the next campaign with this model", command))
        return steps

    def tell(self, place: Path) -> None:
        """Print the verdict and what is said with it."""
        campaign = self.result.campaign
        for warning in campaign.warnings:
            warn(warning)
        if self.result.recognised is not None:
            warn(f"calibration.json is of mended data: {self.result.recognised.reason}")
        verdict, *lines = self.sentences
        show(verdict)
        for line in lines:
            say(line)
        log = campaign.header.log
        if log is not None and log.frame != FRD.name:
            say(axes_note(log.frame))
        say(f"report: {place / 'report.html'}")
