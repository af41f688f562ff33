"""A calibrated sensor beside the one that is calibrated: the import of its log."""

import numpy as np
import pandas as pd
import pytest
from calling import refused

import accelstudy as acs
from accelstudy.schemes import get_scheme

G, RATE, HOLD = 9.80665, 25.0, 4.0
QUARTER = np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]])  # x of the reference points right
SMALL = np.array([[1.0, -0.015, -0.02], [0.015, 1, -0.01], [0.02, 0.01, 1]])
OF_REFERENCE = np.array([[1.002, 0.003, -0.002], [0, 0.998, 0.001], [0, 0, 1.001]])
OF_SENSOR = np.array([[0.99, 0.012, 0.007], [-0.004, 1.005, 0.009], [0.011, -0.006, 1.003]])


def turned(count, rng):
    """Forces of a plate that is held in evenly spread attitudes, and moved between them."""
    held = get_scheme(f"fibonacci-{count}").directions
    share = np.linspace(0, 1, int(2 * RATE))[:, None]
    parts = []
    for first, then in zip(held, np.roll(held, -1, axis=0), strict=True):
        parts.append(np.repeat(first[None], int(HOLD * RATE), axis=0))
        shaken = 0.3 * np.sin(8 * np.pi * share) * rng.standard_normal(3)
        way = first * (1 - share) + then * share + shaken
        parts.append(way / np.linalg.norm(way, axis=1, keepdims=True))
    return -G * np.concatenate(parts[:-1])


def write(path, forces, start=0.0, names="time,fx,fy,fz"):
    time = start + np.arange(len(forces)) / RATE
    table = np.column_stack([time, forces])
    np.savetxt(path, table, delimiter=",", header=names, comments="", fmt="%.7f")
    return path


@pytest.fixture(scope="module")
def plate(tmp_path_factory):
    """A folder with the logs of a sensor and a reference, and the calibration of the latter."""
    folder, rng = tmp_path_factory.mktemp("plate"), np.random.default_rng(7)

    def noisy(forces, matrix, bias, sigma):
        return forces @ matrix.T + bias + sigma * rng.standard_normal(forces.shape)

    alone, together = turned(16, rng), turned(14, rng)
    own = np.array([0.02, -0.03, 0.05])
    names = "time,ax,ay,az"
    write(folder / "alone.csv", noisy(alone, OF_REFERENCE, own, 0.01), names=names)
    beside = noisy(together @ QUARTER.T, OF_REFERENCE, own, 0.01)
    write(folder / "ref.csv", beside, 1000, names)
    write(folder / "late.csv", beside, 5000, names)
    write(folder / "shifted.csv", beside, 1018, names)
    write(folder / "between.csv", beside, 1003, names)
    write(folder / "in-g.csv", beside / 9.80665, 1000, names)
    write(folder / "other.csv", beside, 1000, "t,p,q,r")
    askew = np.array([[1, -1, 0], [1, 1, 0], [0, 0, 2**0.5]]) / 2**0.5
    write(folder / "askew.csv", noisy(together @ askew.T, OF_REFERENCE, own, 0.01), 1000, names)
    write(folder / "partly.csv", beside[len(beside) // 2 :], 1000 + len(beside) // 2 / RATE, names)
    measured = noisy(together @ SMALL.T, OF_SENSOR, np.array([0.3, -0.2, 0.1]), 0.02)
    write(folder / "log.csv", measured, 1000)
    acs.calibrate(acs.find_holds(folder / "alone.csv")).save(folder / "ref")
    return folder


def imported(plate, beside="ref.csv", calibration="ref/calibration.json", **how):
    """The campaign of the log beside a reference."""
    how = {"log": plate / "log.csv", "reference_log": plate / beside, **how}
    return acs.find_holds(reference=plate / calibration, **how)


def test_from_two_logs_to_the_sensor(plate):
    campaign = imported(plate)
    assert "x right, y back, z down" in " ".join(campaign.notes)
    assert campaign.header.reference.frame == "rbd"
    assert campaign.header.reference.calibration == "alone"
    # Four seconds less trims and half windows, at 25 per second.
    assert campaign.header.reference.sigma_mps2 == pytest.approx(0.01 / np.sqrt(70), rel=0.4)
    calibration = acs.calibrate(
        campaign, approach="robot", model="bias-scale-nonorthogonality-crossaxis"
    )
    # Fourteen holds of four seconds hardly tell their own noise, so nothing is accepted by it.
    assert campaign.header.sigma_dof < 8
    assert calibration.state == "cannot tell"
    assert calibration.content["reference"]["calibration"] == "alone"
    tilt = calibration.content["quality"]["tilt_rms_mgon"]
    assert 0 < tilt["reference_roll"] < tilt["parameters_roll"]
    # The rotation between the sensors is part of what is estimated: forces in the axes of the
    # reference come out, whatever the sensor was turned by.
    affine = calibration.content["affine"]
    levels = -G * np.array([[0.3, 0.2, 0.93], [-0.4, 0.1, 0.91]])
    read = levels @ SMALL.T @ OF_SENSOR.T + [0.3, -0.2, 0.1]
    found = (read - affine["bias_mps2"]) @ np.transpose(affine["matrix"])
    np.testing.assert_allclose(found, levels, atol=0.02)


def test_other_columns_and_times(plate):
    """Columns by option, with units in their names; a clock that is off by an offset."""
    first, units = imported(plate), "time_ms,p [g],q [g],r [g]"
    table = pd.read_csv(plate / "other.csv") * [1000, *[1 / 9.80665] * 3]
    # The columns of the log of the calibration are there, too, with another sensor in them.
    table.set_axis(units.split(","), axis=1).assign(time=1.0, ax=1.0, ay=1.0, az=1.0).to_csv(
        plate / "units.csv", index=False
    )
    for log, how in (
        ("units.csv", {"reference_columns": "fx=p [g],fy=q [g],fz=r [g],time=time_ms"}),
        ("other.csv", {"reference_columns": "fx=p,fy=q,fz=r,time=t"}),
        ("shifted.csv", {"reference_offset": -18}),
    ):
        np.testing.assert_allclose(imported(plate, log, **how).angles, first.angles, atol=1e-9)


def test_holds_without_the_reference_are_left_out(plate):
    campaign = imported(plate, "partly.csv")
    said = " ".join(campaign.warnings)
    assert "hold 1 left out: the reference log does not cover it" in said
    assert campaign.positions[0] == 8


REFUSED = {
    "late.csv": ("reference_log", "whose holds lie from", "reference_offset"),
    "shifted.csv": ("reference_log", "do not turn together", "reference_offset"),
    "between.csv": ("reference_log", "moves in", "reference_offset"),
    "in-g.csv": ("reference_log", "about 1 m/s²", "unit"),
    "other.csv": ("reference_log", "reference_columns"),
    "askew.csv": ("reference_log", "turned by 50 gon", "20 gon"),
    "missing.csv": ("missing.csv",),
}


@pytest.mark.parametrize("log", REFUSED)
def test_logs_that_tell_no_angles(plate, log):
    with refused(*REFUSED[log]):
        imported(plate, log)


def test_a_rejected_reference_is_told(plate):
    log = pd.read_csv(plate / "alone.csv")
    log.loc[log["time"] > 40, "ax"] += 0.1
    calibration = acs.calibrate(acs.find_holds(log))
    calibration.save(plate / "rejected")
    (doubt,) = imported(plate, calibration="rejected").warnings[:1]
    assert calibration.state == "rejected"
    assert "reference" in doubt
    assert "the calibration is rejected: its residuals are" in doubt
    assert "rejected" not in " ".join(imported(plate).warnings)


def test_angles_in_the_log_are_not_used(plate):
    log = pd.read_csv(plate / "log.csv").assign(roll=0.0, pitch=0.0)
    assert "; not used: roll, pitch" in " ".join(imported(plate, log=log).notes)
