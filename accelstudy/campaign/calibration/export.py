"""Export of a calibration in forms that devices and other programs can read."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

from accelstudy.basics.errors import InputError, UnknownNameError
from accelstudy.basics.wording import comma_list
from accelstudy.campaign.calibration.applying import SensorCalibration, affine_form
from accelstudy.campaign.calibration.c_code import c_header
from accelstudy.campaign.calibration.parameter_files import PX4
from accelstudy.effects import Effect
from accelstudy.effects.base import formulas
from accelstudy.sensors.models import compose
from accelstudy.sensors.sensor import not_affine

Array = NDArray[np.float64]

FORMS = ("json", "yaml", "c", "matrix", "px4")
RETIRED = {
    "ros": "`--form matrix` has the numbers of imu_calib, if the model is linear in the force: SM "
    "is its first three columns, bias minus its last"
}
"""Forms of earlier versions, with what to do instead."""

STEPS = (
    "f_s = mending · to_frd · ((raw − offset) · scale), m/s²",
    "f_a from f_s = f_a + Σ output, where output is that at f_a = (f_x, f_y, f_z) or, of an effect "
    "that acts last, at f_a + Σ output of all others: repeat f_a ← f_s − Σ output, from f_a = f_s "
    "on, until it settles",
    "f_b = (I + Σ axes) · f_a",
    "result = to_frdᵀ · f_b, m/s², in the axes of the readings",
)
"""Steps that calibrate a reading; sums are over the effects of the sensor."""
SYMBOLS = {
    "f_x": "m/s², f_a along x; likewise f_y, f_z",
    "g": "m/s², gravity_mps2",
    "temperature": "°C",
    "temperature_lagged": "°C, T with tau dT/dt = temperature − T, tau in s of the spec; at first "
    "T = temperature",
    "time": "s since the start of the session",
    "order": "s since the start of the session or, without times, the number of the position",
    "vibration": "m/s², rms while the sensor stands still",
    "step_x": "m/s², f_a along x less that of the position before; likewise step_y, step_z",
    "roll": "rad, attitude of the rig; likewise pitch, yaw",
}


def device_matrix(calibration: SensorCalibration) -> Array:
    """M (3, 4) with f = M · (raw, 1), from raw readings to m/s², both in the axes of the log.

    Raises
    ------
    InputError
        If the model has effects that no matrix can hold.
    """
    model, frame = calibration.model, calibration.usual_layout.axes
    if unfit := not_affine(model):
        raise InputError(
            f"no matrix can hold {comma_list(list(unfit))} of the model {model.name!r}; "
            "the forms json and yaml carry all effects, and c all that a device can know"
        )
    affine = affine_form(model, calibration.parameters)
    if affine is None:
        raise InputError(f"the model {model.name!r} with these parameters has no inverse")
    (k, bias), raw = affine, calibration.conversion
    linear = frame.matrix.T @ k @ calibration.mending @ frame.matrix * raw.scale
    return np.column_stack([linear, -linear @ raw.offset - frame.matrix.T @ k @ bias])


def export(calibration: SensorCalibration, form: str) -> str:
    """Text of a calibration in one of `FORMS`.

    Parameters
    ----------
    calibration : SensorCalibration
    form : one of `FORMS`

    Raises
    ------
    UnknownNameError, InputError
        If there is no such form, or it cannot hold the calibration.

    Notes
    -----
    "json" and "yaml" hold everything: parameters with sigmas, formulas of the effects and, if there
    is one, the matrix. "c" is a header in C99. "matrix" has plain 3 × 4 numbers. "px4" is a
    file of parameters, in which `losses` of the calibration are missing.
    """
    if form in RETIRED:
        raise InputError(f"form {form}: no longer a form; {RETIRED[form]}")
    if form == "matrix":
        rows = device_matrix(calibration)
        return "".join(" ".join(f"{value: .12e}" for value in row) + "\n" for row in rows)
    if form == "c":
        return c_header(calibration)
    if form == "px4":
        return PX4(calibration).text
    if form == "json":
        return json.dumps(_whole(calibration), indent=2, ensure_ascii=False) + "\n"
    if form == "yaml":
        return yaml.safe_dump(_whole(calibration), sort_keys=False, allow_unicode=True)
    raise UnknownNameError("form", form, FORMS)


def losses(calibration: SensorCalibration, form: str) -> tuple[str, ...]:
    """What a form cannot hold of a calibration, a sentence each."""
    return PX4(calibration).lost if form == "px4" else ()


def _whole(calibration: SensorCalibration) -> dict[str, Any]:
    """Everything that is needed to implement a calibration elsewhere, the rig included."""
    content, raw = calibration.content, calibration.conversion
    layout = calibration.usual_layout
    values = iter(content["parameters"])
    effects = [
        _effect(effect, [next(values) for _ in effect.parameters])
        for effect in compose(content["model"], tuple(content["effects"])).effects
    ]
    used = " ".join(json.dumps(effect) for effect in effects)
    affine = affine_form(calibration.model, calibration.parameters)
    return {
        "campaign": content["campaign"],
        "model": content["model"],
        "unit": layout.unit,
        "gravity_mps2": calibration.gravity,
        "readings": {
            "frame": layout.axes.name,
            "scale": raw.scale.tolist(),
            "offset": raw.offset.tolist(),
            "to_frd": layout.axes.matrix.tolist(),
            "mending": calibration.mending.tolist(),
        },
        "steps": list(STEPS),
        "symbols": {name: text for name, text in SYMBOLS.items() if name in used or name == "g"},
        "effects": effects,
        "ranges": calibration.ranges,
        "parameters": content["parameters"],
        "matrix_3x4": None if affine is None else device_matrix(calibration).tolist(),
    }


def _effect(effect: Effect, parameters: list[Any]) -> dict[str, Any]:
    """Formulas of an effect, and its parameters in SI."""
    notes = ["acts last: on f_a + Σ output of all other effects"] if effect.last else []
    if effect.part == "rig":
        notes.append("belongs to the rig: do not apply it to readings away from the rig")
    if effect.drifts:
        notes.append("known within the session only: limit time to ranges.time_s")
    return {
        "spec": effect.spec,
        "part": effect.part,
        **({"note": "; ".join(notes)} if notes else {}),
        **formulas(effect),
        "parameters": [
            {key: p[key] for key in ("name", "value", "sigma", "unit")} for p in parameters
        ],
    }
