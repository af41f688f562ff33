"""Test each new position against those before it, and use it unless it is in conflict."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from accelstudy.adjustment import Observations
from accelstudy.adjustment.quality import global_test, suspects
from accelstudy.approaches import Approach
from accelstudy.basics.errors import InputError
from accelstudy.sensors.sensor import SensorModel
from accelstudy.sequential.choice import apart_from
from accelstudy.sequential.information import NOTHING_KNOWN, Prior
from accelstudy.sequential.recursion import Recursion

Array = NDArray[np.float64]

CONFLICT = 1e-3
"""Level of the test of a new position, the usual one of Baarda (1968)."""
ALL_ALIKE = 0.01
"""Family-wise level of the tests of all positions by all others."""
MANY = 0.2
"""Share of positions in conflict above which the noise or the model must be wrong."""


class Agreement(Enum):
    """Whether a position agrees with those before it."""

    AGREES = "agrees"
    CONFLICT = "conflict"
    UNTESTED = "untested"


@dataclass(frozen=True)
class LastPosition:
    """The last position, tested before it was used.

    Attributes
    ----------
    index : int, in the session
    agreement : Agreement
    p_value : float, probability that noise alone makes it disagree so much; NaN if untested
    repeats : bool, whether it repeats a position in conflict and is in conflict as well
    """

    index: int
    agreement: Agreement
    p_value: float
    repeats: bool


class Screening:
    """One session, its positions sorted into those that agree and those in conflict.

    A position in conflict is set aside and should be repeated. The fault may also lie with earlier
    positions, which could not be checked when they came in. So with each further position all are
    tested against all others, and those in conflict with the others are set aside. If these are too
    many, the noise or the model is wrong and not the positions; then all are used.

    Parameters
    ----------
    model : SensorModel
    approach : Approach
    observed : Observations, R = 1, of the session so far; it may have no positions yet
    sigma_known : bool, whether the noise is stated
    prior : Prior, optional
    initial : (u,) array, SI, optional, where to start, as in `Recursion`

    Attributes
    ----------
    recursion : Recursion, of the positions that are used
    used, aside : lists of int, indices of positions
    last : LastPosition or None
    """

    def __init__(
        self,
        model: SensorModel,
        approach: Approach,
        observed: Observations,
        sigma_known: bool,
        prior: Prior = NOTHING_KNOWN,
        initial: Array | None = None,
    ) -> None:
        self.model, self.approach, self.sigma_known = model, approach, sigma_known
        self.prior, self.initial = prior, initial
        self.used: list[int] = []
        self.aside: list[int] = []
        self.last: LastPosition | None = None
        self._observed = observed  # of which all positions of the recursion were taken
        self.recursion = self._recursion(observed, [])
        self.add(observed)

    @property
    def refuted(self) -> bool:
        """Whether the residuals are larger than the stated noise allows."""
        r, omega = self.recursion.redundancy, float(self.recursion.omega[0])
        if not self.sigma_known or r <= 0 or not self.recursion.solved[0]:
            return False
        test = global_test(omega, r)
        return test is not None and not test.accepted and omega > r

    @property
    def sigma_trusted(self) -> bool:
        """Whether the noise is stated, and the residuals allow it."""
        return self.sigma_known and not self.refuted

    def add(self, observed: Observations) -> None:
        """Take the session with new positions; those taken before must be in it."""
        for i in range(len(self.used) + len(self.aside), observed.forces.shape[1]):
            self._take(i, observed)

    def _recursion(self, observed: Observations, used: list[int]) -> Recursion:
        chosen = observed.take(np.array(used, dtype=int))
        return Recursion(self.model, self.approach, chosen, self.prior, self.initial)

    def _take(self, i: int, observed: Observations) -> None:
        p = self._p_value(i, observed)
        before = self.aside[-1] if self.aside else None
        conflict = p < CONFLICT
        repeats = conflict and before is not None and not _apart(observed, i, before)
        without = (self.used, self.recursion)
        if conflict:
            self.aside.append(i)
        else:
            self._use(i, observed)
        doubtful = before is not None or self.refuted
        if doubtful and not repeats and self._sort_anew(observed, i, *without):
            conflict, p = i in self.aside, self._p_value(i, observed)
            if not conflict:
                self._use(i, observed)
        agreement = Agreement.CONFLICT if conflict else Agreement.AGREES
        if np.isnan(p):
            agreement = Agreement.UNTESTED
        self.last = LastPosition(i, agreement, p, repeats)

    def _use(self, i: int, observed: Observations) -> None:
        self.used = [*self.used, i]
        self.recursion = self.recursion.copy()
        self.recursion.add(observed.take(np.array(self.used)))

    def _p_value(self, i: int, observed: Observations) -> float:
        """P-value of position i, tested by those in use; NaN where they cannot test it."""
        recursion = self.recursion
        if not recursion.solved[0]:
            return np.nan
        prediction = recursion.predict(observed.take(np.array([*self.used, i])))
        omega = None if self.sigma_trusted else recursion.omega
        return float(prediction.p_value(omega, recursion.redundancy)[0])

    def _sort_anew(
        self, observed: Observations, i: int, before: list[int], recursion: Recursion
    ) -> bool:
        """Test all positions up to i against all others; return whether that was possible.

        Afterwards all are sorted except i, if it is in no conflict. Before i, those of `before`
        were in use, and in `recursion`.
        """
        whole, most = observed.take(np.arange(i + 1)), int(MANY * (i + 1))
        try:
            suspected = suspects(
                self.model, self.approach, whole, ALL_ALIKE, self.sigma_known, most + 1
            )
        except InputError:  # together they have no solution
            return False
        too_many = len(suspected) > most
        self.aside = [] if too_many else sorted(suspect.position for suspect in suspected)
        self.used = [j for j in range(i) if j not in self.aside]
        # Of the same session, the same positions in the same order have the same recursion.
        if self.used != before or observed is not self._observed:
            recursion, self._observed = self._recursion(observed, self.used), observed
        self.recursion = recursion
        return True


def _apart(observed: Observations, i: int, j: int) -> bool:
    """Whether two positions are in different attitudes."""
    first, second = (f / np.linalg.norm(f) for f in observed.forces[0, [i, j]])
    return bool(apart_from(first[None], second[None])[0, 0])
