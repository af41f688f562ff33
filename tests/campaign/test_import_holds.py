"""The detector of static holds, against logs whose holds are known, and against public ones."""

import numpy as np
import pandas as pd
import pytest
from log_helpers import RATE, find_holds, opened, session


def spans(holds):
    """First samples of holds that are used, and those after the last."""
    return holds.table[holds.used][["start", "end"]].to_numpy().T


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("sigma", [0.0005, 0.02, 0.2])
def test_known_holds(tmp_path, seed, sigma):
    forces, edges = session(seed, sigma=sigma)
    holds = find_holds(opened(tmp_path, forces))
    assert len(holds.table) == len(edges)
    start, end = spans(holds)
    assert np.all((start >= edges[:, 0]) & (end <= edges[:, 1]))
    # Half a window and the trim are lost on both sides, and little else.
    np.testing.assert_allclose(start - edges[:, 0], 70, atol=15)
    np.testing.assert_allclose(edges[:, 1] - end, 70, atol=15)
    np.testing.assert_array_equal(holds.table["n"], end - start)
    np.testing.assert_allclose(holds.table["t0"], start / RATE)
    np.testing.assert_allclose(holds.table["t1"], (end - 1) / RATE)
    sds = holds.table[["sd_fx", "sd_fy", "sd_fz"]].to_numpy()
    for i in range(len(start)):
        own = forces[start[i] : end[i]]
        np.testing.assert_allclose(holds.means[i], own.mean(axis=0), rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(sds[i], own.std(axis=0, ddof=1), rtol=1e-9)
    assert holds.windows.floor == pytest.approx(sigma * 3**0.25, rel=0.1)


def test_no_hold_spans_a_gap(tmp_path):
    forces, edges = session()
    time = np.arange(len(forces)) / RATE
    middle = edges[3].mean().astype(int)
    time[middle:] += 10
    log = opened(tmp_path, forces, time)
    holds = find_holds(log, shortest=0.5)
    assert "1 gap in time; no hold spans one" in holds.warnings
    assert len(holds.table) == len(edges) + 1
    assert not np.any(
        (holds.table["start"].to_numpy() < middle) & (holds.table["end"].to_numpy() > middle)
    )


def test_a_frozen_channel_does_not_lower_the_floor(tmp_path):
    forces, edges = session()
    sound = find_holds(opened(tmp_path, forces))
    frozen = forces.copy()
    frozen[edges[2, 0] : edges[5, 1]] = frozen[edges[2, 0]]
    frozen[edges[6, 0] : edges[6, 1], 1] = frozen[edges[6, 0], 1]
    holds = find_holds(opened(tmp_path, frozen))
    assert holds.windows.threshold == pytest.approx(sound.windows.threshold, rel=0.05)
    np.testing.assert_array_equal(spans(holds)[0], spans(sound)[0][[0, 1, 7]])
    (text,) = (text for text in holds.warnings if "does not change over a window in" in text)
    # The window of 101 samples about the first that is frozen.
    at, value = (edges[2, 0] + 50) / RATE, frozen[edges[2, 0], 0]
    assert f"the first: fx, {value:.4g} m/s² at {at:.1f} s" in text


def test_override_and_limits(tmp_path):
    forces, edges = session()
    log = opened(tmp_path, forces)
    chosen = find_holds(log)
    given = find_holds(log, threshold=chosen.windows.threshold)
    assert given.windows.reason == "as given"
    pd.testing.assert_frame_equal(given.table, chosen.table, rtol=1e-5, atol=1e-8)
    assert len(find_holds(log, threshold=100.0).table) == 1
    longer = find_holds(log, trim=0.5)
    np.testing.assert_array_equal(spans(longer).T, spans(chosen).T + np.array([30, -30]))
    assert len(edges) == len(chosen.table)


def test_few_holds_in_much_motion(tmp_path):
    forces, edges = session(holds=4, still=400, moving=2500)
    assert len(find_holds(opened(tmp_path, forces)).table) == len(edges)


@pytest.mark.parametrize(("sigma", "factor"), [(0.0003, 6), (0.002, 6), (0.01, 2), (0.1, 2)])
def test_holds_that_are_noisier_than_the_others(tmp_path, sigma, factor):
    """A quiet sensor feels a pump that runs now and then, and its holds are holds all the same."""
    forces, edges = session(seed=2, holds=12, sigma=sigma)
    rng = np.random.default_rng(1)
    for start, end in edges[[2, 5, 9]]:
        forces[start:end] += factor * sigma * rng.standard_normal((end - start, 3))
    holds = find_holds(opened(tmp_path, forces))
    assert len(holds.table) == len(edges)
    start, end = spans(holds)
    assert np.all((start >= edges[:, 0]) & (end <= edges[:, 1]))
