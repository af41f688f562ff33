"""The studies of positions: sessions that stop when a promise seems kept, and efficient schemes."""

from itertools import product

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from accelstudy.schemes import get_scheme
from studies.positions import efficiency
from studies.positions.efficiency import efficiency_figure, efficiency_table
from studies.positions.stopping import RULES, plain, simulate, summary_table

SETTINGS = [*product(("gravity", "robot"), RULES, (1.0,), (0,), (150,))]


@pytest.fixture(scope="module")
def sessions():
    return pd.concat([simulate(*each) for each in SETTINGS], ignore_index=True)


@pytest.fixture(scope="module")
def summary(sessions):
    return summary_table(sessions).set_index(["approach", "rule"])


def test_with_known_noise_the_promise_is_kept_with_fewer_positions(summary):
    for approach, most in (("gravity", 21), ("robot", 14)):
        row = summary.loc[approach, "known"]
        assert row["kept"] == 1
        assert row["broken"] == 0
        assert row["positions_95"] <= most
        for angle in ("roll", "pitch"):  # over sessions and attitudes
            assert row[f"rms_{angle}"] < 1.05
        for what in ("parameters", "angles"):
            assert row[f"{what}_inside"] == pytest.approx(0.95, abs=0.03)


def test_with_unknown_noise_only_the_bound_keeps_the_promise(summary):
    for approach in ("gravity", "robot"):
        kept, naive = summary.loc[approach, "bound"], summary.loc[approach, "plain"]
        assert kept["broken_low"] < 0.05
        assert max(kept["rms_roll"], kept["rms_pitch"]) < 0.95
        assert naive["broken_low"] > 0.4
        assert naive["rms_roll"] > 1.05
        assert naive["positions"] < summary.loc[approach, "known"]["positions"]


def test_stopping_does_not_bias_what_the_noise_is_not_part_of(sessions):
    """The estimate at the end is as accurate as its covariance with the true noise says."""
    for _, part in sessions.groupby(["approach", "rule"]):
        for angle in ("roll", "pitch"):
            ratio = (part[f"actual_{angle}"] / part[f"true_{angle}"]) ** 2
            assert ratio.mean() == pytest.approx(1, abs=4 * ratio.std() / np.sqrt(len(part)))


def test_a_session_that_does_not_get_there_ends_and_says_so():
    table = simulate("gravity", "known", 0.5, 0, 5, most_positions=12)
    assert not table["kept"].any()
    assert (table["positions"] == 12).all()


def test_what_the_residuals_seem_to_say_is_right_on_average():
    omega = stats.chi2(12).rvs(20_000, random_state=1)
    assert np.mean(plain(omega, 12)) == pytest.approx(1, abs=0.02)
    assert np.isinf(plain(omega[:2], 0)).all()


def test_efficiencies_of_schemes_as_a_table_and_a_figure():
    schemes = [get_scheme(name) for name in ("faces-6", "mclaren-24")]
    table = efficiency_table(efficiency.TASKS[:1], schemes, [16])
    by = table.set_index("scheme")
    assert by.loc["24 McLaren", "D"] == pytest.approx(1, abs=1e-4)
    assert by.loc["24 McLaren", "I"] == pytest.approx(0.676, abs=2e-3)
    assert by.loc["16 I-optimal", "I"] > 0.97
    assert np.isnan(by.loc["6 faces", "A"])
    assert by.loc["6 faces", "reason"].startswith("rank 6 of 9")
    rows = table[table["reason"] == ""]
    np.testing.assert_allclose(rows["rms"] ** 2 * rows["I"], rows["least_rms"] ** 2, rtol=1e-6)
    figure = efficiency_figure(table)
    above, below = figure.axes
    assert above.get_title() == "gravity: share of the best there can be"
    assert [text.get_text() for text in above.get_yticklabels()][-1] == "16 I-optimal"
    assert below.get_xlabel() == "positions"
