"""The generator of the hidden-effect study: sizes, places, noise, and its independence."""

import numpy as np
import pytest
from usual import NINE

from accelstudy.approaches import get_approach
from accelstudy.campaign.calibration.fit import fit_campaign
from accelstudy.diagnosis.space.frame import HoldColumns, signatures
from accelstudy.effects import get_effect
from studies.hidden.physics.designs import APPROACHES, session
from studies.hidden.physics.generate import Case, generate
from studies.hidden.physics.geometry import GRAVITY
from studies.hidden.physics.kinds import EFFECTS, NOWHERE, OF_ROBOT, OUTSIDE, UNFORESEEN, Cause
from studies.hidden.physics.measuring import NOISES, Noise, Sensor, observe
from studies.hidden.physics.oracle import oracle, visible_outside


def seeded(*key):
    return np.random.SeedSequence(20180309, spawn_key=key)


def misfit_without_noise(case, kind, seed):
    """Ω of the positions of a design as they are planned, with the effect of a campaign."""
    campaign, truth = generate(case, seed)
    (effect,), parts = truth.effects, truth.sensor
    sensor = Sensor(*(np.array(parts[key]) for key in ("bias", "scale", "lean")))
    cause = Cause(kind, effect.settings, np.array([effect.parameters]))
    forces, angles = observe(session(case.design), sensor, [cause])
    robot = None if campaign.angles is None else angles[0]
    planned = campaign.with_arrays(forces=forces[0], angles=robot)
    return fit_campaign(planned, NINE, get_approach(case.approach)).solution.omega, truth


@pytest.mark.parametrize("approach", APPROACHES)
def test_the_misfit_of_an_adjustment_is_the_noncentrality_that_was_asked_for(approach):
    """Σ v²/σ² of data without noise, fitted by the adjustment of the project.

    Of physics outside the catalogue, one kind of each place and of each target without a place.
    """
    design, lam, shown = "repeats-30", 100.0, visible_outside("repeats-30", approach)
    outside = {kind.place or kind.target: name for name, kind in OUTSIDE.items() if name in shown}
    visible = oracle(design, approach).visible
    for kinds, set_, names in ((EFFECTS, "one", visible), (OUTSIDE, "outside", outside.values())):
        for i, name in enumerate(names):
            case = Case(set_, design, approach, True, (name,), (lam,))
            misfit, truth = misfit_without_noise(case, kinds[name], seeded(6, i))
            assert misfit == pytest.approx(lam, rel=0.01 if set_ == "one" else 0.03), name
            assert (name in truth.classes[0]) == (set_ == "one"), name


@pytest.mark.parametrize("approach", APPROACHES)
@pytest.mark.parametrize("name", EFFECTS)
def test_effects_leave_what_those_of_the_catalogue_leave(name, approach):
    """Two sets of formulas, written apart, say the same of small effects of an ideal sensor."""
    # Only here does the temperature change linearly from hold to hold, as one must guess of a lag.
    design = "abba-48" if name == "thermal_bias" else "long-60"
    own, effect = oracle(design, approach), EFFECTS[name]
    settings = effect.draw(own.session, np.random.default_rng(12))
    if name == "thermal_bias":
        assert settings["tau"] > 0
    shape = own.shape(effect, settings)
    campaign, _ = generate(Case("null", design, "robot", True), seeded(7))
    forces, angles = (part[0] for part in observe(own.session, Sensor(), ()))
    hold = campaign.with_arrays(forces=forces, angles=angles).hold
    other = type(get_effect(name))(**settings)
    found = signatures((other,), forces, angles, GRAVITY, HoldColumns(hold, 2))
    step = 1e-4 / max(np.abs(found.force).max(), np.abs(found.angles).max())
    left = [
        own.conditions.seen(
            forces + sign * step * np.moveaxis(found.force, 2, 0),
            angles + sign * step * np.moveaxis(found.angles, 2, 0),
        )
        for sign in (1, -1)
    ]
    theirs = (left[0] - left[1]).T / (2 * step)
    size = np.linalg.norm(theirs)
    if shape is None:
        scale = np.linalg.norm(found.force) + GRAVITY * np.linalg.norm(found.angles)
        assert size < 1e-4 * scale / own.session.sigma
        return
    mine = shape.basis
    assert np.linalg.norm(theirs - mine @ (mine.T @ theirs)) < 1e-4 * size
    assert np.linalg.matrix_rank(theirs, tol=1e-4 * size) == shape.dim


@pytest.mark.parametrize(("part", "design"), [(0, "abba-48"), (1, "snub-24"), (2, "repeats-30")])
def test_what_is_called_invisible_leaves_nothing_and_what_is_outside_no_effect_explains(
    part, design
):
    """Of the latter, a third of the kinds in each design."""
    for approach in APPROACHES:
        own = oracle(design, approach)
        for name in own.invisible:
            case = Case("invisible", design, approach, True, (name,))
            effect = generate(case, seeded(9))[1].effects[0]
            cause = Cause(EFFECTS[name], effect.settings, np.array([effect.parameters]))
            left = own.conditions.seen(*observe(own.session, Sensor(), [cause]))
            assert np.sum(left**2) < 0.05, name
            assert effect.parameters != (0.0,) * EFFECTS[name].k
        shown = visible_outside(design, approach)
        for kinds, set_ in ((OUTSIDE, "outside"), (UNFORESEEN, "unforeseen")):
            for name in [one for one in shown if one in kinds][part::3]:
                case = Case(set_, design, approach, True, (name,), (200.0,))
                truth = generate(case, seeded(10))[1]
                assert not any(truth.classes)
                kind, effect = NOWHERE[name], truth.effects[0]
                cause = Cause(kind, effect.settings, np.array([effect.parameters]))
                left = own.conditions.seen(*observe(own.session, Sensor(), [cause]))[0]
                assert oracle(design, approach).is_outside(left), name
                place = kind.place
                recorded = place and (approach == "robot" or place[0] not in OF_ROBOT)
                assert truth.true_place == (place if recorded else None), name


# --- physics outside the catalogue ---------------------------------------------------------------


@pytest.mark.parametrize("kind", [None, *NOISES])
def test_the_noise_is_what_it_is_said_to_be(kind):
    own, rng, errors = session("repeats-30"), np.random.default_rng(12), []
    for _ in range(60):
        noise = Noise.drawn(kind, own, rng)
        output = rng.uniform(-9, 9, (own.n, 3))
        error = (noise.read(output, own, rng) - output) / own.sigma
        errors.append(error / noise.axes / np.hypot(noise.factor, noise.ratio))
    scaled = np.array(errors)
    square, beside = np.mean(scaled**2), np.mean(scaled[:, 1:] * scaled[:, :-1])
    if kind == "coarse":
        assert square > 1.5
        return
    assert square == pytest.approx(1, abs=4 * np.sqrt((40 if kind == "tails" else 4) / scaled.size))
    if kind == "tails":
        assert np.mean(scaled**4) > 4.5
    elif kind == "autoregressive":
        assert beside > 0.3
    else:
        assert abs(beside) < 4 / np.sqrt(scaled.size)


# --- the oracle ----------------------------------------------------------------------------------


def test_the_oracle_keeps_its_level_and_knows_what_is_large():
    knowing = oracle("snub-24", "robot")
    rng, m = np.random.default_rng(14), len(knowing.together)
    nothing = knowing.conditions.left(rng.standard_normal((600, m)))
    alarms = np.mean([knowing.judge(z, ()).detected for z in nothing])
    assert alarms == pytest.approx(0.05, abs=4 * np.sqrt(0.05 * 0.95 / 600))
    right = []
    for i, name in enumerate(knowing.visible):
        case = Case("one", "snub-24", "robot", False, (name,), (2000.0,))
        truth = generate(case, seeded(15, i))[1]
        (told,) = truth.oracle.told
        right.append(bool({*told} & {*truth.classes[0]}))
        assert truth.oracle.alternatives <= 2
        assert truth.oracle.detected
        assert truth.oracle.best == truth.oracle.told
    assert np.mean(right) > 0.85
