"""What happens once, at a time between two holds that nobody knows."""

from collections.abc import Sequence
from typing import Any, ClassVar, Self

import numpy as np

from accelstudy.basics.arrays import Array
from accelstudy.basics.registry import Setting
from accelstudy.effects.base import Effect
from accelstudy.effects.components import Number

MAX_TIMES = 100
"""Number of times up to which all are tried."""
FIRST_TIMES = 50
"""Of more times, number of those tried at first; times between them follow where it matters."""
NEXT_TIMES = 7
"""Number of times that are tried next between two of them."""


class SuddenEffect(Effect):
    """An effect that begins at a time t_c, which is searched for between the holds.

    Attributes
    ----------
    clock : str, column of `HoldConditions` that says when a hold was
    min_holds : int, holds on either side; a step with fewer cannot be told from outliers
    """

    family = "sudden change"
    takes = (Setting("t", "s", 600.0),)
    sudden = True
    clock: ClassVar[str]
    min_holds: ClassVar[int]

    def begun(self, hold: Any, xp: Any) -> Number:
        """Return 1 after its time, 0 before it."""
        sign = xp.sign(getattr(hold, self.clock) - self.settings["t"])
        return (sign + xp.abs(sign)) / 2

    def candidates(self, hold, f, g):
        """Return times between the holds: all or, of very many, more of those near the ends."""
        middles = _middles(hold.column(self.clock), self.min_holds)
        if (n := len(middles)) > MAX_TIMES:
            part = np.geomspace(1, (n + 1) / 2, FIRST_TIMES // 2) - 1
            middles = middles[np.unique(np.concatenate([part, n - 1 - part]).round().astype(int))]
        return self._at(middles)

    def between(self, other, hold):
        """Return some of the times that were skipped between those of two candidates."""
        low, high = sorted((self.settings["t"], other.settings["t"]))
        middles = _middles(hold.column(self.clock), 1)
        middles = middles[(middles > low) & (middles < high)]
        some = np.linspace(0, len(middles) - 1, min(NEXT_TIMES, len(middles)))
        return self._at(middles[some.round().astype(int)])

    def _at(self, times: Array) -> Sequence[Self]:
        return tuple(type(self)(t=t) for t in times)


def _middles(when: Array, least: int) -> Array:
    """Middles (k,) between successive holds with at least so many on either side, rounded."""
    times = np.unique(when)
    middles = (times[:-1] + times[1:]) / 2
    return np.array([float(f"{t:.9g}") for t in middles[least - 1 : len(times) - least]])
