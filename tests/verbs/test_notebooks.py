"""The notebooks of the site run, and find what they say."""

import matplotlib
import numpy as np
import pytest
from places import ROOT
from usual import compare_few

matplotlib.use("agg")
NOTEBOOKS = sorted((ROOT / "docs/notebooks").glob("*.py"))


@pytest.fixture(scope="module")
def ran(tmp_path_factory):
    """What the names of each notebook stand for after it has run."""
    found = {}
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path_factory.mktemp("notebooks"))
        compare_few(patch)
        for path in NOTEBOOKS:
            found[path.stem] = {}
            exec(compile(path.read_text(encoding="utf-8"), path, "exec"), found[path.stem])
            matplotlib.pyplot.close("all")
    return found


def test_a_first_calibration_finds_the_errors(ran):
    names = ran["first-calibration"]
    assert names["calibration"].state == "accepted"
    found = names["found"]
    assert (abs(found["value"] - names["truth"]) < 4 * found["sigma"]).all()
    assert {"roll_gon", "pitch_gon"} <= set(names["leveled"])


def test_what_is_missing_is_found(ran):
    names = ran["what-is-missing"]
    assert names["calibration"].state == "rejected"
    assert names["diagnosis"].explanations["explanation"].tolist() == ["thermal_bias"]
    assert names["mended"].state == "accepted"
    usual, mended = names["calibration"].parameters, names["mended"].parameters
    assert list(mended.index[len(usual) :]) == ["b_T_x", "b_T_y", "b_T_z"]
    off = abs(usual["value"] - mended["value"][usual.index]) / mended["sigma"][usual.index]
    assert off.median() > 5


def test_a_plan_keeps_what_it_promises(ran):
    names = ran["planning"]
    assert names["plan"].verdict.startswith("You need no robot.")
    surer, plan = (names[key].to_frame()["n_positions"].iloc[0] for key in ("surer", "plan"))
    assert surer > plan
    assert names["below"] == pytest.approx(0.95, abs=0.03)  # 4 standard errors of either simulation


def test_positions_and_a_robot_bring_what_the_study_says(ran):
    names = ran["own-study"]
    rms = names["rms"]
    root = np.sqrt(rms.index[0] / rms.index.to_numpy())
    assert np.allclose(rms.div(rms.iloc[0]), root[:, None], rtol=0.05)
    assert np.allclose((rms["gravity"] / rms["robot"]) ** 2, 4, rtol=0.1)
    assert float(names["in_errors"].max()) < 4
