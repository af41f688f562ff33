"""Logs of equal blocks: each is a position, unless the sensor moves within it."""

import numpy as np
import pandas as pd
import pytest
from calling import succeed

from accelstudy.campaign.format import read_campaign
from accelstudy.campaign.importing.logs import import_log
from accelstudy.campaign.importing.settings import ImportSettings

G, SIZE, COUNT, SIGMA = 9.80665, 40, 14, 0.03


@pytest.fixture(scope="module")
def samples():
    """Readings of 14 attitudes, 40 of each, m/s²."""
    rng = np.random.default_rng(8)
    directions = rng.standard_normal((COUNT, 3))
    forces = G * directions / np.linalg.norm(directions, axis=1, keepdims=True)
    return np.repeat(forces, SIZE, axis=0) + SIGMA * rng.standard_normal((COUNT * SIZE, 3))


def write(folder, samples, unit=1.0, **columns):
    path = folder / "log.csv"
    table = pd.DataFrame(samples / unit, columns=["u", "v", "w"]).assign(**columns)
    table.to_csv(path, index=False)
    return path


SETTINGS = {"columns": {"fx": "u", "fy": "v", "fz": "w"}, "block": SIZE}
WORDS = ("--columns", "fx=u,fy=v,fz=w", "--block", SIZE)


def test_each_block_is_a_position_without_a_time(tmp_path, samples):
    path = write(tmp_path, samples, unit=G, temperature=np.linspace(20, 30, len(samples)))
    succeed("import", path, *WORDS, "--unit", "g", "--out", tmp_path / "out")
    campaign = read_campaign(tmp_path / "out")
    blocks = samples.reshape(COUNT, SIZE, 3)
    np.testing.assert_allclose(campaign.forces, blocks.mean(axis=1), atol=1e-6)
    np.testing.assert_allclose(campaign.sd, blocks.std(axis=1, ddof=1), rtol=1e-6)
    assert (campaign.n_samples == SIZE).all()
    assert campaign.time is None
    assert np.diff(campaign.temperature) == pytest.approx(10 / COUNT, rel=0.01)
    # White noise: one mean has σ/√40, by the Allan deviation to some 20 %.
    assert campaign.sigma_force == pytest.approx(SIGMA / np.sqrt(SIZE), rel=0.3)
    assert (tmp_path / "out/segmentation.png").exists()


def test_a_column_of_time_tells_that_of_the_blocks(tmp_path, samples):
    time = np.repeat(60.0 * np.arange(COUNT), SIZE) + np.tile(np.arange(SIZE) / 100, COUNT)
    path = write(tmp_path, samples, time=time)
    campaign, _ = import_log(path, ImportSettings(**SETTINGS))
    assert np.diff(campaign.time) == pytest.approx(60.0)


def test_a_block_in_which_the_sensor_moves_is_left_out(tmp_path, samples):
    moved = samples.copy()
    moved[5 * SIZE + 20 : 6 * SIZE] += [0.3, 0.0, 0.0]
    campaign, _ = import_log(write(tmp_path, moved), ImportSettings(**SETTINGS))
    assert [*campaign.reasons] == [6]
    assert campaign.reasons[6].startswith("the sensor moves: its parts scatter by 0.1")
    assert campaign.positions.tolist() == [n for n in range(1, COUNT + 1) if n != 6]
    assert any(line.startswith("left out: 1 block: 6 (the sensor moves") for line in campaign.notes)
