"""From a log to a campaign folder: what is in it, settings, the figure, and the command."""

import re

import numpy as np
import pytest
import yaml
from calling import succeed
from log_helpers import RATE, G, session, table
from scipy.io import savemat

import accelstudy as acs
from accelstudy.basics.units import STANDARD_GRAVITY, angles_in
from accelstudy.campaign.format import read_campaign
from accelstudy.schemes import get_scheme


def test_turning_is_not_noise():
    """A sensor that turns a little within its holds changes the direction of gravity only."""
    forces, edges = session(sigma=0.005)
    for a, b in edges:
        across = np.cross(forces[a:b].mean(axis=0), [0.6, 0.8, 0])
        across /= np.linalg.norm(across)
        forces[a:b] += np.linspace(-0.02, 0.02, b - a)[:, None] * across
    sizes = []
    for unit in ("gon", "deg"):
        with angles_in(unit):
            campaign = acs.find_holds(table(forces), rate=100)
        assert campaign.sigma_force == pytest.approx(0.005 / np.sqrt(260), rel=0.5)
        (said,) = (text for text in campaign.warnings if "the sensor turns" in text)
        sizes.append(float(re.search(rf"by some (\d+) m{unit} within", said)[1]))
    assert sizes[1] == pytest.approx(0.9 * sizes[0], abs=1)


def test_without_offset_no_direction():
    forces, _ = session()
    raw = 10 * forces + [33000, 32000, 31000] * (forces[:, :1] > 0)
    campaign = acs.find_holds(table(raw), rate=100, unit="counts", scale=0.1)
    assert any("is an offset missing?" in text for text in campaign.warnings)


def test_no_hold_is_said_to_be_shorter_than_the_shortest():
    forces, _ = session(holds=8, still=24, moving=30)
    campaign = acs.find_holds(table(forces), rate=10, trim=0.2, threshold=0.3)
    (line,) = [line for line in campaign.notes if line.startswith("holds: ")]
    assert float(re.search(r"of (\S+) to", line)[1]) >= 1.0


def test_means():
    forces = np.array([[0.6, 0.0, 0.8], [0.0, 0.6, -0.8]])
    log = table(forces, n=[400, 100], t=[1, 2], sx=0.02, sy=0.02, sz=0.02)
    campaign = acs.find_holds(log, means=True, unit="g", time="t")
    np.testing.assert_allclose(campaign.forces, forces * STANDARD_GRAVITY)
    np.testing.assert_allclose(campaign.sd, 0.02 * STANDARD_GRAVITY)
    assert campaign.positions.tolist() == [1, 2]
    assert campaign.n_samples.tolist() == [400, 100]
    assert campaign.time.tolist() == [1, 2]
    expected = 0.02 * STANDARD_GRAVITY * np.sqrt((1 / 400 + 1 / 100) / 2)
    assert campaign.sigma_force == pytest.approx(expected)
    assert "white" in campaign.warnings[0]


def test_means_with_units_in_their_names_and_as_columns_of_an_array(tmp_path):
    names = {f"f{axis}": f"f{axis} [g]" for axis in "xyz"}
    campaign = acs.find_holds(table(np.eye(3)).rename(columns=names), means=True)
    assert campaign.header.unit == "g"
    np.testing.assert_allclose(campaign.forces, np.eye(3) * STANDARD_GRAVITY)
    savemat(tmp_path / "means.mat", {"means": np.random.default_rng(1).normal(0, 1, (3, 24))})
    campaign = acs.find_holds(tmp_path / "means.mat", means=True, unit="g")
    assert (campaign.n_positions, campaign.sigma_force) == (24, None)


# --- The command ---------------------------------------------------------------------------------


def test_command_with_everything(tmp_path):
    forces, _ = session(holds=4)
    rows = np.column_stack([np.arange(len(forces)) * 10.0, 1000 * forces + [1, 2, 3]])
    np.savetxt(tmp_path / "log.txt", rows, "%.1f")
    content = {"time_unit": "ms", "columns": {"fx": 1, "fy": 2}, "sensor": "A-1", "unit": "g"}
    (tmp_path / "settings.yaml").write_text(yaml.safe_dump(content))
    result = succeed(
        "import",
        *(tmp_path / "log.txt", "--out", tmp_path / "out", "--settings"),
        *(tmp_path / "settings.yaml", "--columns", "fz=3", "--time", "0", "--unit", "counts"),
        *("--scale", "0.001", "--offset", "1,2,3", "--threshold", "0.1", "--no-figure"),
    )
    assert "threshold: 0.1 m/s², as given" in result.stdout
    campaign = read_campaign(tmp_path / "out")
    assert campaign.n_positions == 4
    assert campaign.header.sensor == "A-1"
    np.testing.assert_allclose(np.linalg.norm(campaign.forces, axis=1), G, atol=0.01)
    assert not (tmp_path / "out" / "segmentation.png").exists()


def test_long_holds_do_not_make_short_ones_look_wrong():
    """One sigma stands for all holds: its square is about the mean of theirs."""
    directions = get_scheme("fibonacci-18").directions
    for still, warned in (((300, 2500, 2500), True), ((1000, 1200, 1100), False)):
        log, _ = session(seed=3, still=still, forces=G * directions)
        campaign = acs.find_holds(table(log), rate=RATE, gravity=G)
        white = 0.02 * np.sqrt(np.mean(1 / campaign.n_samples))
        assert campaign.sigma_force == pytest.approx(white, rel=0.3)
        assert warned == any("share one sigma" in one for one in campaign.warnings)
