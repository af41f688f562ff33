"""The plan of a calibration: linear theory, ranking, words and files, and simulations that share no
code with it of what it promises: the fewest positions, what both angles stay below, and what a
temperature in use leaves."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest
import yaml
from calling import call, succeed
from closed_forms import roll_and_pitch
from golden import compare
from places import ROOT
from usual import NINE, G, compare_few

from accelstudy.basics.units import GON, MGON
from accelstudy.data_sheets import DataSheet, get_data_sheet, sheet_of_sigma
from accelstudy.design.continuous import continuous_optimum
from accelstudy.design.spaces import Attitudes
from accelstudy.planning.answer import (
    answer,
    in_best_positions,
    in_fewest_positions,
    lower_bound,
    search_like,
)
from accelstudy.planning.candidates import candidates, information_of, tilt_of
from accelstudy.planning.question import Equipment, Question
from accelstudy.planning.reasons import errors_in_use, spoilers
from accelstudy.planning.simulated import BOTH, cell_of, simulate_candidate
from accelstudy.planning.wording import part_lines
from accelstudy.schemes import get_scheme
from accelstudy.simulation.sessions import Noise
from accelstudy.study.statistics import TILT, simulated_statistics

MCLAREN = get_scheme("mclaren-24")
HAS = ("bias", "scale", "nonorthogonality", "quadratic_scale")
QUESTION = "plan --tilt-accuracy 10mgon --tilt-range 30gon --sigma 2mm/s2"
SIGMA = 0.002
REPLICATES = 5000


@pytest.fixture(autouse=True)
def few_candidates(monkeypatch):
    """Schemes of a few sizes and a few models are enough, but for the plan of the README."""
    compare_few(monkeypatch)


@pytest.fixture(scope="module")
def told():
    """The plan that the README asks for, and what the command prints of it."""
    plans = []

    def kept(*given):
        plans.append(answer(*given))
        return plans[0]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("accelstudy.planning.answer.answer", kept)
        printed = succeed(*QUESTION.split()).stdout
    return plans[0], printed


@pytest.fixture(scope="module")
def plan(told):
    return told[0]


BY_HAND, ROBOT = Equipment("gravity", 20.0, 0.0), Equipment("robot", 10.0, 1800.0)


def asked(sheet=None, target=10 * MGON, tilt_range=30 * GON, equipment=(BY_HAND, ROBOT), **more):
    options = {"sigma_angle": 3.2 * MGON, "most_positions": 200, **more}
    return Question(target, tilt_range, sheet or sheet_of_sigma(0.002), equipment, **options)


# --- linear theory -------------------------------------------------------------------------------


def left(model, sizes, approach="gravity", sigma=SIGMA):
    """Tilt error that a calibration in McLaren's positions leaves, by linear theory."""
    question, equipment = asked(), {"gravity": BY_HAND, "robot": ROBOT}[approach]
    information = information_of(question, equipment, MCLAREN.directions, sigma)
    return tilt_of(question, information, model, sizes)


def test_what_is_neglected_leaves_what_a_calibration_of_such_a_sensor_leaves():
    # Four sensors of quadratic scales drawn with the size that is expected, without noise.
    size = 300e-6
    expected = left(NINE, {"quadratic_scale": size}, sigma=1e-9)
    draws = size * np.random.default_rng(3).standard_normal((4, 3))
    whitened = np.cov(draws.T, bias=True) + np.outer(draws.mean(0), draws.mean(0))
    draws = draws @ np.linalg.inv(np.linalg.cholesky(whitened)).T * size  # of just that size
    question, squares = asked(), []
    cell = replace(cell_of(question, _candidate(question), 2), noise=Noise(1e-8, 0.0))
    for draw in draws:
        bent = {**cell.truth, **dict.fromkeys(("b_x", "b_y", "b_z"), 0.0)}
        bent |= dict(zip(("k2_x", "k2_y", "k2_z"), draw.tolist(), strict=True))
        mine = replace(cell, truth=bent, simulated_effects=HAS)
        squares.append(simulated_statistics(mine, 1)["tilt_rms"].value ** 2)
    np.testing.assert_allclose(np.sqrt(np.mean(squares, axis=0)), expected.rms, rtol=0.02)


def _candidate(question, scheme="mclaren-24", equipment="gravity", model=NINE.name):
    return next(
        c
        for c in candidates(question)
        if (c.scheme.name, c.equipment.name, c.model.name) == (scheme, equipment, model)
    )


def test_the_quantile_is_that_of_draws():
    expected = left(NINE, {"quadratic_scale": 200e-6, "cubic_scale": 200e-6}, "robot")
    rng = np.random.default_rng(1)
    draws = rng.standard_normal((200_000, len(expected.causes)))
    squares = np.stack([np.einsum("ru,uw,rw->r", draws, q, draws) for q in expected.form], 1)
    np.testing.assert_allclose(np.sqrt(squares.mean(axis=0)), expected.rms, rtol=0.02)
    for share in (0.5, 0.9, 0.95, 0.99):
        drawn = np.sqrt(np.quantile(squares, share, axis=0))
        np.testing.assert_allclose(expected.quantile(share), drawn, rtol=0.03)
        both = np.sqrt(np.quantile(squares.max(axis=1), share))
        assert expected.quantile_of_both(share) == pytest.approx(both, rel=0.04)


# --- candidates and their ranking ----------------------------------------------------------------


def test_the_answer_is_the_cheapest_that_reaches_the_target(plan):
    first = plan.first
    assert first.equipment == BY_HAND
    assert first.model.name == NINE.name
    assert first.simulated.rms.max() <= 10 * MGON
    cheaper = [
        c for c in plan.candidates
        if c.equipment == BY_HAND and c.seconds < first.seconds and c.tilt.rms.max() <= 10 * MGON
    ]  # fmt: skip
    # Linear theory may be optimistic, by little.
    assert all(c.tilt.rms.max() > 9.6 * MGON for c in cheaper)
    times = [r.seconds for r in plan.ranked]
    assert times == sorted(times)
    kinds = {(r.equipment, r.model.name) for r in plan.ranked}
    assert len(kinds) == len(plan.ranked)


def test_simulation_agrees_with_linear_theory(plan):
    for ranked in plan.ranked:
        expected, simulated = ranked.tilt.rms, ranked.simulated
        assert simulated.statistics.simulated == plan.replicates
        error = 4 * simulated.statistics["tilt_rms"].error + 0.01 * expected
        assert np.all(np.abs(simulated.rms - expected) < error)


def test_neglected_effects_decide_the_model():
    bent = DataSheet("s", position_sigma=0.5e-3, nonlinearity=0.005, full_scale=19.6133)
    result = answer(asked(bent, equipment=(BY_HAND,)), replicates=500)
    names = [effect.name for effect in result.first.model.effects]
    assert {"quadratic_scale", "cubic_scale"} <= set(names)


def test_what_would_spoil_a_plan_is_of_the_size_that_leaves_the_target():
    question = asked(sheet_of_sigma(0.002))
    candidate = _candidate(question, equipment="robot")
    sizes = {s.effect.name: s for s in spoilers(question, candidate)}
    assert math.isinf(sizes["gravity_error"].size)
    assert sizes["base_tilt"].size < 20 * MGON
    for name, spoiler in sizes.items():
        if math.isfinite(spoiler.size):
            alone = left(NINE, {name: spoiler.size}, "robot").squares[name]
            assert np.sqrt(alone.max()) == pytest.approx(question.target, rel=1e-9)


def test_what_usually_spoils_a_plan_stands_beside_its_accuracy():
    result = answer(asked(equipment=(ROBOT,)), replicates=200)
    assert "if there is no mounting rotation" in part_lines("answer", result)[1]


# --- words ---------------------------------------------------------------------------------------


def test_the_answer_that_the_readme_quotes_is_the_commands_own(told):
    text = (ROOT / "README.md").read_text(encoding="utf-8").partition(f"accelstudy {QUESTION}\n")[2]
    quoted = re.search(r"```[^\n]*\n(.*?)```", text, re.DOTALL)[1]
    printed = told[1].splitlines(keepends=True)[: quoted.count("\n")]
    assert compare(quoted, "".join(printed))[0] == []


@pytest.mark.parametrize(("target", "options", "said"), [
    (0.1, {"equipment": (BY_HAND,)}, "No calibration tried here reaches 0.1 mgon .rms. by hand"),
    (0.1, {"most_seconds": 600.0}, "within 10 min"),
    (0.1, {"most_seconds": 60.0},
     "No calibration fits within 1 min: the shortest takes 9 positions by hand"),
    (0.1, {"most_positions": 5, "equipment": (BY_HAND,)},
     "No calibration fits with at most 5 positions by hand: the shortest takes 9"),
    (0.1, {"sigma_angle": 1 * GON, "equipment": (ROBOT,)}, "the best leaves .* with a robot"),
    (0.1, {"confidence": 0.95}, r"\(95 % of them\)"),
    (7, {"most_positions": 20, "equipment": (BY_HAND,)}, "with at most 20 positions by hand"),
])  # fmt: skip
def test_what_cannot_be_reached_is_one_line_with_what_can(target, options, said):
    question = asked(target=target * MGON, **options)
    result = answer(question, replicates=200)
    assert result.ranked == []
    (line,) = part_lines("answer", result)
    assert re.search(said, line)
    assert "\n" not in line


# --- against simulations that share no code ------------------------------------------------------


def attitudes(tilt_range):
    """Specific forces and weights of 4 × 12 attitudes, whose mean is that over the whole cap."""
    nodes, weights = np.polynomial.legendre.leggauss(4)
    cosine = (1 + np.cos(tilt_range)) / 2 + nodes * (1 - np.cos(tilt_range)) / 2
    cosine, azimuth = np.meshgrid(cosine, 2 * np.pi * (np.arange(12) + 0.5) / 12, indexing="ij")
    sine = np.sqrt(1 - cosine**2)
    forces = -G * np.stack([sine * np.cos(azimuth), sine * np.sin(azimuth), cosine], axis=-1)
    return forces.reshape(-1, 3), np.repeat(weights / 24, 12)


def corrected(readings, p):
    """Forces M (r - b) of calibrations (R, 9): biases, and the upper triangle of M."""
    x, y, z = np.moveaxis(readings - p[:, None, :3], -1, 0)
    sx, sy, sz, xy, xz, yz = (p[:, i, None] for i in range(3, 9))
    return np.stack([(1 + sx) * x + xy * y + xz * z, (1 + sy) * y + yz * z, (1 + sz) * z], -1)


def by_hand(directions, tilt_range, sigma=SIGMA, replicates=REPLICATES, seed=5):
    """Rms over attitudes of roll and pitch, (R, 2), that calibrations by the norm of gravity leave.

    Gauss-Newton on |M (r - b)| = g, for all calibrations at once; the readings have equal noise, so
    least squares of the norms are the weighted ones to first order.
    """
    rng = np.random.default_rng(seed)
    u = np.asarray(directions, dtype=float)
    readings = -G * u + sigma * rng.standard_normal((replicates, *u.shape))
    p = np.zeros((replicates, 9))
    for _ in range(3):
        f = corrected(readings, p)
        norm = np.linalg.norm(f, axis=-1)
        e = f / norm[..., None]
        x, y, z = np.moveaxis(readings - p[:, None, :3], -1, 0)
        ex, ey, ez = np.moveaxis(e, -1, 0)
        design = np.stack([-ex, -ey, -ez, ex * x, ey * y, ez * z, ex * y, ex * z, ey * z], axis=-1)
        normal = np.swapaxes(design, 1, 2) @ design
        right = np.einsum("rni,rn->ri", design, G - norm)
        p += np.linalg.solve(normal, right[..., None])[..., 0]
    forces, weights = attitudes(tilt_range)
    left = roll_and_pitch(corrected(forces[None], p)) - roll_and_pitch(forces)
    return np.sqrt(np.einsum("rka,k->ra", left**2, weights))


def rms(left):
    """Rms of the worse angle, and its standard error."""
    square = left**2
    worse = square.mean(axis=0).argmax()
    value = np.sqrt(square[:, worse].mean())
    return value, square[:, worse].std() / np.sqrt(len(left)) / (2 * value)


@pytest.fixture(scope="module")
def positions(plan, tmp_path_factory):
    """Positions in the file that a plan writes."""
    folder = tmp_path_factory.mktemp("positions") / "plan"
    plan.save(folder)
    return yaml.safe_load((folder / "positions.yaml").read_text(encoding="utf-8"))["directions"]


def test_both_angles_stay_below_a_bound_over_sensors_whose_neglected_effects_differ():
    """Calibrations of sensors with nonlinearities drawn at random."""
    question, rng = asked(get_data_sheet("adxl355"), equipment=(BY_HAND,)), np.random.default_rng(2)
    candidate = _candidate(question)
    cell, below = cell_of(question, candidate, 2), []
    bound = simulate_candidate(question, candidate, 1, 20).quantile_of_both(0.95)
    for _ in range(60):
        bent = {k: rng.normal() * abs(x) if k[0] == "k" else x for k, x in cell.truth.items()}
        each = simulated_statistics(replace(cell, truth=bent), 1, np.array([0.5]))
        at = each.quantile(TILT, BOTH, 0.5).value
        below.append(at < bound)  # what is neglected is nearly all: the middle one stands for all
    assert np.mean(below) == pytest.approx(0.95, abs=0.1)


def test_a_plan_writes_the_positions_that_it_simulated(plan, positions):
    mine = plan.first.scheme.directions
    distances = np.linalg.norm(mine[:, None] - np.array(positions)[None], axis=-1)
    assert len(positions) == len(mine)
    assert distances.min(axis=0).max() < 1e-8
    assert distances.min(axis=1).max() < 1e-8


def test_the_recommended_positions_suffice_and_both_angles_stay_below_what_is_said(plan, positions):
    left = by_hand(positions, 30 * GON)
    value, error = rms(left)
    assert value < 10 * MGON + 3 * error
    said = plan.first.simulated
    assert value == pytest.approx(
        said.rms.max(), abs=4 * np.hypot(error, said.statistics["tilt_rms"].error.max())
    )
    inside = np.mean(np.all(left < said.quantile_of_both(0.95), axis=1))
    shares = 0.05 * 0.95 * (1 / len(left) + 1 / plan.replicates)
    assert abs(inside - 0.95) < 4 * np.sqrt(shares)


def test_one_position_less_does_not_suffice(plan):
    """Neither the best that are found, nor any at all: the bound is one of all choices."""
    n = plan.first.scheme.n_positions
    assert n == 18
    given = plan.question, plan.first
    value, error = rms(by_hand(in_best_positions(*given, n - 1).scheme.directions, 30 * GON))
    assert value > 10 * MGON + 2 * error
    search = search_like(*given, n - 1)
    optimum = continuous_optimum(search.task, search.criterion, Attitudes(), n - 1)
    assert np.exp(optimum.bound / 2) > 10 * MGON
    # That of the positions' own derivatives.
    assert lower_bound(plan.question, in_best_positions(*given, n)) in (n - 1, n)


def test_the_fewest_positions_suffice_although_the_model_lacks_effects():
    bent = DataSheet("s", position_sigma=SIGMA, nonlinearity=0.001, full_scale=19.6133)
    question = asked(bent, 20 * MGON, 50 * GON, (BY_HAND,), holds=(10.0,))
    known = in_best_positions(question, _candidate(question), 20)
    found = in_fewest_positions(question, known)
    assert np.sqrt(found.tilt.squares["quadratic_scale"].max()) > 0.2 * question.target
    assert found.tilt.rms.max() <= question.target
    assert found.scheme.n_positions < 30


def test_a_share_of_the_calibrations_is_of_both_angles_at_once():
    question = asked(target=20 * MGON, equipment=(BY_HAND,), confidence=0.95)
    found = answer(question, replicates=4000).first
    n = found.scheme.n_positions
    inside = {}
    for count in (n, n - 2):
        best = in_best_positions(question, found, count).scheme.directions
        inside[count] = np.mean(np.all(by_hand(best, 30 * GON) < 20 * MGON, 1))
    noise = 3 * np.sqrt(0.05 * 0.95 * (1 / REPLICATES + 1 / 4000))
    assert inside[n] > 0.95 - noise
    assert inside[n - 2] < 0.95
    # One angle alone would make fewer positions seem enough.
    alone = by_hand(found.scheme.directions, 30 * GON)
    assert np.quantile(alone, 0.95, axis=0).max() < 0.96 * 20 * MGON


@pytest.mark.parametrize("name", ["adxl355", "mpu-6050", "stim300"])
@pytest.mark.parametrize(("tilt_range", "kelvin"), [(30, 10), (60, 25)])
def test_temperature_in_use_leaves_what_warmed_sensors_do(name, tilt_range, kelvin):
    sheet = get_data_sheet(name)
    question = asked(sheet, tilt_range=tilt_range * GON)
    f, weights = attitudes(tilt_range * GON)
    bias, scale = np.random.default_rng(3).standard_normal((2, REPLICATES, 1, 3))
    bias *= kelvin * (sheet.bias_per_kelvin or 0)
    scale *= kelvin * (sheet.scale_per_kelvin or 0)
    left = roll_and_pitch(f * (1 + scale) + bias) - roll_and_pitch(f)
    square = np.einsum("rka,k->ra", left**2, weights).mean(axis=0)
    # With 3 degrees of freedom or more the rms of so many is right to 0.6 %.
    said = errors_in_use(question, kelvin)["warmth"]
    assert said == pytest.approx(np.sqrt(square.max()), rel=0.025)


# --- the command ---------------------------------------------------------------------------------


def test_an_unreachable_target_has_an_exit_status_of_its_own():
    result = call(
        "plan", "--tilt-accuracy", "0.01mgon", "--sigma", "2mm/s2", "--equipment", "gravity"
    )
    assert result.exit_code == 1
    assert result.stdout.count("\n") == 1
    assert result.stderr == "comparing calibrations, which takes some seconds ...\n"
