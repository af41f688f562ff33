"""From a log to a campaign folder: what is in it, settings, the figure, and the command."""

import re

import numpy as np
import pandas as pd
import pytest
import yaml
from calling import succeed
from log_helpers import G, session, write
from scipy.io import savemat
from stand_ins import drawn

from accelstudy.basics.units import STANDARD_GRAVITY, angles_in
from accelstudy.campaign.format import read_campaign
from accelstudy.campaign.importing import segmentation_figure
from accelstudy.campaign.importing.logs import import_log
from accelstudy.campaign.importing.settings import ImportSettings


@pytest.fixture
def log(tmp_path):
    forces, _ = session()
    return write(tmp_path, forces)


def test_turning_is_not_noise(tmp_path):
    """A sensor that turns a little within its holds changes the direction of gravity only."""
    forces, edges = session(sigma=0.005)
    for a, b in edges:
        across = np.cross(forces[a:b].mean(axis=0), [0.6, 0.8, 0])
        across /= np.linalg.norm(across)
        forces[a:b] += np.linspace(-0.02, 0.02, b - a)[:, None] * across
    campaign, _ = import_log(write(tmp_path, forces), ImportSettings(rate_hz=100))
    assert campaign.sigma_force == pytest.approx(0.005 / np.sqrt(260), rel=0.5)
    (gon,) = (text for text in campaign.warnings if "the sensor turns" in text)
    with angles_in("deg"):
        campaign, _ = import_log(write(tmp_path, forces), ImportSettings(rate_hz=100))
    (deg,) = (text for text in campaign.warnings if "the sensor turns" in text)
    size = [float(re.search(r"by some (\d+) m(?:gon|deg) within", text)[1]) for text in (gon, deg)]
    assert size[1] == pytest.approx(0.9 * size[0], abs=1)


def test_without_offset_no_direction(tmp_path):
    forces, _ = session()
    path = write(tmp_path, 10 * forces + [33000, 32000, 31000] * (forces[:, :1] > 0))
    settings = ImportSettings(rate_hz=100, unit="counts", scale=[0.1])
    campaign, _ = import_log(path, settings)
    assert any("is an offset missing?" in text for text in campaign.warnings)


def means_of(path, **settings):
    return import_log(path, ImportSettings(means=True, **settings))[0]


def test_means(tmp_path):
    table = pd.DataFrame(
        {"n": [400, 100], "fx": [1.0, 0], "fy": [0, 1.0], "fz": [0.0, 0], "t": [1, 2]}
    )
    table[["sx", "sy", "sz"]] = 0.02
    table.to_csv(tmp_path / "means.csv", index=False)
    campaign = means_of(tmp_path / "means.csv", unit="g", name="two", time="t")
    np.testing.assert_allclose(campaign.forces, np.eye(3)[:2] * STANDARD_GRAVITY)
    np.testing.assert_allclose(campaign.sd, 0.02 * STANDARD_GRAVITY)
    assert campaign.n_samples.tolist() == [400, 100]
    assert campaign.time.tolist() == [1, 2]
    expected = 0.02 * STANDARD_GRAVITY * np.sqrt((1 / 400 + 1 / 100) / 2)
    assert campaign.sigma_force == pytest.approx(expected)
    assert "white" in campaign.warnings[0]


def test_a_table_of_means_has_its_units_in_its_names(tmp_path):
    path = tmp_path / "means.csv"
    path.write_text("fx [g],fy [g],fz [g]\n1,0,0\n0,1,0\n0,0,-1\n")
    campaign = means_of(path)
    assert campaign.unit == "g"
    np.testing.assert_allclose(campaign.forces, np.diag([1, 1, -1]) * STANDARD_GRAVITY)


def test_means_as_columns(tmp_path):
    savemat(tmp_path / "means.mat", {"means": np.random.default_rng(1).normal(0, 1, (3, 24))})
    campaign = means_of(tmp_path / "means.mat", unit="g")
    assert campaign.n_positions == 24
    assert campaign.sigma_force is None


# --- The command ---------------------------------------------------------------------------------


def test_command(log, tmp_path, monkeypatch):
    out = tmp_path / "campaign"
    with drawn():
        result = succeed(
            "import", log, "--out", out, "--rate", 100, "--name", "mine", "--gravity", G
        )
    assert "holds: 8, of 2.6 to 2.6 s" in result.stdout
    assert "times the noise floor" in result.stdout
    campaign = read_campaign(out)
    expected, _ = import_log(log, ImportSettings(rate_hz=100))
    np.testing.assert_allclose(campaign.forces, expected.forces, rtol=1e-12)
    assert (campaign.name, campaign.gravity) == ("mine", G)
    assert campaign.sigma_force == pytest.approx(expected.sigma_force)
    svg = (out / "segmentation.svg").read_bytes()
    assert (out / "segmentation.png").stat().st_size > 1e4
    with drawn():
        succeed("import", log, "--out", out, "--rate", 100, "--force")
    assert (out / "segmentation.svg").read_bytes() == svg
    # A figure that fails takes the campaign not with it, and leaves no older one behind.
    monkeypatch.setattr(segmentation_figure, "draw_segmentation", lambda *_: 1 / 0)
    with drawn():
        result = succeed("import", log, "--out", out, "--rate", 100, "--force")
    assert "The figure 'segmentation' could not be drawn (ZeroDivisionError: div" in result.stderr
    assert not list(out.glob("segmentation.*"))
    np.testing.assert_array_equal(read_campaign(out).forces, campaign.forces)


def test_no_hold_is_said_to_be_shorter_than_the_shortest(tmp_path):
    forces, _ = session(holds=8, still=24, moving=30)
    campaign, _ = import_log(
        write(tmp_path, forces), ImportSettings(rate_hz=10, trim_s=0.2, threshold_mps2=0.3)
    )
    (line,) = [line for line in campaign.notes if line.startswith("holds: ")]
    assert float(re.search(r"of (\S+) to", line)[1]) >= 1.0


def test_command_with_everything(tmp_path):
    forces, _ = session(holds=4)
    table = np.column_stack([np.arange(len(forces)) * 10.0, 1000 * forces + [1, 2, 3]])
    np.savetxt(tmp_path / "log.txt", table, "%.1f")
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
    assert campaign.sensor == "A-1"
    np.testing.assert_allclose(np.linalg.norm(campaign.forces, axis=1), G, atol=0.01)
    assert not (tmp_path / "out" / "segmentation.svg").exists()
