"""The conditions of holds as symbols."""

from __future__ import annotations

from typing import Any

from accelstudy.effects.hold_conditions import HoldConditions
from accelstudy.symbolic.algebra import sp
from accelstudy.symbolic.tracing import symbols


class HoldSymbols:
    """The columns of `HoldConditions` as symbols, and what follows from them.

    Attributes
    ----------
    columns : dict of name to symbol
    lagged_by : dict of the lag, a number or a symbol, to the symbol of the temperature behind it
    """

    def __init__(self, prefix: str = "") -> None:
        self._prefix = prefix
        names = HoldConditions.columns()
        self.columns = dict(zip(names, symbols(*(prefix + name for name in names)), strict=True))
        self.lagged_by: dict[Any, sp.Symbol] = {}

    def __getattr__(self, name: str) -> sp.Symbol:
        try:
            return self.columns[name]
        except KeyError:
            raise AttributeError(name) from None

    def lagged(self, tau: Any) -> sp.Symbol:
        """Temperature behind a lag; with a lag of 0 the temperature itself."""
        if tau == 0:
            return self.columns["temperature"]
        number = "" if not self.lagged_by else f"_{len(self.lagged_by) + 1}"
        (symbol,) = symbols(f"{self._prefix}temperature_lagged{number}")
        return self.lagged_by.setdefault(tau, symbol)
