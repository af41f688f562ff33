"""The generator of the hidden-effect study: rotations, sizes, noise, and its independence."""

import ast
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import accelstudy.hidden.physics as physics
from accelstudy.approaches import get_approach
from accelstudy.campaign.fit import fit_campaign
from accelstudy.campaign.format import read_campaign, write_campaign
from accelstudy.hidden.physics import APPROACHES, DESIGNS, Case, generate, visible_effects
from accelstudy.hidden.physics.designs import session
from accelstudy.hidden.physics.effects import EFFECTS
from accelstudy.hidden.physics.measuring import Cause, Sensor, observe
from accelstudy.hidden.physics.rotations import in_turned_frame, rotated
from accelstudy.models import get_model

NINE = get_model("bias-scale-nonorthogonality")
EACH_DESIGN = pytest.mark.parametrize("design", DESIGNS)


def seeded(*key):
    return np.random.SeedSequence(20180309, spawn_key=key)


def omega(campaign, approach):
    adjustment = fit_campaign(campaign, NINE, get_approach(approach)).adjustment
    assert adjustment.converged.all()
    return float(adjustment.omega[0]), adjustment.redundancy


def test_the_generator_shares_no_physics_with_the_project():
    allowed = (
        "accelstudy.campaign.session",
        "accelstudy.campaign.format",
        "accelstudy.errors",
        "accelstudy.units",
        "accelstudy.hidden.physics",
    )
    for path in Path(physics.__file__).parent.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            names += [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            own = [name for name in names if name.startswith("accelstudy")]
            assert all(name.startswith(allowed) for name in own), (path.name, own)


def test_rotations_are_rotations():
    rng = np.random.default_rng(1)
    vectors, turns = rng.standard_normal((2, 5, 3))
    for turned in (
        rotated(np.eye(3), turns[0]),
        np.array([in_turned_frame(v, axis, 0.7) for axis in (0,) for v in np.eye(3)]),
    ):
        np.testing.assert_allclose(turned @ turned.T, np.eye(3), atol=1e-15)
        assert np.linalg.det(turned) == pytest.approx(1)
    # A quarter turn about z takes x to y; seen from a frame so turned, y is where x was.
    np.testing.assert_allclose(
        rotated(np.eye(3)[0], np.pi / 2 * np.eye(3)[2]), [0, 1, 0], atol=1e-15
    )
    np.testing.assert_allclose(in_turned_frame(np.eye(3)[1], 2, np.pi / 2), [1, 0, 0], atol=1e-15)
    np.testing.assert_allclose(rotated(rotated(vectors, turns), -turns), vectors, atol=1e-14)


def test_a_seed_gives_the_same_campaign_whatever_ran_before():
    case = Case("two", "long-60", "robot", True, ("thermal_bias", "base_tilt"), (20.0, 30.0))
    first, truth = generate(case, seeded(1))
    generate(Case("null", "snub-24", "gravity", False), seeded(2))
    second, again = generate(case, seeded(1))
    np.testing.assert_array_equal(first.forces, second.forces)
    np.testing.assert_array_equal(first.angles, second.angles)
    assert truth == again
    other, _ = generate(case, seeded(3))
    assert not np.array_equal(first.forces, other.forces)


@EACH_DESIGN
def test_a_campaign_can_be_written_and_read(design, tmp_path):
    for approach in APPROACHES:
        campaign, _ = generate(Case("null", design, approach, True), seeded(4))
        write_campaign(campaign, tmp_path / approach)
        again = read_campaign(tmp_path / approach)
        np.testing.assert_allclose(again.forces, campaign.forces)
        assert (again.angles is None) == (approach == "gravity")


@pytest.mark.parametrize("approach", APPROACHES)
def test_campaigns_without_effects_fit_as_well_as_their_sigma_says(approach):
    total, freedom = 0.0, 0
    for i, design in enumerate(DESIGNS):
        for j in range(8):
            campaign, _ = generate(Case("null", design, approach, True), seeded(5, i, j))
            value, redundancy = omega(campaign, approach)
            total, freedom = total + value, freedom + redundancy
    assert total / freedom == pytest.approx(1, abs=4 * np.sqrt(2 / freedom))


@pytest.mark.parametrize("approach", APPROACHES)
def test_the_misfit_of_an_adjustment_is_the_noncentrality_that_was_asked_for(approach):
    """Σ v²/σ² of data without noise, fitted by the adjustment of the project."""
    design, lam = "repeats-30", 100.0
    for i, name in enumerate(visible_effects(design, approach)):
        case = Case("one", design, approach, True, (name,), (lam,))
        campaign, truth = generate(case, seeded(6, i))
        (effect,), parts = truth.effects, truth.sensor
        sensor = Sensor(*(np.array(parts[key]) for key in ("bias", "scale", "lean")))
        cause = Cause(EFFECTS[name], effect.settings, np.array([effect.parameters]))
        forces, angles = observe(session(design), sensor, [cause])
        robot = None if campaign.angles is None else angles[0]
        value, _ = omega(replace(campaign, forces=forces[0], angles=robot), approach)
        assert value == pytest.approx(lam, rel=0.01), name
        assert name in truth.classes[0]
