"""Export of a calibration in forms that devices and other programs can read."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

from accelstudy.basics.errors import InputError, UnknownNameError
from accelstudy.basics.wording import comma_list
from accelstudy.campaign.calibration.applying import SensorCalibration, calibration_of
from accelstudy.campaign.calibration.c_code import c_header
from accelstudy.campaign.calibration.parameter_files import PX4
from accelstudy.effects import Effect
from accelstudy.effects.base import formulas
from accelstudy.sensors.conversion import Conversion, conversion_of
from accelstudy.sensors.frames import FRD, Frame, parse_frame
from accelstudy.sensors.models import compose
from accelstudy.sensors.sensor import SensorModel, not_affine

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


def device_matrix(calibration: Mapping[str, Any]) -> Array:
    """M (3, 4) with f = M · (raw, 1), from raw readings to m/s², both in the axes of the log.

    Parameters
    ----------
    calibration : mapping, content of calibration.json

    Raises
    ------
    InputError
        If the model has effects that no matrix can hold.
    """
    if unfit := not_affine(_model(calibration)):
        raise InputError(
            f"no matrix can hold {comma_list(list(unfit))} of the model {calibration['model']!r}; "
            "the forms json and yaml carry all effects, and c all that a device can know"
        )
    affine = calibration["affine"]
    if affine is None:
        raise InputError(f"the model {calibration['model']!r} with these parameters has no inverse")
    k, bias = np.array(affine["matrix"]), np.array(affine["bias_mps2"])
    raw, frame = _readings(calibration)
    linear = frame.matrix.T @ k @ mending(calibration) @ frame.matrix * raw.scale
    return np.column_stack([linear, -linear @ raw.offset - frame.matrix.T @ k @ bias])


def campaign_conversion(calibration: Mapping[str, Any]) -> Conversion:
    """Conversion to m/s² of readings in the unit of the campaign, in frd."""
    if calibration["unit"] != "counts":
        return conversion_of(calibration["unit"])
    scale, offset = (
        np.array(calibration["nominal"][key], dtype=float) for key in ("scale", "offset")
    )
    return Conversion(scale, offset)


def mending(calibration: Mapping[str, Any]) -> Array:
    """C (3, 3) that turns forces as they were read into those that were fitted, in frd.

    It differs from I if the data had a gross error that a diagnosis mended.
    """
    mended = calibration.get("mended") or {}
    return np.eye(3) if mended.get("matrix") is None else np.array(mended["matrix"], dtype=float)


def export(calibration: Mapping[str, Any], form: str) -> str:
    """Text of a calibration in one of `FORMS`.

    Parameters
    ----------
    calibration : mapping, content of calibration.json
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
        return c_header(*_of_device(calibration))
    if form == "px4":
        return PX4(*_of_device(calibration)).text
    if form == "json":
        return json.dumps(_whole(calibration), indent=2, ensure_ascii=False) + "\n"
    if form == "yaml":
        return yaml.safe_dump(_whole(calibration), sort_keys=False, allow_unicode=True)
    raise UnknownNameError("form", form, FORMS)


def losses(calibration: Mapping[str, Any], form: str) -> tuple[str, ...]:
    """What a form cannot hold of a calibration, a sentence each."""
    return PX4(*_of_device(calibration)).lost if form == "px4" else ()


def _of_device(
    calibration: Mapping[str, Any],
) -> tuple[SensorCalibration, Conversion, Frame, Array, str]:
    """A calibration without its rig, and the readings that a device has."""
    raw, frame = _readings(calibration)
    unit = _unit(calibration)
    return calibration_of(calibration), raw, frame, mending(calibration), unit


def _model(calibration: Mapping[str, Any]) -> SensorModel:
    return compose(calibration["model"], tuple(calibration["effects"]))


def _readings(calibration: Mapping[str, Any]) -> tuple[Conversion, Frame]:
    """Conversion of raw readings, and their axes: those of the log, if there was one."""
    log = calibration.get("log")
    if log is None:
        return campaign_conversion(calibration), FRD
    raw = conversion_of(log["unit"], log.get("scale"), log.get("offset"))
    return raw, parse_frame(log["frame"])


def _whole(calibration: Mapping[str, Any]) -> dict[str, Any]:
    """Everything that is needed to implement a calibration elsewhere."""
    model = _model(calibration)
    raw, frame = _readings(calibration)
    values = iter(calibration["parameters"])
    effects = [
        _effect(effect, [next(values) for _ in effect.parameters]) for effect in model.effects
    ]
    used = " ".join(json.dumps(effect) for effect in effects)
    matrix = None
    if not not_affine(model) and calibration["affine"] is not None:
        matrix = device_matrix(calibration).tolist()
    return {
        "campaign": calibration["campaign"],
        "model": calibration["model"],
        "unit": _unit(calibration),
        "gravity_mps2": calibration["gravity_mps2"],
        "readings": {
            "frame": frame.name,
            "scale": raw.scale.tolist(),
            "offset": raw.offset.tolist(),
            "to_frd": frame.matrix.tolist(),
            "mending": mending(calibration).tolist(),
        },
        "steps": list(STEPS),
        "symbols": {name: text for name, text in SYMBOLS.items() if name in used or name == "g"},
        "effects": effects,
        "ranges": calibration.get("ranges") or {},
        "parameters": calibration["parameters"],
        "matrix_3x4": matrix,
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


def _unit(calibration: Mapping[str, Any]) -> str:
    log = calibration.get("log")
    return str(calibration["unit"] if log is None else log["unit"])
