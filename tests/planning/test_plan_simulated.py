"""What a plan promises, against simulations that share no code with it: the fewest positions, what
both angles stay below, and what a temperature in use leaves."""

import shlex

import numpy as np
import pytest
import yaml
from calling import call

from accelstudy.basics.units import GON, MGON
from accelstudy.data_sheets import get_data_sheet, of_sigma
from accelstudy.design.continuous import continuous_optimum
from accelstudy.design.spaces import Constraints, Sphere
from accelstudy.plan.answer import answer
from accelstudy.plan.optimised import Sought
from accelstudy.plan.question import BY_HAND, ROBOT, Question
from accelstudy.plan.reasons import in_use
from accelstudy.plan.wording import answer_lines, positions_command

G = 9.80665
SIGMA = 0.002
REPLICATES = 10_000


def attitudes(tilt_range):
    """Specific forces and weights of 4 × 12 attitudes, whose mean is that over the whole cap."""
    nodes, weights = np.polynomial.legendre.leggauss(4)
    cosine = (1 + np.cos(tilt_range)) / 2 + nodes * (1 - np.cos(tilt_range)) / 2
    cosine, azimuth = np.meshgrid(cosine, 2 * np.pi * (np.arange(12) + 0.5) / 12, indexing="ij")
    sine = np.sqrt(1 - cosine**2)
    forces = -G * np.stack([sine * np.cos(azimuth), sine * np.sin(azimuth), cosine], axis=-1)
    return forces.reshape(-1, 3), np.repeat(weights / 24, 12)


def roll_and_pitch(f):
    """Angles of forces (..., 3) with x forward, y right, z down."""
    x, y, z = np.moveaxis(f, -1, 0)
    return np.stack([np.arctan2(-y, -z), np.arctan2(x, np.hypot(y, z))], axis=-1)


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
    """Positions by the command that the plan tells."""
    folder = tmp_path_factory.mktemp("positions")
    command = positions_command(plan.question, plan.first.candidate)
    result = call(
        *shlex.split(command.replace("positions.yaml", str(folder / "positions.yaml")))[1:]
    )
    assert result.exit_code == 0, result.output
    return yaml.safe_load((folder / "positions.yaml").read_text(encoding="utf-8"))["directions"]


def test_the_command_that_a_plan_tells_finds_the_positions_that_it_simulated(plan, positions):
    mine = plan.first.candidate.scheme.directions
    distances = np.linalg.norm(mine[:, None] - np.array(positions)[None], axis=-1)
    assert len(positions) == len(mine)
    assert distances.min(axis=0).max() < 1e-8
    assert distances.min(axis=1).max() < 1e-8


def test_the_recommended_positions_suffice_and_both_angles_stay_below_what_is_said(plan, positions):
    left = by_hand(positions, 30 * GON)
    value, error = rms(left)
    assert value < 10 * MGON + 3 * error
    said = plan.first.simulated
    assert value == pytest.approx(said.rms.max(), abs=4 * np.hypot(error, said.error.max()))
    inside = np.mean(np.all(left < said.of_both(0.95), axis=1))
    shares = 0.05 * 0.95 * (1 / len(left) + 1 / 4000)
    assert abs(inside - 0.95) < 4 * np.sqrt(shares)


def test_one_position_less_does_not_suffice(plan):
    """Neither the best that are found, nor any at all: the bound is one of all choices."""
    n = plan.first.candidate.scheme.n_positions
    assert n == 18
    sought = Sought(plan.question, BY_HAND, plan.first.candidate.model.name, 10.0)
    value, error = rms(by_hand(sought.candidate(n - 1).scheme.directions, 30 * GON))
    assert value > 10 * MGON + 2 * error
    request = sought.request(n - 1)
    optimum = continuous_optimum(request.task, request.chosen, Sphere(), Constraints(), n - 1)
    assert np.exp(optimum.bound / 2) > 10 * MGON
    assert f"{n - 1} positions leave" in answer_lines(plan)[2]


def test_a_share_of_the_calibrations_is_of_both_angles_at_once():
    question = Question(20 * MGON, 30 * GON, of_sigma(SIGMA), (BY_HAND,), confidence=0.95)
    found = answer(question, replicates=4000).first
    n = found.candidate.scheme.n_positions
    sought = Sought(question, BY_HAND, found.candidate.model.name, 10.0)
    inside = {
        count: np.mean(
            np.all(by_hand(sought.candidate(count).scheme.directions, 30 * GON) < 20 * MGON, 1)
        )
        for count in (n, n - 2)
    }
    noise = 3 * np.sqrt(0.05 * 0.95 * (1 / REPLICATES + 1 / 4000))
    assert inside[n] > 0.95 - noise
    assert inside[n - 2] < 0.95
    # One angle alone would make fewer positions seem enough.
    alone = by_hand(found.candidate.scheme.directions, 30 * GON)
    assert np.quantile(alone, 0.95, axis=0).max() < 0.96 * 20 * MGON


def test_with_a_robot_five_positions_do_what_four_do_not(plan):
    robot = next(r for r in plan.ranked if r.candidate.equipment == ROBOT)
    assert robot.candidate.scheme.n_positions == 5
    assert robot.fewer.rms.max() > 10 * MGON


@pytest.mark.parametrize("name", ["adxl355", "mpu-6050", "stim300"])
@pytest.mark.parametrize(("tilt_range", "kelvin"), [(30, 10), (60, 25)])
def test_temperature_in_use_leaves_what_warmed_sensors_do(name, tilt_range, kelvin):
    sheet = get_data_sheet(name)
    question = Question(10 * MGON, tilt_range * GON, sheet)
    f, weights = attitudes(tilt_range * GON)
    bias, scale = np.random.default_rng(3).standard_normal((2, REPLICATES, 1, 3))
    bias *= kelvin * (sheet.bias_per_kelvin or 0)
    scale *= kelvin * (sheet.scale_per_kelvin or 0)
    left = roll_and_pitch(f * (1 + scale) + bias) - roll_and_pitch(f)
    square = np.einsum("rka,k->ra", left**2, weights).mean(axis=0)
    # With 3 degrees of freedom or more the rms of so many is right to 0.5 %.
    said = in_use(question, kelvin=kelvin).warmth
    assert said == pytest.approx(np.sqrt(square.max()), rel=0.025)


def test_the_scale_is_a_part_of_what_a_temperature_leaves():
    """ADXL355, 30 gon, 10 K: the bias alone would leave 13 mgon, both together 24."""
    said = in_use(Question(10 * MGON, 30 * GON, get_data_sheet("adxl355"))).warmth
    assert 23 < said / MGON < 25
