"""The machine-readable diagnosis: the content of `diagnosis.json`."""

from __future__ import annotations

from typing import Any

from accelstudy.basics.units import GON, MGON
from accelstudy.campaign.calibration.document import json_number
from accelstudy.diagnosis.report.words.missing import refuted
from accelstudy.diagnosis.report.words.statement import cosine_in, statement
from accelstudy.diagnosis.result import Diagnosis, Named
from accelstudy.sensors.frames import FRD


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
        "certain": _certain(d),
        "effects": [_effect(named) for named in d.found],
        "suspects": [{"position": label, "p_value": json_number(p)} for label, p in d.suspects],
        "location": {name: json_number(share) for name, share in d.location.items()},
        "location_by_chance": {n: json_number(p) for n, p in d.beside.location.by_chance.items()},
        "location_untestable": dict(d.not_located),
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
        "invisible_effects": list(d.examined.invisible),
        "untestable_effects": list(d.examined.untestable),
        "untestable_reasons": dict(d.examined.untestable),
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
                **({} if position.later is None else {"later_s": json_number(position.later)}),
                "any_attitude": position.anywhere,
                "separates": [name for names in position.separates for name in names],
            }
            for position in d.next_positions
        ],
        "redundancy": d.examined.frame.residuals.redundancy,
        "n_positions": d.campaign.n_positions,
        "warnings": list(d.campaign.warnings),
    }


def _certain(d: Diagnosis) -> list[dict[str, Any]]:
    if d.verdict == "unknown" and refuted(d.credible_set):
        return []
    return [
        {
            "family": part.family,
            "names": [name.name for name in part.names],
            "posterior": json_number(part.posterior),
            "purity": json_number(part.purity),
        }
        for part in statement(d.credible_set, cosine=cosine_in(d.examined)).certain
    ]


def _effect(named: Named) -> dict[str, Any]:
    return {
        "name": named.name,
        "spec": named.spec,
        **({} if named.position is None else {"position": named.position}),
        "equivalence_class": list(named.equivalence_class),
        "p_value": json_number(named.p_value),
        "posterior": json_number(named.posterior),
        "parameters": [
            {"name": name, "value": json_number(value), "sigma": json_number(sigma), "unit": unit}
            for name, value, sigma, unit in named.parameters
        ],
        "imitators": list(named.imitators),
        "rivals": [{"name": name, "cosine": json_number(cosine)} for name, cosine in named.rivals],
    }


def _gap(d: Diagnosis) -> dict[str, Any]:
    gap, held = d.gap, d.gap.held_out
    roll_pitch = None if d.leveling is None else [value / MGON for value in d.leveling]
    return {
        "sigma0_squared": {"before": json_number(gap.before), "after": json_number(gap.after)},
        "held_out_mse": {
            "before": None if held is None else json_number(held.before),
            "after": None if held is None else json_number(held.after),
            "floor": None if held is None else json_number(held.floor),
            "reduction_ci95": (
                None if held is None else [json_number(value) for value in held.reduction_ci95]
            ),
        },
        "held_out_z": None if held is None else json_number(held.z),
        "held_out_z_needed": None if held is None else json_number(held.needed),
        "held_out_positions": []
        if held is None
        else [int(d.campaign.positions[i]) for i in held.held],
        "leveling_rms_mgon": {
            "before": None if roll_pitch is None else json_number(roll_pitch[0]),
            "after": None if roll_pitch is None else json_number(roll_pitch[1]),
        },
        "better_for_leveling": d.better_for_leveling,
        "confirmed": gap.confirmed,
        "confirmed_statement": gap.statement,
        "confirmed_names": list(gap.names),
        "reason": gap.reason,
    }
