"""Summary tables: statistics against closed forms and published numbers, and what is flagged.

Limits of single statistics are 4.5 standard errors.
"""

import numpy as np
import pytest
from scipy.special import gammaln
from scipy.stats import binom
from study_helpers import NINE, grid, run_study
from usual import STANDARD_ERRORS

from accelstudy.study.estimate import Estimates
from accelstudy.study.tables import coverage_columns

REPLICATES = 1000
SCHEMES = ["mclaren-24", "rings-24", "faces-edges-18", "rhombicuboctahedron-24", "faces-6"]
MCLAREN = f"{NINE}/mclaren-24"


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    return run_study(
        tmp_path_factory.mktemp("summary"),
        grids=[
            grid(["bias-scale", NINE], SCHEMES, REPLICATES),
            grid(NINE, "mclaren-24", REPLICATES, robot_sigma_mgon=0, approaches="robot"),
        ],
        leveling={"attitudes": 20},
    )


@pytest.fixture(scope="module")
def summary(study):
    table = study["summary"]
    return table[table["n_converged"] > 0]


def of(table, cell):
    return table[table["cell"] == cell].set_index("parameter")


def mean_of_chi(r):
    """Mean of √(χ²_r / r), by which sigma a posteriori is on average too small."""
    return np.sqrt(2 / r) * np.exp(gammaln((r + 1) / 2) - gammaln(r / 2))


# --- accuracy ------------------------------------------------------------------------------------


def test_sds_are_those_of_linear_theory(summary):
    """Of the replicates alone, and to a millionth with linear theory as control variate."""
    limit = STANDARD_ERRORS / np.sqrt(2 * (REPLICATES - 1))
    assert (summary["sd_plain"] / summary["sd_linear"] - 1).abs().max() < limit
    deviation = summary["sd_empirical"] / summary["sd_linear"] - 1
    assert deviation.abs().max() < 1e-4
    assert (summary["sd_se"] / summary["sd_empirical"]).max() < 1e-4
    assert summary["sd_gain"].min() > 1e4
    np.testing.assert_allclose(summary["sd_priori_mean"], summary["sd_linear"], rtol=1e-4)


def test_estimates_are_unbiased(summary):
    """Up to terms of second order in the noise, which plain averages cannot show."""
    error = summary["sd_plain"] / np.sqrt(REPLICATES)
    assert (summary["bias_plain"].abs() / error).max() < STANDARD_ERRORS
    assert (summary["bias"].abs() / summary["sd_empirical"]).max() < 1e-3
    low, high = summary["bias_ci95_low"], summary["bias_ci95_high"]
    np.testing.assert_allclose(high - low, 2 * 1.96 * summary["bias_se"], rtol=2e-3)
    np.testing.assert_allclose((high + low) / 2, summary["bias"], atol=1e-12)


def assert_share_of_intervals(holds):
    """About 95 % of the intervals hold the true value."""
    assert len(holds) > 100
    assert holds.sum() >= binom.ppf(1e-4, len(holds), 0.95)


def test_coverage_of_the_confidence_intervals(summary):
    known = summary[summary["coverage_95"].notna()]
    assert_share_of_intervals(
        (known["coverage_95_low"] <= 0.95) & (known["coverage_95_high"] >= 0.95)
    )
    single = np.sqrt(0.05 * 0.95 / REPLICATES)
    assert (known["coverage_95"] - 0.95).abs().max() < STANDARD_ERRORS * single
    # Parameters of a cell share σ̂0, so that the cells alone count as independent.
    cells = known["cell"].nunique()
    assert abs(known["coverage_95"].mean() - 0.95) < STANDARD_ERRORS * single / np.sqrt(cells)


def coverage(n, value, error, gain, plain):
    """The row of an estimated coverage by n calibrations."""
    inside = Estimates(*(np.array([x]) for x in (value, error, gain, plain)))
    return {name: column[0] for name, column in coverage_columns(inside, n).items()}


def test_wilson_interval_of_the_coverage():
    """Of plain averages."""
    p, n, z = 0.93, 500, 1.959964
    row = coverage(n, value=p, error=1e-2, gain=1.0, plain=p)
    centre = (p + z**2 / (2 * n)) / (1 + z**2 / n)
    half = z / (1 + z**2 / n) * np.sqrt(p * (1 - p) / n + z**2 / (4 * n**2))
    assert row["coverage_95"] == p
    assert row["coverage_95_low"] == pytest.approx(centre - half, rel=1e-6)
    assert row["coverage_95_high"] == pytest.approx(centre + half, rel=1e-6)


def test_a_coverage_that_rounds_to_more_than_one():
    """A mean of ones is made of differences; where linear theory tells the share, it stays that."""
    every = np.nextafter(1, 2)
    row = coverage(30, value=every, error=0.0, gain=1.0, plain=every)
    assert (row["coverage_95"], row["coverage_95_high"], row["coverage_95_se"]) == (1, 1, 0)
    row = coverage(30, value=0.95, error=1e-4, gain=9.0, plain=every)
    assert row["coverage_95"] == 0.95
    assert row["coverage_95_se"] == pytest.approx(1 / 30, rel=1e-3)


def test_ratio_of_sigma_a_posteriori_to_the_empirical_one(study, summary):
    redundancy = summary["cell"].map(study["cells"].set_index("cell")["redundancy"])
    known = summary[redundancy > 0]
    expected = mean_of_chi(redundancy[redundancy > 0].to_numpy(dtype=float))
    assert mean_of_chi(15.0) == pytest.approx(0.98348, abs=1e-5)
    inside = (known["sd_ratio_ci95_low"] <= expected) & (known["sd_ratio_ci95_high"] >= expected)
    assert_share_of_intervals(inside)
    deviation = known["sd_ratio"] / expected - 1
    assert deviation.abs().max() < STANDARD_ERRORS * np.sqrt(
        1 / (2 * (REPLICATES - 1)) + 1 / (2 * 12 * REPLICATES)
    )


# --- cells ---------------------------------------------------------------------------------------


def test_without_redundancy_there_is_no_sigma_a_posteriori(summary):
    rows = of(summary, "bias-scale/faces-6/gravity")
    undefined = ["sd_posteriori_mean", "sd_ratio", "coverage_95", "coverage_95_low"]
    assert rows[undefined].isna().all().all()
    assert rows["n_converged"].tolist() == 6 * [REPLICATES]
    # Two positions an axis: b = (f₊ + f₋)/2, s = (f₊ − f₋)/2g.
    sigma = [2 / np.sqrt(2)] * 3 + [0.002 / 9.80665 / np.sqrt(2) * 1e6] * 3
    np.testing.assert_allclose(rows["sd_priori_mean"], sigma, rtol=2e-3)


def test_a_cell_that_is_not_estimable_is_reported_with_the_reason(study):
    name = f"{NINE}/faces-6/gravity"
    cell = study["cells"].set_index("cell").loc[name]
    assert not cell["estimable"]
    assert cell["not_estimable"] == "alpha_yz, alpha_zy, alpha_zx"
    assert cell["reason"].startswith("rank 6 of 9: alpha_yz, alpha_zy, alpha_zx cannot be told")
    assert (cell["n_replicates"], cell["n_converged"]) == (0, 0)
    rows = of(study["summary"], name)
    assert [*rows.index[~rows["estimable"]]] == ["alpha_yz", "alpha_zy", "alpha_zx"]
    assert set(rows["reason"]) == {cell["reason"]}
    assert rows.filter(regex="^(bias|sd|coverage)").isna().all().all()
    for table in ("leveling", "correlations", "estimates"):
        assert name not in set(study[table]["cell"])


def test_one_replicate_has_no_spread(tmp_path):
    rows = run_study(tmp_path, grids=[grid(replicates=1)])["summary"]
    assert rows[["sd_empirical", "sd_ratio", "bias_ci95_low"]].isna().all().all()
    assert rows[["bias", "sd_posteriori_mean", "coverage_95"]].notna().all().all()


# --- correlations --------------------------------------------------------------------------------


def test_empirical_correlations_are_those_of_the_adjustment(study):
    table = study["correlations"]
    limit = STANDARD_ERRORS / np.sqrt(REPLICATES)
    assert (table["empirical_plain"] - table["adjustment"]).abs().max() < limit
    assert (table["empirical"] - table["adjustment"]).abs().max() < 1e-3
    assert table["empirical_se"].max() < 1e-4


# --- what did not converge -----------------------------------------------------------------------


def test_no_replicate_converges(tmp_path):
    tables = run_study(
        tmp_path, grids=[grid(sensor_sigma_mps2=1e3, approaches="gravity", replicates=20)]
    )
    cell = tables["cells"].iloc[0]
    assert cell["estimable"]
    assert (cell["n_replicates"], cell["n_converged"]) == (20, 0)
    numbers = ["bias", "sd_empirical", "sd_posteriori_mean", "sd_priori_mean", "coverage_95"]
    assert tables["summary"][numbers].isna().all().all()
    assert tables["leveling"].filter(like="_mgon").filter(like="rms").isna().all().all()
    assert tables["correlations"][["adjustment", "empirical"]].isna().all().all()


# --- the tilt ------------------------------------------------------------------------------------


def test_tilt_of_a_calibrated_sensor(study, tmp_path):
    """At level σ_φ² = (σ_b/g)² + σ_α²: 11.24 mgon, and as much in pitch."""
    grids = [grid(replicates=3000, approaches="gravity")]
    near = {"max_tilt_gon": 0.01, "attitudes": 3}
    level = run_study(tmp_path, grids=grids, leveling=near)["leveling"].iloc[0]
    expected = np.hypot(0.70711e-3 / 9.80665 / np.pi * 200e3, 10.264)
    assert expected == pytest.approx(11.24, abs=0.005)
    for angle in ("roll", "pitch"):
        limit = STANDARD_ERRORS / np.sqrt(2 * 3000)
        assert level[f"{angle}_rms_mgon"] == pytest.approx(expected, rel=limit)
        # One normal error: 95 % of the calibrations stay below 1.96 σ.
        q95 = level[f"{angle}_rms_q95_mgon"] / expected
        density = 2 * np.exp(-(1.96**2) / 2) / np.sqrt(2 * np.pi)
        assert abs(q95 - 1.96) < STANDARD_ERRORS * np.sqrt(0.95 * 0.05 / 3000) / density

    # Two independent angles: both stay below z σ in 95 % with Φ(z) = (1 + √0.95) / 2.
    both = level["both_rms_q95_mgon"] / expected
    density = 4 * np.sqrt(0.95) * np.exp(-(2.2365**2) / 2) / np.sqrt(2 * np.pi)
    assert abs(both - 2.2365) < STANDARD_ERRORS * np.sqrt(0.95 * 0.05 / 3000) / density
    table = study["leveling"].set_index("cell")
    gravity, robot = (table.loc[f"{MCLAREN}/{name}"] for name in ("gravity", "robot"))
    assert (robot.filter(like="_mgon")[1:] < gravity.filter(like="_mgon")[1:]).all()
