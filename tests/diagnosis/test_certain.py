"""What is certain beside what is open: on sessions made here, by formulas of this file."""

import numpy as np
import pytest
from usual import NINE, G

import accelstudy as acs
from accelstudy.basics.errors import InputError
from accelstudy.campaign.gross_errors.recognition import recognise
from accelstudy.diagnosis.pipeline import diagnose
from accelstudy.diagnosis.report.words import verdict_lines
from accelstudy.leveling.angles import specific_force


def session(n, rng, approach="gravity"):
    """A session of n random attitudes, a minute each, of a sensor with usual errors."""
    campaign = acs.simulate_campaign(
        scheme=f"random-{n}", order="random", approach=approach, sigma=1e-3
    )
    up = rng.standard_normal((n, 3))
    up *= G / np.linalg.norm(up, axis=1, keepdims=True)
    if campaign.angles is not None:
        up = np.column_stack(specific_force(*campaign.angles.T, G))
    axes = np.eye(3) + 0.01 * np.triu(rng.uniform(-1, 1, (3, 3)))
    return campaign.with_arrays(forces=up @ axes.T + rng.uniform(-0.3, 0.3, 3)), up


def test_a_warm_up_is_certain_whatever_is_open_beside_it():
    """Large, of two time constants, beside a small even term, in more noise than is stated."""
    rng = np.random.default_rng([21, 2])
    campaign, up = session(36, rng)
    w, k = rng.standard_normal((2, 3))
    w *= 0.06 / np.linalg.norm(w)
    course = 0.85 * np.exp(-campaign.time / 280) + 0.15 * np.exp(-campaign.time / 900)
    forces = campaign.forces + np.outer(course, w) + 1.5e-3 * k / np.linalg.norm(k) * up**2 / G
    forces += 1.5e-3 * rng.standard_normal((36, 3))
    found = diagnose(campaign.with_arrays(forces=forces), NINE)
    assert found.verdict == "unknown"
    assert found.effects == ()
    assert [name.name for name in found.finding.statement.certain[0].names] == ["warm_up"]
    assert "warm_up" in [effect.name for effect in found.extended_model.effects]
    assert found.variances["base"] > 5 * found.variances["extended"]
    assert found.confirmation.confirmed
    assert found.leveling.after < found.leveling.before / 3
    assert "The model lacks warm up, and" in verdict_lines(found)[0]


SPOILS = {
    "hand-placed": lambda forces, rng: forces + 0.3 * rng.standard_normal(forces.shape),
    "hysteresis": lambda forces, _: (
        forces + 0.4 * np.sign(np.diff(forces, axis=0, prepend=forces[:1]))
    ),
    "rows": lambda forces, rng: forces[np.r_[3, 1, 2, 0, 7, 5, 6, 4, 8 : len(forces)]],
}


@pytest.mark.parametrize("spoil", SPOILS)
@pytest.mark.parametrize("axes", [(1, 0, 2), (2, 1, 0), (1, 2, 0)])
def test_exchanged_axes_are_recognised_in_poor_data(spoil, axes):
    rng = np.random.default_rng([24, *axes])
    campaign, _ = session(24, rng, "robot")
    poor = SPOILS[spoil](campaign.forces, rng)
    assert "axis_error" not in str(recognise(campaign.with_arrays(forces=poor)))
    found = recognise(campaign.with_arrays(forces=poor[:, axes]))
    np.testing.assert_array_equal(found.matrix, np.eye(3)[:, axes])


def test_a_diagnosis_that_has_no_solution_does_not_advise_a_diagnosis():
    """Of readings that have nothing in common with the attitudes."""
    rng = np.random.default_rng(27)
    campaign, _ = session(24, rng, "robot")
    other, _ = session(24, rng)
    with pytest.raises(InputError, match="does not converge") as error:
        diagnose(campaign.with_arrays(forces=other.forces), NINE)
    assert "accelstudy diagnose" not in str(error.value)
