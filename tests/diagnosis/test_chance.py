"""Simulated residuals: what is drawn for them."""

import numpy as np

from accelstudy.diagnosis.evidence import detection
from accelstudy.diagnosis.evidence.candidates import Field
from accelstudy.diagnosis.evidence.detection import Chance
from accelstudy.diagnosis.space.residuals import Residuals


def test_no_random_number_is_drawn_twice(monkeypatch):
    """Positions, priors and effects have streams of their own, all of one seed."""
    n, priors, sets = 12, 3, 50
    design = np.eye(n + priors, 2)  # takes up two conditions, and leaves the others
    one = np.ones((n, 1, 1))
    residuals = Residuals(design, np.zeros(n + priors), one, one, np.ones((n, 1)))
    chance = Chance(np.random.SeedSequence(1), n, sets)
    monkeypatch.setattr(
        detection, "simulated", lambda _, m, count, rng: rng.standard_normal((count, m))
    )
    plain = np.concatenate(list(chance.errors(residuals)))
    changed = np.concatenate(list(chance.errors_with_effects(residuals, Field({}))))[sets // 2 :]
    left = np.concatenate([plain, changed - plain[sets // 2 :]])[:, 2:].round(9)
    assert left.shape == (sets + sets // 2, n + priors - 2)
    assert len(np.unique(left)) == left.size
