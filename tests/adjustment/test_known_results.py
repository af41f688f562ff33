"""Public data through the commands, against what is known of them.

Each log goes through `accelstudy import` and `accelstudy calibrate` as a user would call them. The
expected numbers are those of other authors and of a fit made without this package, as the README
of the data gives them; where our detector cuts the holds otherwise, the tolerance says so.
"""

import json
import math
import re
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
from calling import succeed
from places import DATA, needs_data

from accelstudy.basics.units import STANDARD_GRAVITY

pytestmark = needs_data

NINE = "bias-scale-nonorthogonality"
MG = 1e-3 * STANDARD_GRAVITY
SCALE, OFFSET = 0.0024, np.array([33123, 33275, 32364])
COUNTS = ("--unit", "counts", "--scale", SCALE, "--offset", ",".join(map(str, OFFSET)))
MPU_9150 = ("--columns", "fx=0,fy=1,fz=2", "--rate", 100, "--gravity", 9.81)
IMPORTS = {
    "xsens": ("imu_tk_xsens/xsens_acc.mat",
              *("--columns", "fx=1,fy=2,fz=3", "--time", 0, *COUNTS, "--gravity", 9.81744)),
    "xsens, white": ("imu_tk_xsens/derived_static_means.csv",
                     *("--means", *COUNTS, "--gravity", 9.81744)),
    **{f"mpu9150 {i}": (f"mpu9150/imu{i}.log", *MPU_9150) for i in range(3)},
    "ctu 24": ("ctu_innalabs/CalibrationOfLowCostTriaxialInertialSensors.mat",
               *("--means", "--unit", "g")),
    "ctu 49": ("ctu_innalabs/CalibrationOfLowCostTriaxialInertialSensors50.mat",
               *("--means", "--unit", "g")),
    "ferraris": ("ferraris/example_ferraris_session.csv",
                 *("--columns", "fx=acc_x,fy=acc_y,fz=acc_z", "--rate", 204.8, "--gravity", 9.81)),
}  # fmt: skip


@pytest.fixture(scope="module")
def campaign(tmp_path_factory):
    """What the import said, and the folder that it wrote; each log is imported once."""
    folder = tmp_path_factory.mktemp("known")

    @cache
    def imported(name):
        file, *options = IMPORTS[name]
        out = folder / name
        return succeed("import", DATA / file, "--out", out, "--no-figure", *options).output, out

    return imported


def calibrated(folder, out, model):
    """The content of calibration.json."""
    succeed("calibrate", folder, "--model", model, "--out", out)
    return json.loads((out / "calibration.json").read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def known(campaign):
    """Import and calibrate, each once for a log and a model; what is looked at most has a name."""

    @cache
    def outcome(name, model=NINE):
        said, folder = campaign(name)
        content = calibrated(folder, folder.with_name(f"{name}, {model}"), model)
        return SimpleNamespace(
            imported=said, content=content, test=content["quality"]["global_test"],
            verdict=content["quality"]["verdict"], rms=content["rms_norm_residual_mps2"],
            sigma0=content["sigma_position_posteriori_mps2"],
        )  # fmt: skip

    return outcome


def affine(outcome, gauge):
    """K turned from the left into a triangle, which has the same KᵀK, and the bias in m/s²."""
    found = outcome.content["affine"]
    k = np.array(found["matrix"])
    order = slice(None) if gauge == "upper" else slice(None, None, -1)
    turned = np.linalg.cholesky((k.T @ k)[order, order]).T[order, order]
    return turned, np.array(found["bias_mps2"])


# --- Xsens MTi: the noise is coloured ------------------------------------------------------------


def test_xsens_refutes_white_noise_and_agrees_with_the_allan_deviation(known):
    white, coloured = known("xsens, white"), known("xsens")
    assert white.content["n_positions"] == 38
    assert not white.test["accepted"]
    assert white.test["p_value"] < 1e-6
    assert "understated" in white.verdict
    assert white.content["sigma_source"] == "a posteriori"
    assert coloured.test["accepted"]
    assert coloured.content["sigma_source"] == "a priori"
    # The Allan deviation is flat at 0.5 to 1.5 mm/s² from 1 to 5 s.
    assert 0.5e-3 < coloured.content["sigma_position_mps2"] < 1.5e-3
    expected = re.search(r"([0-9.]+) mm/s² if the noise were white", coloured.imported)
    assert float(expected[1]) == pytest.approx(0.29, abs=0.01)


def test_xsens_residuals(known):
    """The means of the README are cut at another threshold; 0.02 to 0.06 m/s² move it by 0.02."""
    assert known("xsens, white").rms == pytest.approx(1.02e-3, abs=0.005e-3)
    assert known("xsens, white").sigma0 == pytest.approx(1.16e-3, abs=0.01e-3)
    assert 38 <= known("xsens").content["n_positions"] <= 42
    assert known("xsens").rms == pytest.approx(1.02e-3, abs=0.025e-3)
    assert known("xsens").sigma0 == pytest.approx(1.16e-3, abs=0.03e-3)


def test_xsens_parameters_are_those_of_imu_tk(known):
    """Within the spread over the detector's threshold: 0.03 counts per m/s² and 0.0005 rad."""
    k, bias = affine(known("xsens"), "upper")
    inverse_scale = 1 / (np.diag(k) * SCALE)
    np.testing.assert_allclose(inverse_scale, [414.4143, 412.0467, 414.6139], rtol=0, atol=0.03)
    # Of the offsets no spread is given; 0.1 counts are 0.24 mm/s², a third of their sigma.
    offset = bias / SCALE + OFFSET
    np.testing.assert_allclose(offset, [33123.885, 33275.159, 32364.571], rtol=0, atol=0.1)
    t = k / np.diag(k)
    angles = [-t[0, 1], t[0, 2], -t[1, 2]]
    np.testing.assert_allclose(angles, [0.003413, -0.009415, 0.021277], rtol=0, atol=5e-4)


# --- MPU-9150: the null case; its authors' numbers are in docs/guides/comparison.md ---------------


@pytest.mark.parametrize("i", range(3))
def test_mpu9150_lacks_nothing(known, i):
    outcome = known(f"mpu9150 {i}")
    assert outcome.content["n_positions"] == 23
    assert outcome.test["accepted"]
    assert outcome.content["quality"]["suspects"] == []
    assert "The residuals agree with the stated noise" in outcome.verdict
    # White noise lets expect 2.0 to 3.3 mm/s².
    assert 2.0e-3 < outcome.content["sigma_position_mps2"] < 3.3e-3
    # As holds are noisy and short, thresholds of 0.12 to 0.35 m/s² move the rms by up to a fifth,
    # which is what an rms with r = 14 is worth: 1/√28.
    assert outcome.rms == pytest.approx(2.1e-3, rel=1 / math.sqrt(28))
    assert outcome.sigma0 == pytest.approx(2.7e-3, rel=1 / math.sqrt(28))


# --- Innalabs AHRS M3: means in units of g -------------------------------------------------------


@pytest.mark.parametrize(
    ("n", "rms", "sigma0"), [(24, 0.4256, 0.538), (49, 0.8356, 0.925)], ids=["24", "49"]
)
def test_ctu_residuals(known, n, rms, sigma0):
    """The README gives all norms the same weight, and the adjustment each its own.

    They differ by up to 7 %, as the axes are 3° from orthogonal. So the README's rms is the least
    there is and ours a little more, and σ̂0 differs by less than 0.5 %.
    """
    outcome = known(f"ctu {n}")
    assert f"\n{n} positions; sigma of a mean: unknown" in outcome.imported
    assert rms - 0.00005 < outcome.rms / MG < rms + 0.0002
    assert outcome.sigma0 / MG == pytest.approx(sigma0, rel=0.005)
    assert outcome.test is None
    assert "is not stated, so nothing says whether the model is complete" in outcome.verdict


def test_ctu_parameters(known):
    """Lower-triangular T S (f − b); the weights move them by 0.03 sigma at most."""
    k, bias = affine(known("ctu 24"), "lower")
    scale = np.diag(k)
    t = k / scale
    np.testing.assert_allclose(
        [t[1, 0], t[2, 0], t[2, 1]], [-0.0155999, 0.0530982, 0.0033578], rtol=0, atol=2e-5
    )
    np.testing.assert_allclose(scale, [1.006356, 0.9969344, 0.9936887], rtol=0, atol=5e-6)
    offset = [0.0008532, -0.0051819, 0.0135543]
    np.testing.assert_allclose(bias / STANDARD_GRAVITY, offset, rtol=0, atol=4e-6)


# --- Data that tell less -------------------------------------------------------------------------


def test_ferraris_rests_between_its_turns_too(known):
    outcome = known("ferraris", "bias-scale")
    assert "holds: 9" in outcome.imported
    assert outcome.content["redundancy"] == 3
    # Six parameters leave out that the axes of a sensor are not orthogonal: the residuals are four
    # times the noise of a short log, which is too poorly known to refute them.
    content, quality = outcome.content, outcome.content["quality"]
    assert 0.01 < outcome.test["p_value"] < 0.05
    assert quality["state"] == "cannot tell"
    assert "known with 4 degrees of freedom only" in outcome.verdict
    # What is quoted is pooled: (ν + Ω) / (ν + r), and Student's t of ν + r.
    assert content["sigma_dof"] == 7
    ratio = content["sigma_position_mps2"] / content["sigma_position_priori_mps2"]
    assert ratio == pytest.approx(math.sqrt((4 + outcome.test["statistic"]) / 7), rel=1e-9)
    assert content["sigmas_95"] == pytest.approx(2.365, abs=5e-4)  # of a table of Student's t
