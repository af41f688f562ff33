"""Export of a calibration in forms that devices and other programs can read."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from accelstudy.basics.errors import InputError, check_name
from accelstudy.basics.wording import comma_list
from accelstudy.campaign.calibration.c_code import c_header
from accelstudy.campaign.calibration.px4 import px4_parameters
from accelstudy.campaign.calibration.sensor_calibration import SensorCalibration
from accelstudy.sensors.sensor import not_affine


def matrix_text(calibration: SensorCalibration) -> str:
    """Write M (3, 4) with f = M · (raw, 1), from raw readings to m/s², in the axes of the log.

    Raises
    ------
    InputError
        If the model has effects that no matrix can hold.
    """
    model, frame = calibration.model, calibration.usual_layout.axes
    if unfit := not_affine(model):
        raise InputError(
            f"no matrix can hold {comma_list(list(unfit))} of the model {model.name!r}; "
            "the form c holds all that a device can know"
        )
    affine = model.affine(calibration.parameters)
    if affine is None:
        raise InputError(f"the model {model.name!r} with these parameters has no inverse")
    (k, bias), raw = affine, calibration.usual_layout.conversion
    linear = frame.matrix.T @ k @ calibration.mending @ frame.matrix * raw.scale
    rows = np.column_stack([linear, -linear @ raw.offset - frame.matrix.T @ k @ bias])
    return "".join(" ".join(f"{value: .12e}" for value in row) + "\n" for row in rows)


FORMS: dict[str, Callable[[SensorCalibration], str | tuple[str, list[str]]]] = {
    "c": c_header,
    "c-double": partial(c_header, real="double"),
    "matrix": matrix_text,
    "px4": px4_parameters,
}
"""Forms: a header in C99, plain 3 × 4 numbers, and a file of parameters with what it lacks."""


def export(calibration: SensorCalibration, form: str) -> tuple[str, list[str]]:
    """Text of a calibration in one of `FORMS`, and sentences on what the user should know of it.

    Raises
    ------
    UnknownNameError, InputError
        If there is no such form, or it cannot hold the calibration.
    """
    check_name("form", form, FORMS)
    written = FORMS[form](calibration)
    text, lost = (written, []) if isinstance(written, str) else written
    mended = calibration.document.mended
    return text, [
        *([f"the calibration is of mended data: {mended.reason}"] if mended else []),
        *lost,
    ]
