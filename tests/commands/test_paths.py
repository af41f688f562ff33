"""From a raw log of somebody else to an applied extended model, by three commands each."""

import numpy as np
import pandas as pd
import pytest
from calling import succeed
from places import DATA

from accelstudy.campaign.format import read_campaign

NINE = "bias-scale-nonorthogonality"

PATHS = {
    # Blanks between numbers in the notation of MATLAB, counts, a column of time.
    "xsens": (
        "imu_tk_xsens/xsens_acc.mat",
        "--columns fx=1,fy=2,fz=3 --time 0 --unit counts --offset 32768 "
        "--scale 0.00240964,0.00242131,0.00240964 --gravity 9.81744 "
        "--exclude 9:held-out --exclude 19:held-out --exclude 29:held-out",
        ["calibrate", "--model", f"{NINE}+bias_drift"],
        "xsens.csv",
    ),
    # Blanks, no header, no time, columns of gyroscopes beside.
    "mpu9150": (
        "mpu9150/imu1.log",
        "--columns fx=0,fy=1,fz=2 --rate 100 --gravity 9.8189 "
        "--exclude 7:held-out --exclude 15:held-out",
        ["diagnose", "--replicates", "100", "--model", f"{NINE}+warm_up(tau=60)"],
        "mpu9150.parquet",
    ),
    # A binary MATLAB file of a phone in the hand, whose holds are not static.
    "phone": (
        "ctu_innalabs/MobileAccData30orientationRawSample01.mat",
        "--rate 50 --exclude 5:held-out --exclude 15:held-out --exclude 25:held-out",
        ["calibrate", "--model", f"{NINE}+quadratic_scale"],
        "phone.csv",
    ),
}
RATES = {"xsens": 100, "mpu9150": 100, "phone": 50}
# Rms of |f| - g of means of holds, mm/s²: as they are read (at least), calibrated, and calibrated
# without having been used (at most).
BOUNDS = {"xsens": (800, 1.5, 2), "mpu9150": (200, 3, 12), "phone": (200, 40, 60)}


@pytest.mark.parametrize("name", PATHS)
def test_from_a_raw_log_to_an_applied_model(name, tmp_path, monkeypatch):
    file, options, fit, out = PATHS[name]
    if not DATA.exists():
        pytest.skip("the shared data are not there")
    monkeypatch.chdir(tmp_path)
    log = DATA / file
    succeed("import", log, "--out", "c", *options.split(), "--no-figure")
    succeed(fit[0], "c", "--out", "k", *fit[1:])
    applied = succeed("apply", "k/calibration.json", log, "--out", out)
    assert f"rows leveled: {out}" in applied.stdout

    table = pd.read_parquet(out) if out.endswith(".parquet") else pd.read_csv(out)
    calibrated = table[[f"f{axis}_calibrated_mps2" for axis in "xyz"]].to_numpy()
    assert np.isfinite(calibrated).all()
    time = np.arange(len(table)) / RATES[name]
    if name == "xsens":
        time = table["column_0"] - table["column_0"][0]
    whole, reasons = read_campaign("c").whole, read_campaign("c").reasons
    half = (whole.n_samples - 1) / RATES[name] / 2
    holds = [np.abs(time - t) < h + 1e-3 for t, h in zip(whole.time, half, strict=True)]
    means = np.array([calibrated[hold].mean(axis=0) for hold in holds])

    def rms(forces):
        norms = np.linalg.norm(forces, axis=1)
        return 1e3 * np.sqrt(np.mean((norms - whole.gravity) ** 2))

    unused = np.isin(whole.positions, list(reasons))
    assert unused.sum() == options.count("--exclude")
    raw, used, unseen = BOUNDS[name]
    assert rms(whole.forces[unused]) > raw
    assert rms(means[~unused]) < used
    assert rms(means[unused]) < unseen
