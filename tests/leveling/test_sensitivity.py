"""Total effects: a published function, the closed forms of leveling, and the paper's shares."""

import numpy as np
import pytest
from scipy.stats import norm
from study_helpers import grid, make_study, run_study

from accelstudy.basics.units import GON
from accelstudy.leveling.sensitivity import FORCES, leveling_sensitivity, total_effects
from accelstudy.study.sensitivity import sensitivity_table

SETTINGS = {"base_samples": 1024, "seed": 1}
# Confidence intervals are of 95 %: 2.5 half widths are 4.9 standard deviations.
WIDTHS = 2.5


def ishigami(x):
    """Ishigami & Homma (1990) with a = 7, b = 0.1, of normal inputs made uniform on (−π, π)."""
    x1, x2, x3 = np.pi * (2 * norm.cdf(x.T) - 1)
    return (np.sin(x1) + 7 * np.sin(x2) ** 2 + 0.1 * x3**4 * np.sin(x1))[:, None]


ISHIGAMI = [0.5575889, 0.4424111, 0.2436837]


def test_ishigami():
    total, ci95, sd = total_effects(ishigami, [0, 0, 0], [1, 1, 1], 4096, 1)
    assert np.all(np.abs(total[0] - ISHIGAMI) < WIDTHS * ci95[0])
    np.testing.assert_allclose(total[0], ISHIGAMI, atol=0.02)
    assert np.all((ci95 > 1e-3) & (ci95 < 0.06))
    # Variance a²/8 + bπ⁴/5 + b²π⁸/18 + 1/2.
    variance = 49 / 8 + np.pi**4 / 50 + np.pi**8 / 1800 + 0.5
    assert sd[0] == pytest.approx(np.sqrt(variance), rel=0.01)


# --- leveling without parameters (figure 4) ------------------------------------------------------

ATTITUDES = [(0, 0), (50, 0), (-30, 20), (20, -50), (80, 60), (0, 50)]


@pytest.mark.parametrize(("roll", "pitch"), ATTITUDES)
def test_forces_alone(roll, pitch):
    """Roll: cos²φ, sin²φ. Pitch: cos²θ, sin²θ sin²φ, sin²θ cos²φ (linear limit)."""
    table = leveling_sensitivity([roll], [pitch], 0.002, **SETTINGS)
    phi, theta = roll * GON, pitch * GON
    expected = {
        "roll": [0, np.cos(phi) ** 2, np.sin(phi) ** 2],
        "pitch": [np.cos(theta) ** 2, (np.sin(theta) * np.sin(phi)) ** 2,
                  (np.sin(theta) * np.cos(phi)) ** 2],
    }  # fmt: skip
    for output, effects in expected.items():
        rows = table[table["output"] == output]
        assert rows["input"].tolist() == [*FORCES]
        assert rows["defined"].all()
        limit = WIDTHS * rows["ci95"].to_numpy() + 1e-6  # 1e-6: what is not linear
        assert np.all(np.abs(rows["total_effect"].to_numpy() - effects) <= limit)
    roll_rows = table[table["output"] == "roll"].set_index("input")
    assert roll_rows.loc["f_x", "total_effect"] == 0
    assert roll_rows.loc["f_x", "ci95"] == 0
    # σ/(g cos θ) and σ/g: 12.98 mgon at level, 18.36 mgon of roll at a pitch of 50 gon.
    sd = table.groupby("output")["sd_output_mgon"].first()
    assert sd["pitch"] == pytest.approx(12.98, rel=0.01)
    assert sd["roll"] == pytest.approx(12.98 / np.cos(theta), rel=0.01)


# --- with the parameters of a calibration (figures 5 and 6) --------------------------------------


def test_the_study_takes_the_sds_from_the_simulation(tmp_path):
    """The same shares, of the sds that a Monte Carlo of the calibration shows."""
    sensitivity = {"base_samples": 512, "roll_gon": [0], "pitch_gon": [0]}
    keys = {"grids": [grid(replicates=2000)], "sensitivity": sensitivity}
    summary = run_study(tmp_path, **keys)["summary"]
    table = sensitivity_table(make_study(**keys), summary).query("output == 'roll'")
    by_analysis = table.set_index("input").groupby("analysis")["total_effect"]
    tables = {str(name): its for name, its in by_analysis}
    assert [*tables] == ["forces", "gravity", "robot"]
    assert tables["forces"]["f_y"] == pytest.approx(1, abs=0.01)
    assert tables["gravity"]["f_y"] == pytest.approx(0.571, abs=0.03)
    assert tables["gravity"]["alpha_zx"] == pytest.approx(0.357, abs=0.03)
    # The robot determines α_zx more than twice as well.
    assert tables["robot"]["alpha_zx"] < 0.5 * tables["gravity"]["alpha_zx"]
