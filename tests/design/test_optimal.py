"""Optimal schemes: criteria, constraints, search, and known optima."""

from itertools import combinations_with_replacement

import numpy as np
import pytest
from optimal_schemes import TASK as STORED
from usual import GRAVITY, NINE

from accelstudy.adjustment.calibration import CalibrationProblem
from accelstudy.approaches import get_approach
from accelstudy.basics.units import GON
from accelstudy.design.continuous import continuous_optimum
from accelstudy.design.criteria import get_criterion, rms_tilt
from accelstudy.design.estimability import estimability
from accelstudy.design.information import position_rows
from accelstudy.design.search import Search
from accelstudy.design.spaces import Attitudes, angles_to, attitudes_by_eye, cube, find_attitudes
from accelstudy.design.task import Task
from accelstudy.effects import HoldConditions
from accelstudy.leveling.error import cap_forces, tilt_error
from accelstudy.positions.choice import first_best, stable_order
from accelstudy.schemes import get_scheme
from accelstudy.schemes.optimal import stored_designs
from accelstudy.sensors.models import get_model
from accelstudy.simulation.sessions import Noise, session

BY_GRAVITY, BY_ROBOT = (Task(NINE, get_approach(name)) for name in ("gravity", "robot"))
SEARCHED = 1e-3
"""Relative margin by which a search may find a variance that is smaller than a stored one."""


def asked(task, name):
    """A task and a criterion of it."""
    return task, get_criterion(name, task)


def random_directions(n, seed=1):
    points = np.random.default_rng(seed).standard_normal((n, 3))
    return points / np.linalg.norm(points, axis=1, keepdims=True)


@pytest.mark.parametrize("approach", ["gravity", "robot"])
@pytest.mark.parametrize(("effects", "noise"), [
    ("cubic_scale+saturation+encoder_eccentricity", Noise()),
    ("thermal_bias+base_tilt+hysteresis", Noise(0.003, 1e-5, 1e-4, 2e-4)),
])  # fmt: skip
def test_the_rows_of_an_ideal_sensor_are_those_of_a_session_without_errors(
    approach, noise, effects
):
    model = get_model(f"bias-scale-nonorthogonality+{effects}")
    directions, by = random_directions(20), get_approach(approach)
    hold = HoldConditions(temperature=np.linspace(0, 30, 20), yaw=np.linspace(0, 3, 20))
    rows = position_rows(model, by, noise, directions, hold=hold)
    ideal = session(model, np.zeros(model.n_parameters), directions, hold=hold)
    problem = CalibrationProblem.of(model, by, ideal.observations(noise))
    of_session = problem.rows(problem.initial)[0].reshape(by.n_conditions, 20, -1).swapaxes(0, 1)
    np.testing.assert_allclose(rows, of_session, rtol=1e-12, atol=1e-12 * np.abs(rows).max())


# Criteria


def efficiency(task, name, scheme, bound):
    criterion = get_criterion(name, task)
    value = float(criterion.value(task.normal(get_scheme(scheme).directions)))
    return criterion.efficiency(value, bound)


@pytest.mark.parametrize("approach", ["gravity", "robot"])
def test_the_i_criterion_is_the_tilt_error_of_linear_theory(approach):
    task = Task(NINE, get_approach(approach), tilt_range=30 * GON)
    scheme = get_scheme("fibonacci-24")
    found = estimability(scheme, NINE, task.approach)
    zero, f_b = np.zeros(9), cap_forces(30 * GON, 200)
    rms = tilt_error(NINE, zero, NINE, zero, f_b).rms_of_all(found.cofactors)
    np.testing.assert_allclose(rms_tilt(task, scheme.directions), rms, rtol=1e-9)
    value = get_criterion("I", task).value(task.normal(scheme.directions))
    assert float(np.exp(value)) == pytest.approx(np.mean(rms**2), rel=1e-9)


@pytest.mark.parametrize("name", ["D", "A", "I", "minimax"])
def test_gradients(name):
    task = Task(NINE, GRAVITY)
    normal = task.normal(get_scheme("fibonacci-24").directions)
    criterion = get_criterion(name, task)
    turn = np.random.default_rng(1).standard_normal((2, *normal.shape))
    for change in turn + turn.swapaxes(1, 2):
        ahead, behind = (criterion.value(normal + h * change) for h in (1e-4, -1e-4))
        slope = np.sum(criterion.gradient(normal) * change)
        assert (ahead - behind) / 2e-4 == pytest.approx(slope, rel=1e-5, abs=1e-8)


# Known optima


def test_moments_of_the_sphere_are_d_optimal_for_the_norm_of_gravity():
    """The general equivalence theorem: d(x) ≤ p everywhere, with equality on the support."""
    task, criterion = asked(BY_GRAVITY, "D")
    anywhere = random_directions(500)
    for name in ("mclaren-24", "icosahedron-12", "dodecahedron-20"):
        directions = get_scheme(name).directions
        slope = -criterion.gradient(task.normal(directions))
        each = len(directions) * np.einsum("kuw,uw->k", task.informations(anywhere), slope)
        np.testing.assert_allclose(each, 9.0, rtol=1e-6)
    bound = continuous_optimum(task, criterion, Attitudes(), 24).bound
    assert efficiency(task, "D", "mclaren-24", bound) == pytest.approx(1, abs=2e-5)
    assert efficiency(task, "D", "faces-edges-18", bound) < 0.99


def test_nine_d_optimal_positions_are_the_extremal_points_of_degree_2():
    task, criterion = asked(BY_GRAVITY, "D")
    known = float(criterion.value(task.normal(get_scheme("d-optimal-9").directions)))
    search = Search(task, criterion)
    found = search.optimum(9, starts=6)
    assert search.value(found) == pytest.approx(known, abs=1e-5)
    assert search.efficiency(found) < 1
    values = [criterion.value(task.normal(random_directions(9, seed))) for seed in range(300)]
    assert min(values) > known


@pytest.mark.parametrize(("approach", "name"), [("gravity", "I"), ("robot", "D")])
def test_a_continuous_optimum_has_its_own_equivalence_theorem(approach, name):
    """No direction has a larger derivative than those that have a share, which are all equal."""
    task = Task(NINE, get_approach(approach), tilt_range=30 * GON)
    criterion = get_criterion(name, task)
    best = continuous_optimum(task, criterion, Attitudes(), 24)
    assert 0 <= best.value - best.bound < 5e-4
    normal = 24 * np.einsum("k,kuw->uw", best.shares, task.informations(best.directions))
    assert float(criterion.value(normal)) == pytest.approx(best.value, abs=1e-9)
    slope = -24 * criterion.gradient(normal)
    whole = 9 if name == "D" else 1  # of a logarithm of a homogeneous function, times its degree
    anywhere = np.einsum("kuw,uw->k", task.informations(random_directions(3000)), slope)
    assert anywhere.max() <= whole + 3e-4
    held = task.informations(best.directions[best.shares > 1e-3])
    np.testing.assert_allclose(np.einsum("kuw,uw->k", held, slope), whole, atol=5e-3)


def test_the_exchange_finds_the_best_of_all_choices():
    task = Task(get_model("bias-scale"), get_approach("robot"))
    points = random_directions(8, 5)
    for name in "DAI":
        criterion = get_criterion(name, task)
        choices = combinations_with_replacement(range(8), 3)
        best = min(float(criterion.value(task.normal(points[list(c)]))) for c in choices)
        search = Search(task, criterion, Attitudes("eight", points))
        assert search.value(search.optimum(3)) == pytest.approx(best, abs=1e-9)


@pytest.mark.parametrize("family", ["D", "I"])
def test_stored_designs_have_their_efficiency_and_bound(family):
    """The bound of n positions follows from that of one, as nothing is known before."""
    task = STORED
    criterion, stored = get_criterion(family, task), stored_designs()[family]
    of_one = continuous_optimum(task, criterion, Attitudes(), 1).bound
    parameters = 9 if family == "D" else 1
    for n, one in stored.items():
        assert one["bound"] == pytest.approx(of_one - parameters * np.log(n), abs=2e-5)
        directions = get_scheme(f"{family.lower()}-optimal-{n}").directions
        assert len(directions) == n
        value = float(criterion.value(task.normal(directions)))
        efficiency = criterion.efficiency(value, one["bound"])
        assert one["efficiency"] == pytest.approx(efficiency, abs=2e-5)
    for n in (10, 16):
        search = Search(task, criterion)
        known = search.value(stored[n]["directions"])
        assert search.value(search.optimum(n, starts=1)) > known - SEARCHED


# Constraints


@pytest.fixture(scope="module")
def free():
    """Twelve positions without a constraint."""
    return Search(*asked(BY_ROBOT, "I")).optimum(12, starts=2)


LEVEL = (-60 * GON, 60 * GON)


@pytest.mark.parametrize("allowed", [
    Attitudes("level", None, LEVEL, LEVEL, 50 * GON),
    Attitudes("level", None, LEVEL),
])  # fmt: skip
def test_constraints_are_kept_and_cost_efficiency(allowed, free):
    search = Search(*asked(BY_ROBOT, "I"), allowed)
    found = search.optimum(12, starts=1)
    assert search.value(free) < search.value(found) < search.value(free) + 0.2
    assert search.efficiency(found) > 0.9
    roll, pitch = angles_to(found).T
    if allowed.roll:
        assert 60 * GON - 1e-6 < np.abs(roll).max() < 60 * GON + 1e-6  # moved to the edge
    if allowed.pitch:
        assert np.abs(pitch).max() < 50 * GON + 1e-6


def test_attitudes_of_a_cube_of_a_hand_and_of_a_scheme(tmp_path):
    assert len(cube().points) == 26
    np.testing.assert_allclose(
        np.unique(np.degrees(angles_to(attitudes_by_eye(np.pi / 6).points)[:, 1]).round(6)),
        np.arange(-90, 91, 30),
        atol=1e-6,
    )
    path = tmp_path / "mine.yaml"
    path.write_text("directions: [[0, 0, 1], [0, 1, 0], [-1, 0, 1], [0, 0, 2]]\n", encoding="utf-8")
    listed = find_attitudes(str(path), ("all",))
    expected = [[0, 0], [0, np.pi / 4], [np.pi / 2, 0]]
    np.testing.assert_allclose(np.abs(sorted(angles_to(listed.points).tolist())), expected)
    assert len(find_attitudes("xsens-38", ("all",)).points) <= 38


# Telling two explanations apart


def test_positions_that_hardly_differ_are_one_that_is_repeated(free):
    task, criterion = asked(BY_ROBOT, "I")
    cosines = (free @ free.T)[np.triu_indices(12, 1)]
    same = cosines > 1 - 1e-8  # of rounded directions
    assert same.any()
    assert cosines[~same].max() < np.cos(1 * GON)

    # In a row, the first and the last are near each other by way of the second alone.
    apart, search = random_directions(12), Search(task, criterion)
    beside = np.cross(apart[0], apart[3])
    row = apart[0] + np.outer([0.0, 0.7 * GON, 1.4 * GON], beside / np.linalg.norm(beside))
    near = np.vstack([row / np.linalg.norm(row, axis=1, keepdims=True), apart[1:]])
    joined = search._join(near)
    np.testing.assert_array_equal(joined[0], joined[1])
    np.testing.assert_array_equal(joined[0], joined[2])
    assert search._join(apart) is apart


def test_what_is_equal_but_for_rounding_keeps_its_order():
    """So that another processor, which rounds another way, finds the same scheme."""
    rounding = np.array([2.0, -1.0, 0.0, 1.0]) * 1e-15
    assert first_best([3.0, *(1.0 + rounding), np.nan]) == 1
    assert stable_order([3.0, *(1.0 + rounding), 0.5]).tolist() == [5, 1, 2, 3, 4, 0]
