"""A data sheet with what the history of this very sensor says: switch-on scatter and drift."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel

from accelstudy.basics.errors import InputError
from accelstudy.data_sheets.sheet import DataSheet
from accelstudy.effects import get_effect
from accelstudy.epochs.history import YEAR
from accelstudy.files.reading import read_json
from accelstudy.files.validation import Finite, NotNegative, Number, checked

NO_HISTORY = "not a history.json of accelstudy"


class _Rate(BaseModel):
    per_year: Finite
    sigma: NotNegative


class _Scatter(BaseModel):
    sd: NotNegative


class _Parameter(BaseModel):
    name: str
    rate: _Rate
    scatter: _Scatter


class _Document(BaseModel):
    """The part of `history.json` that is read."""

    schema_version: Annotated[Literal[1], Number]
    parameters: list[_Parameter]


def with_history(sheet: DataSheet, path: str | Path) -> DataSheet:
    """Put the scatter and the drift of the biases, rms over the axes, into a data sheet.

    The repeatability is the change from one session to the next, √2 times the scatter. The square
    of a rate is that of its estimate and that of its sigma together, as of a drift of that size.

    Raises
    ------
    InputError
        If it is no history, or none of a bias.
    """
    document = checked(_Document, read_json(path, NO_HISTORY), f"{path}: {NO_HISTORY}")
    names = [parameter.name for parameter in get_effect("bias").parameters]
    biases = [parameter for parameter in document.parameters if parameter.name in names]
    if not biases:
        raise InputError(f"{path}: parameters: no bias; take calibrations whose model has one")
    scatter = np.sqrt(np.mean([each.scatter.sd**2 for each in biases]))
    rate = np.sqrt(np.mean([each.rate.per_year**2 + each.rate.sigma**2 for each in biases]))
    return replace(
        sheet,
        repeatability=float(np.sqrt(2) * scatter),
        bias_rate=float(rate / YEAR),
        sources={**sheet.sources, "repeatability": str(path)},
        assumed=sheet.assumed - {"repeatability"},
    )
