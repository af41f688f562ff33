"""Sessions that choose their positions and stop when the promised accuracy is reached."""

import numpy as np
import pytest
from scipy import stats

from accelstudy.approaches import get_approach
from accelstudy.basics.errors import InputError, UnknownNameError
from accelstudy.basics.units import GON, MGON
from accelstudy.design.information import position_rows
from accelstudy.schemes import get_scheme
from accelstudy.sensors.models import get_model
from accelstudy.sequential.choice import (
    apart_from,
    best,
    candidates,
    gains,
    typical_sizes,
)
from accelstudy.sequential.promise import (
    LEAST_REDUNDANCY,
    LEVEL,
    Promise,
    bound,
    rms_of,
)
from accelstudy.simulation.sessions import Noise

NINE = get_model("bias-scale-nonorthogonality")


def rows_of(approach, scheme):
    directions = get_scheme(scheme).directions
    return position_rows(NINE, get_approach(approach), Noise(), directions)


# --- the choice of a position --------------------------------------------------------------------


@pytest.mark.parametrize("approach", ["gravity", "robot"])
def test_the_gain_is_what_the_position_brings(approach):
    measured = rows_of(approach, "fibonacci-12").reshape(-1, 9)
    rows = rows_of(approach, "faces-edges-18")
    promise = Promise(10 * MGON, 30 * GON)
    error = promise.tilt_error(NINE)
    weight = promise.weight(error, np.full((1, 2), 20 * MGON))
    so_far = measured.T @ measured
    before = np.linalg.inv(so_far)
    by_leveling = gains(before[None], rows, weight)[0]
    sizes = typical_sizes(NINE, 9)
    information = so_far + np.diag(sizes**-2)
    by_parameters = gains(np.linalg.inv(information)[None], rows)[0]
    for row, leveling, parameters in zip(rows, by_leveling, by_parameters, strict=True):
        after = np.linalg.inv(so_far + row.T @ row)
        fall = np.mean(error.rms_of_all(before) ** 2 - error.rms_of_all(after) ** 2)
        assert leveling == pytest.approx(fall, rel=1e-6)
        grown = np.linalg.slogdet(information + row.T @ row)[1] - np.linalg.slogdet(information)[1]
        assert parameters == pytest.approx(grown, rel=1e-6)


def test_only_what_is_not_yet_accurate_enough_counts():
    promise = Promise(10.0, 30 * GON)
    error = promise.tilt_error(NINE)
    roll, pitch = error.quadratic
    rms = np.array([[12.0, 9.0], [9.0, 12.0], [12.0, 12.0], [9.0, 9.0]])
    for weight, expected in zip(
        promise.weight(error, rms), (roll, pitch, (roll + pitch) / 2, (roll + pitch) / 2),
        strict=True,
    ):  # fmt: skip
        np.testing.assert_allclose(weight, expected, rtol=1e-12)
    assert promise.reached(rms).tolist() == [False, False, False, True]


def test_of_positions_that_are_as_good_the_first_is_chosen():
    assert best(np.array([[1.0, 2.0, 2.0], [5.0, 4.96, 1.0], [4.9, 4.9, 5.0]])).tolist() == [
        1,
        0,
        2,
    ]


def test_nine_positions_by_determinant_determine_nine_parameters():
    rows, so_far, chosen = rows_of("gravity", "faces-edges-corners-26"), np.zeros((1, 9, 9)), []
    for _ in range(9):
        information = so_far + np.diag(typical_sizes(NINE, 9) ** -2.0)
        chosen.append(int(best(gains(np.linalg.inv(information), rows))[0]))
        so_far = so_far + rows[chosen[-1]].T @ rows[chosen[-1]]
    assert len({*chosen}) == 9
    design = rows[chosen].reshape(-1, 9)
    assert np.linalg.cond(design / np.linalg.norm(design, axis=0)) < 20


def test_attitudes_to_choose_from(tmp_path):
    assert len(candidates("cube")) == 26
    np.testing.assert_allclose(candidates("grid")[0], candidates("cube")[0])  # level comes first
    far = candidates("grid", pole_distance=60 * GON)
    assert 0 < len(far) < len(candidates("grid"))
    assert np.all(np.arccos(np.abs(far[:, 0])) >= 60 * GON - 1e-6)
    low = candidates("grid", max_roll=50 * GON, max_pitch=50 * GON)
    assert np.all(low[:, 2] > 0.4)
    (tmp_path / "mine.csv").write_text("roll_gon,pitch_gon\n0,0\n50,0\n", encoding="utf-8")
    assert len(candidates(str(tmp_path / "mine.csv"))) == 2
    with pytest.raises(UnknownNameError, match="set of attitudes 'cubes'; did you mean 'cube'"):
        candidates("cubes")
    (tmp_path / "mine.csv").write_text("roll_gon,pitch_gon\n50,0\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"none of .*mine\.csv is within"):
        candidates(str(tmp_path / "mine.csv"), max_roll=20 * GON)
    free = apart_from(candidates("cube"), candidates("cube")[[3]])
    assert np.flatnonzero(~free[0]).tolist() == [3]


# --- the rule of stopping ------------------------------------------------------------------------


def test_bounds_of_the_variance():
    omega = stats.chi2(12).rvs(20_000, random_state=1)
    assert np.mean(bound(omega, 12) > 1) == pytest.approx(LEVEL, abs=4 * 0.0011)
    assert np.isinf(bound(omega[:2], LEAST_REDUNDANCY - 1)).all()
    assert np.isfinite(bound(omega[:2], LEAST_REDUNDANCY)).all()


def test_rms_of_many_is_that_of_each():
    error = Promise(1.0, 30 * GON).tilt_error(NINE)
    cofactors = np.stack([np.eye(9) * 1e-8, np.eye(9) * 2e-8])
    both = rms_of(error, cofactors, np.array([1.0, 3.0]))
    np.testing.assert_allclose(both[1], error.rms_of_all(6e-8 * np.eye(9)), rtol=1e-12)
