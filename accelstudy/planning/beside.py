"""A calibrated sensor as equipment: what a plan takes its errors for."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from accelstudy.adjustment import whitened_jacobian
from accelstudy.approaches import get_approach
from accelstudy.basics.errors import InputError
from accelstudy.basics.units import STANDARD_GRAVITY
from accelstudy.campaign.importing.beside import usable_reference
from accelstudy.campaign.reference import ReferenceSensor
from accelstudy.data_sheets import DataSheet
from accelstudy.planning.question import USUAL_HOLD, Equipment
from accelstudy.schemes import get_scheme
from accelstudy.sensors.models import get_model
from accelstudy.simulation.sessions import Noise, session

ALIKE = "alike"
SCHEME = "fibonacci-24"
"""Positions in which a reference of the same type is taken to be calibrated, by gravity alone."""
MODEL = "bias-scale-nonorthogonality"
SETUP = 300.0
"""s, to mount both sensors on one plate."""


def equipment_beside(text: str, sheet: DataSheet, moving: float) -> Equipment:
    """Positions by hand with a calibrated sensor beside the one that is calibrated.

    Parameters
    ----------
    text : path of the calibration.json of that sensor, or `ALIKE`: a sensor of the same type,
        calibrated by gravity alone in `SCHEME`
    sheet : DataSheet, of the sensor that is calibrated
    moving : float, s, from the end of a hold to the beginning of the next

    Raises
    ------
    InputError
        If the calibration tells no angles with their sigmas.
    """
    reference = _alike(sheet) if text == ALIKE else _of_calibration(Path(text))
    return Equipment("reference", moving, SETUP, reference)


def _of_calibration(path: Path) -> ReferenceSensor:
    calibration = usable_reference(path)
    sigma = calibration.content["sigma_position_mps2"]
    if not sigma:
        raise InputError(f"--reference {path}: it does not tell the noise of a position")
    return ReferenceSensor.of_calibration(calibration, sigma)


def _alike(sheet: DataSheet) -> ReferenceSensor:
    model, scheme = get_model(MODEL), get_scheme(SCHEME)
    noise = Noise(sheet.sigma_mean(USUAL_HOLD))
    ideal = np.zeros(model.n_parameters)
    observed = session(model, ideal, scheme.directions, STANDARD_GRAVITY).observations(noise)
    rows = whitened_jacobian(model, get_approach("gravity"), observed, ideal)
    return ReferenceSensor(
        calibration=ALIKE,
        frame="frd",
        sigma_mps2=noise.sigma_force,
        effects=[effect.spec for effect in model.effects],
        parameters=ideal.tolist(),
        covariance=np.linalg.inv(rows.T @ rows).tolist(),
    )
