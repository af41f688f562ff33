"""Sketches: quantiles within the stated error, and the same bits however values are grouped."""

import numpy as np
import pytest

from accelstudy.study.claims.judging import RatioOfSketches
from accelstudy.study.monte_carlo.sketch import (
    LEAST,
    RELATIVE_ERROR,
    Sketch,
    merged_sketches,
    sketch_table,
)

RNG = np.random.default_rng(5)
PROBABILITIES = [0.0, 1e-4, 0.001, 0.025, 0.3, 0.5, 0.95, 0.999, 0.9999, 1.0]


@pytest.mark.parametrize(
    "values",
    [
        1e-4 * RNG.standard_normal(50_000),
        1e-9 * RNG.standard_t(1, 50_000),  # tails over many orders
        RNG.chisquare(15, 50_000) + 3,
        -RNG.exponential(2.0, 50_000),
        np.full(100, 0.1),
        np.array([-5.0, 1e300]),
        np.array([0.0, -0.0, 1e-30, 7.0]),
    ],
    ids=["normal", "heavy", "positive", "negative", "constant", "two", "zero"],
)
def test_quantiles_are_within_the_stated_error(values):
    sketch = Sketch.of(values)
    assert sketch.total == len(values)
    found, expected = sketch.quantile(PROBABILITIES), np.quantile(values, PROBABILITIES)
    # Between two values far apart the error is that of the larger.
    size = np.maximum(
        np.abs(np.quantile(values, PROBABILITIES, method="lower")),
        np.abs(np.quantile(values, PROBABILITIES, method="higher")),
    )
    assert np.all(np.abs(found - expected) <= RELATIVE_ERROR * size + LEAST)
    assert RELATIVE_ERROR < 0.001


def test_dense_values_are_much_closer():
    values = RNG.standard_normal(400_000)
    found = Sketch.of(values).quantile([0.025, 0.5, 0.95])
    assert np.abs(found - np.quantile(values, [0.025, 0.5, 0.95])).max() < 5e-5


def test_edges_hold_what_is_counted():
    values = np.concatenate([RNG.standard_normal(1000), [0.0, 1.0, -1.0, 2.0**-60, 3e-19]])
    for value in values:
        low, high = Sketch.of([value]).edges()
        assert low[0] <= value <= high[0]
        assert high[0] - low[0] <= max(RELATIVE_ERROR * abs(value), 2 * LEAST)
    sketch = Sketch.of(values)
    low, high = sketch.edges()
    np.testing.assert_array_equal(low[1:], high[:-1])


def test_grouping_and_order_change_nothing():
    values = RNG.standard_normal(3000) * 10.0 ** RNG.integers(-6, 6, 3000)
    whole, parts = Sketch.of(values), Sketch()
    for part in np.split(values[::-1], [0, 7, 500, 501, 2000]):
        parts.merge(Sketch.of(part))
    assert parts.lowest == whole.lowest
    np.testing.assert_array_equal(parts.counts, whole.counts)


def test_what_is_written_is_read_back_and_merged():
    keys = [("error", "b_x"), ("tilt", "roll")]
    first = {key: Sketch.of(RNG.standard_normal(100)) for key in keys}
    second = {keys[0]: Sketch.of(RNG.standard_normal(50)), keys[1]: Sketch()}
    found = merged_sketches([sketch_table("a", first), sketch_table("a", second)])
    for key in keys:
        first[key].merge(second[key])
        np.testing.assert_array_equal(found[key].counts, first[key].counts)
        assert found[key].lowest == first[key].lowest


def test_an_empty_sketch_has_no_quantiles():
    assert np.isnan(Sketch().quantile([0.1, 0.5])).all()
    assert sketch_table("a", {("error", "b_x"): Sketch()}).num_rows == 0


def test_share_below():
    values = RNG.standard_normal(20_000)
    sketch = Sketch.of(values)
    for x in (-10.0, -1.0, 0.0, 0.3, 10.0):
        assert sketch.share_below(x) == pytest.approx(np.mean(values < x), abs=1e-3)


def test_ratio_of_independent_quantities():
    """All pairs, against all pairs of a part."""
    above, below = RNG.chisquare(63, 3000) ** 0.5, RNG.chisquare(15, 3000) ** 0.5
    ratio = RatioOfSketches(Sketch.of(above), Sketch.of(below))
    pairs = np.divide.outer(above, below).ravel()
    found = ratio.quantile([0.025, 0.5, 0.975])
    np.testing.assert_allclose(found, np.quantile(pairs, [0.025, 0.5, 0.975]), rtol=0.002)
    assert ratio.share_below(1.9) == pytest.approx(np.mean(pairs < 1.9), abs=0.002)
