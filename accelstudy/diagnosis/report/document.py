"""The files for programs: diagnosis.json, calibration.json, model.yaml and positions.parquet."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np
import pandas as pd

from accelstudy.adjustment.quality import Solution
from accelstudy.basics import plugins
from accelstudy.basics.names import MAX_NAME_BYTES
from accelstudy.basics.units import GON, MGON
from accelstudy.campaign.calibration.campaign_fit import CampaignFit
from accelstudy.campaign.calibration.document import calibration_document
from accelstudy.campaign.calibration.fit import campaign_estimability
from accelstudy.diagnosis.consequences import TiltErrors
from accelstudy.diagnosis.decision.statement import Part
from accelstudy.diagnosis.file_format import DiagnosisDocument
from accelstudy.diagnosis.report.words import clauses, warnings
from accelstudy.diagnosis.result import CampaignDiagnosis
from accelstudy.diagnosis.rules import RULES
from accelstudy.diagnosis.shape import TARGETS, LearnedShape
from accelstudy.sensors.frames import FRD
from accelstudy.sensors.models import MODELS, composition_name


def diagnosis_document(
    diagnosis: CampaignDiagnosis, calibration: Mapping[str, Any]
) -> dict[str, Any]:
    """Describe a diagnosis and its calibration; in SI but for keys that name another unit."""
    d, screening = diagnosis, diagnosis.detection
    test = d.global_test
    content = {
        "campaign": d.campaign.name,
        "approach": d.approach.name,
        "model": d.model.name,
        "axes": FRD.name,
        "verdict": d.verdict,
        "reason": "; ".join(clauses(d.reason)),
        "fits": d.fits,
        "global_test": {
            "statistic": d.base.omega if test is None else test.statistic,
            "dof": d.base.redundancy,
            "p_value": None if test is None else test.p_value,
            "sigma": "known" if d.sigma_known else "unknown",
        },
        "noise": {
            "sigma_mps2": d.sigma_position,
            "sigma_source": "a-priori" if d.noise.trusted else "residuals",
            "tests": d.noise_tests,
        },
        "screening": {
            "p_value": screening.p_value,
            "simulations": d.problem.chance.simulations,
            "candidates": [*screening.densities],
        },
        "posterior": d.probabilities,
        "credible_set": d.credible_set,
        "certain": [_certain(part, d) for part in d.certain],
        "effects": d.effects,
        "suspects": [{"position": label, "p_value": p} for label, p in d.suspects.items()],
        "shape": None if d.shape is None else shape_document(d.shape),
        "like": d.like,
        "gap": _gap(d),
        "invisible_effects": d.invisible,
        "untestable_effects": d.frame.tested.untestable,
        "upper_limits": d.upper_limits,
        "next_positions": [
            {
                "roll_gon": one.roll / GON,
                "pitch_gon": one.pitch / GON,
                **({} if one.temperature is None else {"temperature_degC": one.temperature}),
                **({} if one.later is None else {"later_s": one.later}),
                "separates": [name for names in one.separates for name in names],
            }
            for one in d.next_positions
        ],
        "redundancy": d.frame.residuals.redundancy,
        "n_positions": d.campaign.n_positions,
        "warnings": d.campaign.warnings,
        "rules": asdict(RULES),
        "calibration": calibration,
    }
    return DiagnosisDocument.content(content)


def shape_document(shape: LearnedShape) -> dict[str, Any]:
    """Describe a learned function, SI."""
    names = shape.components
    return {
        "coordinate": shape.coordinate,
        "target": shape.target,
        "axes": shape.axes,
        "subject": shape.subject,
        "function": {
            "unit": TARGETS[shape.effect.target].unit,
            "coordinate": shape.grid.tolist(),
            "value": dict(zip(names, shape.values.T.tolist(), strict=True)),
            "sigma": dict(zip(names, shape.sigmas.T.tolist(), strict=True)),
        },
    }


def _certain(part: Part, d: CampaignDiagnosis) -> dict[str, Any]:
    """Describe what is certain, with what stands for it in the extended model, if anything does."""
    names = [name.name for name in part.names]
    added = next((one for one in d.found if one.name in names and one.parameters), None)
    return {
        "family": part.family,
        "names": names,
        "posterior": part.posterior,
        "purity": part.purity,
        "spec": None if added is None else added.spec,
        "parameters": () if added is None else added.parameters,
    }


def _gap(d: CampaignDiagnosis) -> dict[str, Any]:
    gap, held, tilt = d.gap, d.gap.held_out, d.leveling
    return {
        "sigma0_squared": {"before": gap.before, "after": gap.after},
        "held_out_mse": held or dict.fromkeys(("before", "after", "floor")),
        "held_out_z": held and held.z,
        "held_out_positions": d.campaign.positions[list(held.held) if held else []].tolist(),
        "leveling_rms_mgon": dict.fromkeys(TiltErrors._fields)
        if tilt is None
        else {name: value / MGON for name, value in tilt._asdict().items()},
        "better_for_leveling": d.better_for_leveling,
        "confirmed": gap.confirmed,
        "confirmed_statement": gap.statement,
        "confirmed_names": gap.names,
        "reason": gap.reason,
    }


def diagnosed_fit(diagnosis: CampaignDiagnosis) -> CampaignFit:
    """Return the final fit of a diagnosis as a calibration.

    It is that of the extended model, without positions that were found to be bumped, of data in
    which a recognised gross error is mended, and with the noise that the diagnosis takes.
    """
    d = diagnosis
    bumped = d.campaign.positions[~d.used_positions].tolist()
    campaign = d.campaign.without(dict.fromkeys(bumped, "bumped, as the diagnosis found"))
    return CampaignFit(
        campaign=campaign,
        solution=d.final.solution,
        estimability=campaign_estimability(campaign, d.extended_model, d.approach),
        judgement=d.noise,
    )


def diagnosed_calibration(diagnosis: CampaignDiagnosis) -> dict[str, Any]:
    """Describe the final fit of a diagnosis, as `calibrate` describes its own.

    What was mended stands in `mended`; its matrix turns forces as they are read into those that
    were fitted.

    Raises
    ------
    InputError
        If the fit cannot be assessed.
    """
    fit = diagnosed_fit(diagnosis)
    content = calibration_document(fit)
    if (recognised := diagnosis.recognised) is not None:
        matrix = recognised.matrix
        content["mended"] = {
            "error": recognised.name,
            "reason": recognised.reason,
            "matrix": None if matrix is None else matrix.tolist(),
        }
    return {**content, "warnings": [*fit.campaign.warnings, *warnings(diagnosis)]}


def positions_table(diagnosis: CampaignDiagnosis) -> pd.DataFrame:
    """One row per position, in SI unless the name of a column says otherwise.

    Columns
    -------
    position, time_s, roll_gon, pitch_gon, temperature_degC : what was measured; NaN if it was not
    split : "fit", "held-out", or "left out" of the final fit as bumped
    residual_*_before_mps2, residual_*_after_mps2 : what the readings lack of the conditions, by the
        base fit and by the final one: the output less that in the robot's attitude, or the norm
        of f_b less gravity
    """
    d, campaign, held = diagnosis, diagnosis.campaign, diagnosis.gap.held_out
    n, used = campaign.n_positions, np.flatnonzero(diagnosis.used_positions)
    split = np.where(d.used_positions, "fit", "left out").astype(object)
    if held is not None:
        split[list(held.held)] = "held-out"
    table = pd.DataFrame(
        {
            "position": campaign.positions,
            "time_s": np.nan if campaign.time is None else campaign.time,
            "roll_gon": d.frame.angles[:, 0] / GON,
            "pitch_gon": d.frame.angles[:, 1] / GON,
            "temperature_degC": np.nan if campaign.temperature is None else campaign.temperature,
            "split": split,
        }
    )
    fits = (("before", d.base, np.arange(n)), ("after", d.final.solution, used))
    for when, fitted, rows in fits:
        names = ("norm",) if fitted.misclosures.shape[1] == 1 else ("x", "y", "z")
        for name, values in zip(names, fitted.misclosures.T, strict=True):
            table[f"residual_{name}_{when}_mps2"] = pd.Series(values, rows)
    return table


def condition_sigma(solution: Solution, variance: float) -> float:
    """Noise of a residual, m/s²: rms over positions and conditions, without that of parameters."""
    covariance = solution.whitening @ np.swapaxes(solution.whitening, 1, 2)
    return float(np.sqrt(variance * np.mean(np.einsum("ncc->nc", covariance))))


def model_file(diagnosis: CampaignDiagnosis) -> dict[str, Any]:
    """Return the content of model.yaml: the extended model, for wherever a model is asked for."""
    base, extended = diagnosis.model, diagnosis.extended_model
    added = extended.effect_names[len(base.effects) :]
    name = "-".join([re.sub(r"[^A-Za-z0-9_-]+", "-", composition_name(base.effects)), *added])
    if name in MODELS or len(name) > MAX_NAME_BYTES:
        name = "extended"
    return {**plugins.file_key(), "models": {name: [effect.spec for effect in extended.effects]}}
