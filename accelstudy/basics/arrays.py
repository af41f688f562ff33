"""The type of an array of numbers, as annotations have it, and tables that nobody can change.

Docstrings say the shapes and units of arrays.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import pandas as pd

Array = NDArray[np.float64]


class CachedTable:
    """A table that is made once, or is a field of a dataclass, and of which a reader gets a copy.

    A change of it would be shown, and not be in anything that was computed of it before.
    """

    def __init__(self, make: Callable[[Any], pd.DataFrame] | None = None) -> None:
        self.make, self.__doc__ = make, make and make.__doc__

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    def __get__(self, one: object, owner: type) -> pd.DataFrame:
        if one is None:
            raise AttributeError(self.name)  # so a field has no default
        if self.make and self.name not in vars(one):
            vars(one)[self.name] = self.make(one)
        table: pd.DataFrame = vars(one)[self.name]
        return table.copy(deep=False)  # pandas copies what is changed

    def __set__(self, one: object, table: pd.DataFrame) -> None:
        vars(one)[self.name] = table
