"""Sessions that choose their positions and stop when the promised accuracy is reached."""

import matplotlib.figure
import numpy as np
import pandas as pd
import pytest
from scipy import stats

from accelstudy.approaches import get_approach
from accelstudy.basics.errors import InputError, UnknownNameError
from accelstudy.basics.units import GON, MGON
from accelstudy.design.task import position_rows
from accelstudy.schemes import get_scheme
from accelstudy.sensors.models import get_model
from accelstudy.sequential.choice import (
    apart_from,
    best,
    candidates,
    gain_of_leveling,
    gain_of_parameters,
    typical_sizes,
)
from accelstudy.sequential.config import SequentialConfig
from accelstudy.sequential.figure import sequential_figure
from accelstudy.sequential.promise import (
    LEAST_REDUNDANCY,
    LEVEL,
    Promise,
    bound,
    get_rule,
    plain,
    rms_of,
)
from accelstudy.sequential.simulation import SetUp, sessions_table, simulate, summary_table
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
    by_leveling = gain_of_leveling(so_far[None], weight, rows)[0]
    sizes = typical_sizes(NINE, 9)
    information = so_far + np.diag(sizes**-2)
    by_parameters = gain_of_parameters(so_far[None], sizes, rows)[0]
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
        gain = gain_of_parameters(so_far, typical_sizes(NINE, 9), rows)
        chosen.append(int(best(gain)[0]))
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
    assert np.mean(plain(omega, 12)) == pytest.approx(1, abs=0.02)
    assert np.isinf(bound(omega[:2], LEAST_REDUNDANCY - 1)).all()
    assert np.isfinite(bound(omega[:2], LEAST_REDUNDANCY)).all()
    assert np.isinf(plain(omega[:2], 0)).all()
    with pytest.raises(UnknownNameError, match="rule 'bounds'; did you mean 'bound'"):
        get_rule("bounds")


# --- sessions ------------------------------------------------------------------------------------

CONFIG = SequentialConfig(sessions=250, accuracies=[1.0], approaches=["gravity", "robot"])


@pytest.fixture(scope="module")
def sessions():
    return {approach: sessions_table(CONFIG, approach, 1) for approach in CONFIG.approaches}


@pytest.fixture(scope="module")
def summary(sessions):
    return summary_table(CONFIG, pd.concat(sessions.values())).set_index(["approach", "rule"])


def test_with_known_noise_the_promise_is_kept_with_fewer_positions(summary):
    for approach, most in (("gravity", 21), ("robot", 14)):
        row = summary.loc[approach, "known"]
        assert row["kept"] == 1
        assert row["broken"] == 0
        assert row["positions_95"] <= most
        assert row["fixed_positions"] == 24
        assert row["saved_seconds"] == pytest.approx(60 * (24 - row["positions"]))
        for angle in ("roll", "pitch"):  # over sessions and attitudes
            assert row[f"rms_{angle}_low"] < 1
        for what in ("parameters", "angles"):
            assert row[f"{what}_inside_low"] - 0.01 < 0.95 < row[f"{what}_inside_high"] + 0.01


def test_with_unknown_noise_only_the_bound_keeps_the_promise(summary):
    for approach in CONFIG.approaches:
        kept, naive = summary.loc[approach, "bound"], summary.loc[approach, "plain"]
        assert kept["broken_low"] < 0.05
        assert max(kept["rms_roll_high"], kept["rms_pitch_high"]) < 1
        assert naive["broken_low"] > 0.4
        assert naive["variance"] < kept["variance"] < 1.02
        assert naive["positions"] < summary.loc[approach, "known"]["positions"]


def test_stopping_does_not_bias_what_the_noise_is_not_part_of(sessions):
    """The estimate at the end is as accurate as its covariance with the true noise says."""
    for table in sessions.values():
        for _, part in table.groupby("rule"):
            for angle in ("roll", "pitch"):
                ratio = (part[f"actual_{angle}"] / part[f"true_{angle}"]) ** 2
                assert ratio.mean() == pytest.approx(1, abs=4 * ratio.std() / np.sqrt(len(part)))


def test_sessions_depend_on_the_seed_and_on_nothing_else(sessions):
    set_up = SetUp(CONFIG, "robot", "known", 1.0)
    few = SetUp(CONFIG.model_copy(update={"rules": ["known"]}), "robot", "known", 1.0)
    again, other = simulate(few, 1), simulate(set_up, 2)
    first = sessions["robot"].query("rule == 'known'")
    pd.testing.assert_frame_equal(again, first[again.columns].reset_index(drop=True))
    assert not np.array_equal(again["omega"], other["omega"])


def test_a_session_that_does_not_get_there_ends_and_says_so():
    config = SequentialConfig(sessions=5, accuracies=[0.5], most_positions=12)
    table = simulate(SetUp(config, "gravity", "known", 0.5), 1)
    assert not table["kept"].any()
    assert (table["positions"] == 12).all()


def test_the_figure_shows_all_set_ups(summary):
    figure = sequential_figure(summary.reset_index(), CONFIG.instead_of)
    assert isinstance(figure, matplotlib.figure.Figure)
    left, right = figure.axes
    assert len(left.lines) == 3 * 2 + 2  # and the fixed scheme for each approach
    assert len(right.containers) == 3 * 2


def test_rms_of_many_is_that_of_each():
    error = Promise(1.0, 30 * GON).tilt_error(NINE)
    cofactors = np.stack([np.eye(9) * 1e-8, np.eye(9) * 2e-8])
    both = rms_of(error, cofactors, np.array([1.0, 3.0]))
    np.testing.assert_allclose(both[1], error.rms_of_all(6e-8 * np.eye(9)), rtol=1e-12)
