"""The machine-readable result of a calibration: the content of `calibration.json`."""

from __future__ import annotations

from typing import Any

import numpy as np

from accelstudy.campaign.fit import CampaignFit
from accelstudy.campaign.gauges import GAUGES, affine_form, in_gauge
from accelstudy.units import recorded_unit, to_recorded


def calibration_document(fit: CampaignFit) -> dict[str, Any]:
    """Describe a fit: parameters with sigmas, correlation, accuracy, matrix and gauges.

    All numbers are in SI but those whose key names another unit.
    """
    campaign, adjustment = fit.campaign, fit.adjustment
    covariance, sigma = fit.covariance, fit.sigma
    correlation = covariance / np.outer(sigma, sigma)
    return {
        "schema_version": 1,
        "campaign": campaign.name,
        "sensor": campaign.sensor,
        "model": fit.model.name,
        "effects": [effect.spec for effect in fit.model.effects],
        "approach": fit.approach.name,
        "unit": campaign.unit,
        "nominal": _nominal(fit),
        "gravity_mps2": fit.gravity,
        "n_positions": campaign.n_positions,
        "sigma_source": "a priori" if fit.trusts_sigma else "a posteriori",
        "sigma_position_mps2": number(fit.sigma_position),
        "sigma_position_priori_mps2": number(campaign.sigma_force),
        "sigma_position_posteriori_mps2": number(fit.sigma_position_posteriori),
        "parameters": [
            {
                "name": parameter.name,
                "value": float(fit.parameters[i]),
                "sigma": number(sigma[i]),
                "sigma_priori": number(adjustment.sigma_priori[0, i] if fit.sigma_known else None),
                "sigma_posteriori": number(adjustment.sigma_posteriori[0, i]),
                "unit": parameter.unit,
                "shown": {
                    "value": float(to_recorded(fit.parameters[i], parameter.unit)),
                    "sigma": number(to_recorded(sigma[i], parameter.unit)),
                    "unit": recorded_unit(parameter.unit),
                },
            }
            for i, parameter in enumerate(fit.model.parameters)
        ],
        "covariance": _numbers(covariance),
        "correlation": _numbers(correlation),
        "condition": fit.design.condition,
        "redundancy": adjustment.redundancy,
        "variance_of_unit_weight": number(adjustment.variance_posteriori[0]),
        "iterations": int(adjustment.iterations[0]),
        "rms_norm_residual_mps2": fit.rms_norm_residual,
        "affine": _affine(fit),
        "excluded": campaign.exclusions,
        "log": None if campaign.log is None else campaign.log.model_dump(exclude_none=True),
        "warnings": list(campaign.warnings),
    }


def _nominal(fit: CampaignFit) -> dict[str, list[float]] | None:
    campaign = fit.campaign
    if campaign.nominal_scale is None or campaign.nominal_offset is None:
        return None
    return {"scale": campaign.nominal_scale.tolist(), "offset": campaign.nominal_offset.tolist()}


def _affine(fit: CampaignFit) -> dict[str, Any] | None:
    form = affine_form(fit.model, fit.parameters)
    if form is None:
        return None
    matrix, bias = form
    return {
        "matrix": matrix.tolist(),
        "bias_mps2": bias.tolist(),
        "gauges": {gauge: in_gauge(matrix, gauge).tolist() for gauge in GAUGES},
    }


def _numbers(matrix: np.ndarray) -> list[list[float | None]]:
    return [[number(value) for value in row] for row in matrix]


def number(value: Any) -> float | None:
    """Number for JSON, which knows no NaN."""
    return None if value is None or not np.isfinite(value) else float(value)
