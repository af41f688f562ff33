"""Calibrations of logs in other axes and near the pole, and of what can be no sensor."""

import numpy as np
import pandas as pd
import pytest
from campaign_helpers import simulated_campaign
from log_helpers import table
from page_helpers import assert_sound, text_of
from usual import NINE

import accelstudy as acs
from accelstudy.schemes import get_scheme

TRUTH = {"b_x": 0.05, "b_y": 0.01, "b_z": 0.03, "s_x": 2e-4, "alpha_zx": 7e-4}


LAID = {"frd": ("x", "y", "z"), "flu": ("x", "−y", "−z"), "rfu": ("y", "x", "−z")}
"""Where x, y and z of a log lie forward, right and down."""


@pytest.mark.parametrize("frame", LAID)
def test_a_sensor_that_is_logged_in_other_axes_has_the_same_parameters(tmp_path, frame):
    """The page says in which axes they are, and which positions are left out."""
    out, forces = tmp_path / "out", simulated_campaign(TRUTH).forces
    logged = [(-1 if "−" in way else 1) * forces[:, "xyz".index(way[-1])] for way in LAID[frame]]
    campaign = acs.find_holds(table(np.transpose(logged)), means=True, frame=frame)
    calibration = acs.calibrate(campaign.without({5: "moved"}))
    calibration.save(out)
    page = (out / "report.html").read_text(encoding="utf-8")
    assert_sound(page)
    x, y, z = LAID[frame]
    own = "axes of the log, frd: x forward, y right, z down"
    assert (own if frame == "frd" else f"Those of the log are {frame}: ") in text_of(page)
    assert (f"its x, y and z are {x}, {y} and {z} here" in text_of(page)) == (frame != "frd")
    assert "Left out of every fit: position 5 (moved)." in page
    assert calibration.content["excluded"] == [{"position": 5, "reason": "moved"}]
    for name, value, sigma in calibration.parameters[["value", "sigma"]].itertuples():
        assert value == pytest.approx(TRUTH.get(name, 0), abs=4.5 * sigma)
    positions = pd.read_parquet(out / "positions.parquet")
    assert positions["position"].tolist() == [n for n in range(1, 25) if n != 5]
    assert positions["redundancy"].sum() == pytest.approx(calibration.content["redundancy"])


def test_near_the_pole_the_rows_say_that_their_sigmas_do_not_hold():
    """Readings of a sensor that stands upright, at the pole and 4 gon beside it, noise 20 mm/s²."""
    beside = np.repeat([0.0, 4 * np.pi / 200], 50)
    f_b = 9.80665 * np.column_stack([np.cos(beside), 0 * beside, -np.sin(beside)])
    calibration = acs.calibrate(simulated_campaign(TRUTH), approach="robot")
    level = calibration.apply(table(NINE.sense(f_b, NINE.vector(TRUTH))), sigma=0.02)
    assert level["near_pole"].tolist() == [*50 * [True], *50 * [False]]
    said = " ".join(level.attrs["warnings"])
    assert "50 of 100 rows are too close to a pitch of ±100 gon" in said
    assert "use the calibrated force" in said


def test_what_cannot_be_a_sensor_is_said():
    """Counts with about half of their scale, and a bias of 0.48 g, fit perfectly.

    So no residual tells; import, calibrate and diagnose say it. A sensor of any data sheet passes
    without a word.
    """
    f_b = -get_scheme("fibonacci-20").directions
    noise = 3e-4 * np.random.default_rng(2).standard_normal(f_b.shape)
    for offset, factor, said in ((0.0, 0.51, "s_x"), (0.48, 1.0, "b_x"), (0.2, 1.1, None)):
        log = table(np.round(16384 * (f_b + noise + [offset, 0, 0])))
        how = {"unit": "counts", "scale": factor * 9.80665 / 16384, "offset": 0}
        campaign = acs.find_holds(log, means=True, **how)
        imported = " ".join(campaign.warnings)
        assert ("49 % less than gravity" in imported) == (said == "s_x")
        assert ("check `scale` and `offset`" in imported) == (said == "s_x")
        calibration = acs.calibrate(campaign)
        assert calibration.state == ("cannot tell" if said is None else "implausible")
        found = [calibration.summary()]
        if said == "b_x":
            found.append(acs.diagnose(campaign).summary())
        for text in found:
            assert (f"No sensor is like this: {said}" in text) == (said is not None)
            assert ("a wrong scale" in text) == (said is not None)
