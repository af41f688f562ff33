"""Logs of equal blocks: each is a position, unless the sensor moves within it."""

import numpy as np
import pytest
from log_helpers import table

import accelstudy as acs

G, SIZE, COUNT, SIGMA = 9.80665, 40, 14, 0.03


@pytest.fixture(scope="module")
def samples():
    """Readings of 14 attitudes, 40 of each, m/s²."""
    rng = np.random.default_rng(8)
    directions = rng.standard_normal((COUNT, 3))
    forces = G * directions / np.linalg.norm(directions, axis=1, keepdims=True)
    return np.repeat(forces, SIZE, axis=0) + SIGMA * rng.standard_normal((COUNT * SIZE, 3))


def imported(samples, unit="m/s^2", **columns):
    log = table(samples / (G if unit == "g" else 1), **columns)
    return acs.find_holds(log, block=SIZE, unit=unit)


def test_each_block_is_a_position_without_a_time(samples):
    campaign = imported(samples, "g", temperature=np.linspace(20, 30, len(samples)))
    blocks = samples.reshape(COUNT, SIZE, 3)
    np.testing.assert_allclose(campaign.forces, blocks.mean(axis=1), atol=1e-6)
    np.testing.assert_allclose(campaign.sd, blocks.std(axis=1, ddof=1), rtol=1e-6)
    assert (campaign.n_samples == SIZE).all()
    assert campaign.time is None
    assert np.diff(campaign.temperature) == pytest.approx(10 / COUNT, rel=0.01)
    # White noise: one mean has σ/√40, by the Allan deviation to some 20 %.
    assert campaign.sigma_force == pytest.approx(SIGMA / np.sqrt(SIZE), rel=0.3)


def test_a_column_of_time_tells_that_of_the_blocks(samples):
    time = np.repeat(60.0 * np.arange(COUNT), SIZE) + np.tile(np.arange(SIZE) / 100, COUNT)
    assert np.diff(imported(samples, time=time).time) == pytest.approx(60.0)


def test_a_block_in_which_the_sensor_moves_is_left_out(samples):
    moved = samples.copy()
    moved[5 * SIZE + 20 : 6 * SIZE] += [0.3, 0.0, 0.0]
    campaign = imported(moved)
    assert [*campaign.reasons] == [6]
    assert campaign.reasons[6].startswith("the sensor moves: its parts scatter by 0.1")
    assert campaign.positions.tolist() == [n for n in range(1, COUNT + 1) if n != 6]
    assert any(line.startswith("left out: 1 block: 6 (the sensor moves") for line in campaign.notes)
