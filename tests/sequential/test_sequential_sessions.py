"""Sessions that choose their positions and stop when the promised accuracy is reached."""

from functools import partial

import numpy as np
import pytest
from scipy import stats
from usual import NINE

from accelstudy.approaches import get_approach
from accelstudy.basics.units import GON, MGON
from accelstudy.design.information import Information, position_rows
from accelstudy.leveling.error import error_in_use
from accelstudy.schemes import get_scheme
from accelstudy.sequential.choice import Chooser, Knowledge, candidate_positions, typical_sizes
from accelstudy.sequential.promise import LEAST_REDUNDANCY, LEVEL, Promise, bound
from accelstudy.simulation.sessions import Noise

# --- the choice of a position --------------------------------------------------------------------


def test_only_what_is_not_yet_accurate_enough_counts():
    promise = Promise(10.0, 30 * GON)
    error = error_in_use(NINE, max_tilt=30 * GON)
    roll, pitch = error.quadratic
    rms = np.array([[12.0, 9.0], [9.0, 12.0], [12.0, 12.0], [9.0, 9.0]])
    for weight, expected in zip(
        promise.weight(error, rms), (roll, pitch, (roll + pitch) / 2, (roll + pitch) / 2),
        strict=True,
    ):  # fmt: skip
        np.testing.assert_allclose(weight, expected, rtol=1e-12)
    assert promise.is_kept(rms).tolist() == [False, False, False, True]


def chooser(approach, scheme, directions=None, accuracy=10 * MGON):
    """Chooser of the attitudes of a scheme, and of further ones."""
    chosen = get_scheme(scheme).directions if directions is None else directions
    promise = Promise(accuracy, 30 * GON)
    rows = position_rows(NINE, get_approach(approach), Noise(), chosen)
    error = error_in_use(NINE, max_tilt=30 * GON)
    variance = partial(bound, sigma_dof=np.inf)
    return Chooser(chosen, rows, error, promise, variance, typical_sizes(NINE, 9))


def known(rows, determined):
    return Knowledge(Information.of(rows), 0.0 if determined else np.nan, len(rows) - 9)


def test_nine_positions_by_determinant_determine_nine_parameters():
    of_cube, chosen = chooser("gravity", "faces-edges-corners-26"), []
    for _ in range(9):
        rows = of_cube.rows[chosen].reshape(-1, 9)
        chosen.append(of_cube.choose(known(rows, False), np.full(2, np.inf), None))
    assert len({*chosen}) == 9
    design = of_cube.rows[chosen].reshape(-1, 9)
    assert np.linalg.cond(design / np.linalg.norm(design, axis=0)) < 20


def test_what_is_to_go_is_what_choosing_on_comes_to():
    of_cube = chooser("gravity", "faces-edges-corners-26", accuracy=12 * MGON)
    so_far, last = known(np.zeros((0, 9)), False), None
    to_go = of_cube.positions_to_go(so_far, 1.0, np.full(2, np.inf), None)
    rows, rms = np.zeros((0, 9)), np.full(2, np.inf)
    while rms.max() > 12 * MGON:
        chosen = of_cube.choose(so_far, rms, last)
        last, rows = of_cube.directions[chosen], np.concatenate([rows, of_cube.rows[chosen]])
        determined = np.linalg.matrix_rank(rows / np.array([1, 1, 1, *[9.8] * 6])) == 9
        so_far = known(rows, determined)
        if determined:
            rms = of_cube.error.rms_of_all(np.linalg.inv(rows.T @ rows))
    assert to_go == len(rows)


def test_attitudes_to_choose_from(tmp_path):
    assert len(candidate_positions("cube")) == 26
    np.testing.assert_allclose(
        candidate_positions("grid")[0], candidate_positions("cube")[0]
    )  # level comes first
    far = candidate_positions("grid", pole_distance=60 * GON)
    assert 0 < len(far) < len(candidate_positions("grid"))
    assert np.all(np.arccos(np.abs(far[:, 0])) >= 60 * GON - 1e-6)
    low = candidate_positions("grid", max_roll=50 * GON, max_pitch=50 * GON)
    assert np.all(low[:, 2] > 0.4)
    mine = tmp_path / "mine.yaml"
    mine.write_text("directions: [[0, 0, 1], [0, 1, 1]]", encoding="utf-8")
    assert len(candidate_positions(str(mine))) == 2


# --- the rule of stopping ------------------------------------------------------------------------


def test_bounds_of_the_variance():
    omega = stats.chi2(12).rvs(20_000, random_state=1)
    assert np.mean(bound(omega, 12) > 1) == pytest.approx(LEVEL, abs=4 * 0.0011)
    assert np.isinf(bound(omega[:2], LEAST_REDUNDANCY - 1)).all()
    assert np.isfinite(bound(omega[:2], LEAST_REDUNDANCY)).all()
    assert np.array_equal(bound(omega[:2], 12, np.inf), [1, 1])
    # The variance in units of a stated one that is an estimate.
    variance = 3 / stats.chi2(3).rvs(20_000, random_state=2)
    kept = [bound(v * o, 12, 3.0) > v for v, o in zip(variance, omega, strict=True)]
    assert np.mean(kept) == pytest.approx(LEVEL, abs=4 * 0.0011)
