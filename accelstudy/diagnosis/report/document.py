"""The files for programs: diagnosis.json, calibration.json, model.yaml and positions.parquet."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import asdict, replace
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from accelstudy.adjustment import calibrate
from accelstudy.adjustment.quality import Solution, position_tests
from accelstudy.basics import plugins
from accelstudy.basics.names import LONGEST
from accelstudy.basics.units import GON, MGON
from accelstudy.basics.wording import amount, comma_list, words
from accelstudy.campaign.calibration.assessment import assess
from accelstudy.campaign.calibration.document import (
    calibration_document,
    json_number,
    quality_document,
)
from accelstudy.campaign.calibration.fit import CampaignFit, JudgedNoise, campaign_estimability
from accelstudy.campaign.session import Campaign
from accelstudy.diagnosis.decision.statement import Part
from accelstudy.diagnosis.decision.verdict import Named
from accelstudy.diagnosis.forms import TARGETS
from accelstudy.diagnosis.report.words import beyond, explanation_words, keep_base, missing
from accelstudy.diagnosis.result import Diagnosis
from accelstudy.diagnosis.shape import LearnedShape
from accelstudy.sensors.frames import FRD
from accelstudy.sensors.models import MODELS, composition_name
from accelstudy.sensors.sensor import SensorModel

Array = NDArray[np.float64]


def diagnosis_document(diagnosis: Diagnosis) -> dict[str, Any]:
    """Describe a diagnosis; numbers are in SI unless their key names another unit."""
    d = diagnosis
    test = d.global_test
    return {
        "schema_version": 1,
        "campaign": d.campaign.name,
        "approach": d.approach.name,
        "model": d.model.name,
        "axes": FRD.name,
        "verdict": d.verdict,
        "reason": d.reason,
        "global_test": {
            "statistic": json_number(d.base.omega if test is None else test.statistic),
            "dof": d.base.redundancy,
            "p_value": None if test is None else json_number(test.p_value),
            "sigma": "known" if d.sigma_known else "unknown",
        },
        "noise": {
            "sigma_mps2": json_number(d.sigma_position),
            "sigma_source": "a-priori" if d.sigma_holds else "residuals",
            "tests": [
                {
                    "name": test.name,
                    "statistic": json_number(test.statistic),
                    "p_value": json_number(test.p_value),
                    "remark": test.remark,
                }
                for test in d.noise_tests
            ],
        },
        "screening": {
            "p_value": json_number(d.screening.p_value),
            "simulations": d.simulations,
            "candidates": [
                {
                    "name": name,
                    "p_single": json_number(d.screening.p_candidate[name]),
                    "p_family": json_number(d.screening.p_family[name]),
                }
                for name in sorted(d.screening.p_family, key=lambda n: d.screening.p_family[n])
            ],
        },
        "posterior": {name: json_number(p) for name, p in d.probabilities.items()},
        "credible_set": [
            {
                "names": list(one.names),
                "classes": [list(names) for names in one.classes],
                "posterior": json_number(one.posterior),
            }
            for one in d.credible_set
        ],
        "certain": [_certain(part, d.found) for part in d.certain],
        "effects": [effect_document(named) for named in d.effects],
        "suspects": [{"position": label, "p_value": json_number(p)} for label, p in d.suspects],
        "shape": None if d.shape is None else shape_document(d.shape),
        "like": [asdict(place) for place in d.like],
        "gap": _gap(d),
        "parameter_changes": [
            {
                "parameter": change.parameter,
                "unit": change.unit,
                "before": json_number(change.before),
                "after": json_number(change.after),
                "predicted": json_number(change.predicted),
                "estimated": json_number(change.estimated),
                "sigma": json_number(change.sigma),
            }
            for change in d.changes
        ],
        "invisible_effects": list(d.invisible),
        "untestable_effects": list(d.untestable),
        "untestable_reasons": dict(d.untestable),
        "upper_limits": [
            {
                "name": limit.name,
                "parameter": limit.parameter,
                "value": json_number(limit.value),
                "unit": limit.unit,
            }
            for limit in d.upper_limits
        ],
        "next_positions": [
            {
                "roll_gon": position.roll / GON,
                "pitch_gon": position.pitch / GON,
                **(
                    {}
                    if position.temperature is None
                    else {"temperature_degC": position.temperature}
                ),
                **({} if position.yaw is None else {"yaw_gon": position.yaw / GON}),
                **({} if position.later is None else {"later_s": json_number(position.later)}),
                "any_attitude": position.anywhere,
                "separates": [name for names in position.separates for name in names],
            }
            for position in d.next_positions
        ],
        "redundancy": d.frame.residuals.redundancy,
        "n_positions": d.campaign.n_positions,
        "warnings": list(d.campaign.warnings),
    }


def shape_document(shape: LearnedShape) -> dict[str, Any]:
    """Describe a learned function, SI."""
    ranking = shape.ranking
    each = list(zip(shape.components, shape.values.T, shape.sigmas.T, strict=True))
    return {
        "coordinate": shape.coordinate,
        "target": shape.target,
        "axes": list(ranking.axes),
        "subject": ranking.subject,
        "function": {
            "unit": TARGETS[shape.effect.target].unit,
            "coordinate": shape.grid.tolist(),
            "value": {name: h.tolist() for name, h, _ in each},
            "sigma": {name: sigma.tolist() for name, _, sigma in each},
        },
        "formulas": [
            {"text": f"{ranking.subject}: {one.text}", "posterior": json_number(one.posterior)}
            for one in ranking.formulas
        ],
        "least_known": list(shape.least_known),
    }


def _certain(part: Part, found: Sequence[Named]) -> dict[str, Any]:
    """Describe what is certain, with what stands for it in the extended model, if anything does."""
    names = [name.name for name in part.names]
    added = next((one for one in found if one.name in names and one.parameters), None)
    return {
        "family": part.family,
        "names": names,
        "posterior": json_number(part.posterior),
        "purity": json_number(part.purity),
        "spec": None if added is None else added.spec,
        "parameters": [] if added is None else _estimates(added.parameters),
    }


def effect_document(named: Named) -> dict[str, Any]:
    """Describe an effect, a noise effect or a gross error that was found."""
    return {
        "name": named.name,
        "spec": named.spec,
        **({} if named.position is None else {"position": named.position}),
        "equivalence_class": list(named.equivalence_class),
        "p_value": json_number(named.p_value),
        "posterior": json_number(named.posterior),
        "parameters": _estimates(named.parameters),
        **({"settings": _estimates(named.settings)} if named.settings else {}),
        "imitators": list(named.imitators),
        "rivals": [{"name": name, "cosine": json_number(cosine)} for name, cosine in named.rivals],
    }


def _estimates(
    estimates: Iterable[tuple[str, float, float | None, str]],
) -> list[dict[str, Any]]:
    return [
        {"name": name, "value": json_number(value), "sigma": json_number(sigma), "unit": unit}
        for name, value, sigma, unit in estimates
    ]


def _gap(d: Diagnosis) -> dict[str, Any]:
    gap, held = d.gap, d.gap.held_out
    tilt = (None, None) if d.leveling is None else [value / MGON for value in d.leveling]

    def of_held_out(name: str) -> float | None:
        return None if held is None else json_number(getattr(held, name))

    return {
        "sigma0_squared": {"before": json_number(gap.before), "after": json_number(gap.after)},
        "held_out_mse": {
            **{name: of_held_out(name) for name in ("before", "after", "floor")},
            "reduction_ci95": (
                None if held is None else [json_number(value) for value in held.reduction_ci95]
            ),
        },
        "held_out_z": of_held_out("z"),
        "held_out_z_needed": of_held_out("needed"),
        "held_out_positions": []
        if held is None
        else [int(d.campaign.positions[i]) for i in held.held],
        "leveling_rms_mgon": {"before": json_number(tilt[0]), "after": json_number(tilt[1])},
        "better_for_leveling": d.better_for_leveling,
        "confirmed": gap.confirmed,
        "confirmed_statement": gap.statement,
        "confirmed_names": list(gap.names),
        "reason": gap.reason,
    }


def diagnosed_fit(diagnosis: Diagnosis) -> CampaignFit:
    """Return the final fit of a diagnosis as a calibration.

    It is that of the extended model, without positions that were found to be bumped, of data in
    which a recognised gross error is mended, and with the noise that the diagnosis takes.
    """
    d = diagnosis
    bumped = d.campaign.positions[~d.kept].tolist()
    campaign = d.campaign.without(dict.fromkeys(bumped, "bumped, as the diagnosis found"))
    solution = d.final.solution
    start = solution.parameters[: d.extended.n_parameters]
    observed = replace(solution.observed, initial=start)
    return CampaignFit(
        campaign=campaign,
        model=d.extended,
        approach=d.approach,
        observed=observed,
        # Its cofactors do not know of the settings that were searched for.
        adjustment=replace(
            calibrate(d.extended, d.approach, observed), cofactors=solution.cofactors[None]
        ),
        estimability=campaign_estimability(campaign, d.extended, d.approach),
        judged=JudgedNoise(d.sigma_holds, d.unit_variance),
    )


def diagnosed_calibration(diagnosis: Diagnosis) -> dict[str, Any]:
    """Describe the final fit of a diagnosis, as `calibrate` describes its own.

    What was mended stands in `mended`; its matrix turns forces as they are read into those that
    were fitted.

    Raises
    ------
    InputError
        If the fit cannot be assessed.
    """
    fit = diagnosed_fit(diagnosis)
    # The diagnosis has looked at these data, unless it changed them or left out their angles.
    unchanged = diagnosis.recognised is None and bool(diagnosis.kept.all())
    as_recognised = unchanged and (fit.approach.uses_angles or fit.campaign.angles is None)
    content = {
        **calibration_document(fit),
        "quality": quality_document(assess(fit, without_gross_error=as_recognised)),
    }
    warnings = list(fit.campaign.warnings)
    if diagnosis.verdict == "narrowed":
        warnings.append(
            f"What is missing is {missing(diagnosis.credible_set)}. The calibration "
            f"takes {explanation_words(diagnosis.credible_set[0])}, and its sigmas do not know of "
            "the others."
        )
    if diagnosis.verdict == "unknown" and diagnosis.found:
        added = comma_list([words(one.name) for one in diagnosis.found])
        warnings.append(
            f"The calibration takes {added}, which is certain. Its sigmas do not know of what is "
            "missing besides."
        )
    if reach := beyond(diagnosis):
        warnings.append(f"The function was learned from {reach}, and keeps its value beyond.")
    warnings += keep_base(diagnosis)
    weights = np.asarray(fit.observed.sigma_force)
    if weights.ndim:
        sigmas = np.sqrt(fit.variance_factor) * weights[0]
        content["sigma_position_axes_mps2"] = sigmas.tolist()
        x, y, z = (amount(sigma, "m/s^2") for sigma in sigmas)
        warnings.append(
            f"The axes are weighted by their noise, {x}, {y} and {z} mm/s² in x, y and z; "
            "`accelstudy calibrate` takes them as equal, and differs by that."
        )
    if (recognised := diagnosis.recognised) is not None:
        warning = f"The calibration is of mended data: {recognised.reason}."
        if recognised.matrix is not None:
            warning += " Readings need the same mending; `accelstudy apply` and `export` do it."
        warnings.append(warning)
        content["mended"] = {
            "error": recognised.name,
            "reason": recognised.reason,
            "matrix": None if recognised.matrix is None else recognised.matrix.tolist(),
        }
    return {**content, "warnings": warnings}


def positions_table(diagnosis: Diagnosis) -> pd.DataFrame:
    """One row per position, in SI unless the name of a column says otherwise.

    Columns
    -------
    position, time_s, roll_gon, pitch_gon, temperature_degC : what was measured; NaN if it was not
    split : "fit", "held-out", or "left out" of the final fit as bumped
    residual_*_before_mps2, residual_*_after_mps2 : what the readings lack of the conditions, by the
        base fit and by the final one: the output less that in the robot's attitude, or the norm
        of f_b less gravity
    test_before, test_after : root of the test statistic of a gross error in the position, over the
        noise level that the diagnosis takes; signed where the position has one condition
    p_before, p_after : p-values of these tests, of each position by itself
    predicted_before_mps2, predicted_after_mps2 : of held-out positions, rms of the residuals by
        the fits to the other positions, without and with the effects that were found
    """
    d = diagnosis
    campaign, solution = d.campaign, d.final.solution
    n = campaign.n_positions
    kept = d.kept
    held = np.zeros(n, dtype=bool)
    if d.gap.held_out is not None:
        held[list(d.gap.held_out.held)] = True

    def column(values: Array | None) -> Array:
        return np.full(n, np.nan) if values is None else values

    angles = d.frame.angles
    table = {
        "position": campaign.positions,
        "time_s": column(campaign.time),
        "roll_gon": angles[:, 0] / GON,
        "pitch_gon": angles[:, 1] / GON,
        "temperature_degC": column(campaign.temperature),
        "split": np.where(held, "held-out", np.where(kept, "fit", "left out")),
    }
    fits = (("before", d.base, np.ones(n, dtype=bool)), ("after", solution, kept))
    for when, fitted, rows in fits:
        names = ("norm",) if fitted.misclosures.shape[1] == 1 else ("x", "y", "z")
        for name, values in zip(names, fitted.misclosures.T, strict=True):
            table[f"residual_{name}_{when}_mps2"] = _placed(values, rows)
    for when, fitted, rows in fits:
        tests = position_tests(fitted)
        table[f"test_{when}"] = _placed(tests.w / np.sqrt(d.unit_variance), rows)
        table[f"p_{when}"] = _placed(tests.p_known if d.sigma_holds else tests.p_unknown, rows)
    missed = ((), ()) if d.gap.held_out is None else d.gap.held_out.misses
    for when, values in zip(("before", "after"), missed, strict=True):
        table[f"predicted_{when}_mps2"] = _placed(np.array(values), held)
    return pd.DataFrame(table)


def condition_sigma(solution: Solution, variance: float) -> float:
    """Noise of a residual, m/s²: rms over positions and conditions, without that of parameters."""
    covariance = solution.whitening @ np.swapaxes(solution.whitening, 1, 2)
    return float(np.sqrt(variance * np.mean(np.einsum("ncc->nc", covariance))))


def _placed(values: Array, rows: NDArray[np.bool_]) -> Array:
    placed = np.full(len(rows), np.nan)
    placed[rows] = values
    return placed


REPLICATES = 1000


def study_overlay(diagnosis: Diagnosis) -> dict[str, Any]:
    """Return a configuration that overlays `config/config.yaml`.

    The simulated sensor has the effects that were found, with the estimates as true values, and the
    noise that was found. It is calibrated with the base model and with the extended one, in as many
    evenly spread positions as the campaign has.
    """
    d = diagnosis
    solution = d.final.solution
    extended = d.extended
    effects = [effect.spec for effect in extended.effects]
    models = [composition_name(d.model.effects)]
    composed: dict[str, list[str]] = {}
    if extended is not d.model:
        # The one model of the file's own is the one that the file stands for.
        added = [e.name for e in extended.effects[len(d.model.effects) :]]
        name = "-".join([study_name(models[0]), *added])
        composed = {"extended" if name in MODELS or len(name) > LONGEST else name: list(effects)}
    noise: dict[str, Any] = {
        "sensor": {"sigma_mps2": d.sigma_position, "per": "position"},
        "gravity": {"sigma_mps2": d.campaign.sigma_gravity, "error_mps2": 0.0},
    }
    if d.campaign.sigma_angle is not None:
        noise["robot"] = {"sigma_mgon": d.campaign.sigma_angle / MGON}
    content = {
        **plugins.as_a_key(),
        "study": study_name(d.campaign.name),
        "gravity_mps2": solution.gravity,
        "noise": noise,
        "simulated_effects": effects,
        "sensor": _truth(extended, solution.parameters.tolist()),
        "models": composed,
        "grids": [
            {
                "models": [*models, *composed],
                "schemes": [f"fibonacci-{d.campaign.n_positions}"],
                "approaches": [d.approach.name],
                "replicates": REPLICATES,
            }
        ],
        "presets": None,
        "sensitivity": None,
        "paper": False,
    }
    holds = study_holds(d.campaign, extended)
    return {**content, "holds": holds} if holds else content


def study_holds(campaign: Campaign, model: SensorModel) -> dict[str, Any]:
    """Conditions of the holds on which the effects of a model depend, in the ranges of a campaign.

    A course of the temperature that correlates with the order of the holds is taken as linear, any
    other as random.
    """
    needed, holds = model.hold_columns, dict[str, Any]()
    if {"time", "order"} & {*needed} and campaign.time is not None:
        holds["interval_s"] = float(np.ptp(campaign.time) / (campaign.n_positions - 1))
    if "temperature" in needed and campaign.temperature is not None:
        t = campaign.temperature
        trend = np.corrcoef(np.arange(len(t)), t)[0, 1] if np.ptp(t) > 0 else 0.0
        low, high = float(t.min()), float(t.max())
        holds["temperature_degC"] = [high, low] if trend < -0.5 else [low, high]
        holds["temperature_order"] = "linear" if abs(trend) > 0.5 else "random"
    if "vibration" in needed and campaign.vibration is not None:
        holds["vibration_mps2"] = [float(campaign.vibration.min()), float(campaign.vibration.max())]
    if "yaw" in needed and campaign.yaw is not None:
        holds["yaw"] = "random" if np.ptp(campaign.yaw) > 0 else "none"
    return holds


def study_name(name: str) -> str:
    """Return the name of a campaign as the name of a study: letters, digits, _ and - only."""
    return re.sub(r"[^A-Za-z0-9_-]+", "-", name)[:LONGEST].strip("-_") or "campaign"


def _truth(model: SensorModel, parameters: list[float]) -> dict[str, dict[str, Any]]:
    """Estimates as true values, by effect, SI."""
    values = dict(zip(model.parameter_names, parameters, strict=False))  # gravity may follow
    return {
        effect.spec: {
            "value": [values[p.name] for p in effect.parameters],
            "unit": effect.parameters[0].unit,
        }
        for effect in model.effects
    }
