"""The result of a calibration for programs: `calibration.json` and `positions.parquet`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd

from accelstudy.basics.levels import MAX_TILT_GON
from accelstudy.basics.units import MGON, recorded_unit, to_recorded
from accelstudy.campaign.calibration.campaign_fit import CampaignFit
from accelstudy.campaign.calibration.file_format import CalibrationDocument
from accelstudy.campaign.calibration.fit import campaign_estimability
from accelstudy.campaign.calibration.sensor_calibration import ranged_values
from accelstudy.campaign.calibration.wording import sentences
from accelstudy.campaign.gross_errors.recognition import Recognition
from accelstudy.sensors.frames import FRD


def calibration_document(
    fit: CampaignFit, mended: Recognition | None = None, warnings: Sequence[str] = ()
) -> dict[str, Any]:
    """Describe a calibration: parameters with sigmas, correlation, accuracy, matrix and quality.

    All numbers are in SI but those whose key names another unit, and in forward, right, down.

    Parameters
    ----------
    fit : CampaignFit
    mended : Recognition, optional, gross errors that the campaign had before the fit
    warnings : of a diagnosis, beside those of the campaign
    """
    campaign, header, solution = fit.campaign, fit.campaign.header, fit.solution
    covariance, sigma = fit.covariance, fit.sigma
    sigma_priori = np.sqrt(np.diag(solution.cofactors))
    sigma_posteriori = np.sqrt(np.diag(solution.covariance(fit.judge_noise(False))))
    affine = fit.model.affine(fit.parameters)
    content = {
        "campaign": campaign.name,
        "sensor": header.sensor,
        "date": header.date,
        "model": fit.model.name,
        "effects": [effect.spec for effect in fit.model.effects],
        "approach": fit.approach.name,
        "reference": None if fit.by_reference is None else header.reference,
        "type": campaign.sensor_type,
        "axes": FRD.name,
        "unit": header.unit,
        "nominal": header.nominal,
        "gravity_mps2": fit.gravity,
        "n_positions": campaign.n_positions,
        "sigma_source": "a priori" if fit.noise.trusted else "a posteriori",
        "sigma_dof": fit.dof,
        "sigmas_95": fit.sigmas_95,
        "sigma_position_mps2": fit.sigma_position,
        "sigma_position_priori_mps2": campaign.sigma_force,
        "sigma_position_posteriori_mps2": fit.sigma_position_posteriori,
        # of a single reading, from the samples within the holds
        "sigma_reading_mps2": None if campaign.sd is None else np.sqrt(np.mean(campaign.sd**2)),
        "parameters": [
            {
                "name": parameter.name,
                "value": fit.parameters[i],
                "sigma": sigma[i],
                "ci95": fit.sigmas_95 * sigma[i],
                "sigma_priori": sigma_priori[i] if campaign.sigma_force else None,
                "sigma_posteriori": sigma_posteriori[i],
                "unit": parameter.unit,
                "shown": {
                    "value": float(to_recorded(fit.parameters[i], parameter.unit)),
                    "sigma": to_recorded(sigma[i], parameter.unit),
                    "unit": recorded_unit(parameter.unit),
                },
            }
            for i, parameter in enumerate(fit.model.parameters)
        ],
        "covariance": covariance,
        "correlation": covariance / np.outer(sigma, sigma),
        "condition": campaign_estimability(campaign, fit.model, fit.approach).condition,
        "redundancy": solution.redundancy,
        "variance_of_unit_weight": solution.variance_posteriori,
        "iterations": solution.iterations,
        "rms_norm_residual_mps2": np.sqrt(np.mean(fit.norm_residuals**2)),
        "affine": affine and dict(zip(("matrix", "bias_mps2"), affine, strict=True)),
        "mended": mended
        and {"error": mended.name, "reason": mended.reason, "matrix": mended.matrix},
        "excluded": campaign.exclusions,
        "range_mps2": header.range_mps2,
        # Forces that the calibration cannot correct, as of exchanged axes, have no range.
        "ranges": {
            key: [values.min(), values.max()]
            for key, values in ranged_values(fit.corrected, campaign.hold).items()
            if np.isfinite(values).all()
        },
        "log": header.log and header.log.model_dump(exclude_none=True, by_alias=True),
        "warnings": [*campaign.warnings, *warnings],
        "quality": _quality(fit),
    }
    return CalibrationDocument.content(content)


def _quality(fit: CampaignFit) -> dict[str, Any]:
    """How good a calibration is."""
    held, components, tilt = fit.held_out, fit.components, fit.tilt
    angles = None if held is None else held.rms_angles
    parts = {"": tilt.total, "parameters_": tilt.parameters, "reference_": tilt.reference}
    return {
        "state": fit.state,
        "plausible": not fit.warnings,
        "warnings": fit.warnings,
        "gross_error": fit.gross_error,
        "verdict": " ".join(sentences(fit)),
        "global_test": fit.global_test,
        "suspects": [{"position": n, "p_value": p} for n, p in fit.suspects.items()],
        "held_out": None
        if held is None or held.n_predicted == 0
        else {
            "n_predicted": held.n_predicted,
            "rms_mps2": held.rms,
            "rms_roll_mgon": None if angles is None else angles[0] / MGON,
            "rms_pitch_mgon": None if angles is None else angles[1] / MGON,
        },
        "variance_components": None
        if components is None
        else {
            "accelerometer": components.factors[0],
            "robot": components.factors[1],
            "sigma": components.sigma,
            "converged": components.converged,
        },
        "tilt_rms_mgon": {
            **{
                f"{part}{angle}": None if left is None else left[i] / MGON
                for part, left in parts.items()
                for i, angle in enumerate(("roll", "pitch"))
            },
            "max_tilt_gon": MAX_TILT_GON,
        },
    }


def assessed_positions(fit: CampaignFit) -> pd.DataFrame:
    """One row per position: residuals, tests and reliability, in the units that the names say."""
    tests, reliability = fit.tests, fit.reliability
    scale = np.sqrt(fit.noise.variance)  # reliability is in terms of the a-priori noise
    table = pd.DataFrame(
        {
            "position": fit.campaign.positions,
            "norm_residual_mps2": fit.norm_residuals,
            "redundancy": fit.solution.redundancy_numbers,
            "statistic": tests.statistic,
            "dof": tests.dof,
            "p_value": tests.p_known if fit.noise.trusted else tests.p_unknown,
            "p_value_adjusted": fit.p_adjusted,
            "tau": tests.tau,
            "mdb_mps2": scale * reliability.mdb[:, -1],
            "external_roll_mgon": scale * reliability.leveling[:, 0] / MGON,
            "external_pitch_mgon": scale * reliability.leveling[:, 1] / MGON,
        }
    )
    residuals = fit.solution.residuals
    for i, name in enumerate(("fx", "fy", "fz")):
        table[f"v_{name}_mps2"] = residuals[:, i]
    if fit.approach.uses_angles:
        for i, name in enumerate(("roll", "pitch")):
            table[f"v_{name}_mgon"] = residuals[:, 3 + i] / MGON
    if fit.held_out is not None:
        table["held_out_mps2"] = np.linalg.norm(fit.held_out.misclosures, axis=1)
    table["suspect"] = table["position"].isin([*fit.suspects])
    return table
