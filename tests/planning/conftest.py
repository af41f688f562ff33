"""Plans that several tests ask about; schemes of a few sizes are enough."""

import pytest

from accelstudy.basics.units import GON, MGON
from accelstudy.data_sheets import of_sigma
from accelstudy.plan import candidates
from accelstudy.plan.answer import answer
from accelstudy.plan.question import Question

SIZES = (9, 12, 20, 30, 40, 80, 120)


@pytest.fixture(autouse=True)
def few_schemes(monkeypatch):
    monkeypatch.setattr(candidates, "SIZES", SIZES)


@pytest.fixture(scope="session")
def plan():
    """The plan of the README: 10 mgon up to 30 gon with 2 mm/s² per position."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(candidates, "SIZES", SIZES)
        return answer(Question(10 * MGON, 30 * GON, of_sigma(0.002)), replicates=4000)
