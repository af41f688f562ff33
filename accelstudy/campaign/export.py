"""A calibration in the forms in which a device or another program takes it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np
import yaml
from numpy.typing import ArrayLike, NDArray

from accelstudy.errors import InputError
from accelstudy.units import STANDARD_GRAVITY

Array = NDArray[np.float64]

FORMS = ("json", "yaml", "c", "matrix")


def device_matrix(calibration: Mapping[str, Any]) -> Array:
    """M (3, 4) with f_b = M · (raw, 1), from the raw unit of the campaign to m/s².

    Parameters
    ----------
    calibration : mapping, content of calibration.json

    Raises
    ------
    InputError
        If the model is not affine, so that no matrix can hold it.
    """
    affine = calibration["affine"]
    if affine is None:
        raise InputError(
            f"model {calibration['model']!r} is not affine: no matrix can hold it; use json or yaml"
        )
    k, bias = np.array(affine["matrix"]), np.array(affine["bias_mps2"])
    scale, offset = raw_conversion(calibration)
    linear = k * scale
    return np.column_stack([linear, -linear @ offset - k @ bias])


def raw_conversion(calibration: Mapping[str, Any]) -> tuple[Array, Array]:
    """Scale and offset (3,) with f = (raw − offset) · scale in m/s², for the campaign's unit."""
    if calibration["unit"] == "counts":
        nominal = calibration["nominal"]
        return np.array(nominal["scale"], dtype=float), np.array(nominal["offset"], dtype=float)
    factor = STANDARD_GRAVITY if calibration["unit"] == "g" else 1.0
    return np.full(3, factor), np.zeros(3)


def export(calibration: Mapping[str, Any], form: str) -> str:
    """Text of a calibration in one of `FORMS`.

    "json" and "yaml" hold the parameters with sigmas and the matrix, "c" is a header with the
    matrix, "matrix" the plain 3 × 4 numbers.
    """
    if form == "matrix":
        return "\n".join(_row(row, " ") for row in device_matrix(calibration)) + "\n"
    if form == "c":
        return _c_header(calibration)
    short = {key: calibration[key] for key in ("campaign", "model", "unit", "parameters")}
    affine = calibration["affine"] is not None
    short["matrix_3x4"] = device_matrix(calibration).tolist() if affine else None
    if form == "json":
        return json.dumps(short, indent=2, ensure_ascii=False) + "\n"
    if form == "yaml":
        return yaml.safe_dump(short, sort_keys=False, allow_unicode=True)
    raise InputError(f"unknown form {form!r} (known: {', '.join(FORMS)})")


def _row(values: ArrayLike, separator: str) -> str:
    return separator.join(f"{value: .12e}" for value in np.asarray(values))


def _c_header(calibration: Mapping[str, Any]) -> str:
    rows = ",\n".join(f"    {{{_row(row, ', ')}}}" for row in device_matrix(calibration))
    comment = str(calibration["campaign"]).replace("*/", "* /")
    return (
        f"/* Accelerometer calibration of {comment}.\n"
        " * Specific force in m/s^2 = M * (x, y, z, 1), "
        f"with x, y, z in {calibration['unit']}. */\n"
        "#ifndef ACCELEROMETER_CALIBRATION_H\n#define ACCELEROMETER_CALIBRATION_H\n\n"
        f"static const double accelerometer_calibration[3][4] = {{\n{rows}\n}};\n\n#endif\n"
    )
