"""Intervals of shares, beside those of a table."""

import pytest

from accelstudy.basics.shares import clopper_pearson


def test_shares():
    """0 of 10, 1 of 20 and 5 of 5, as tables of exact binomial limits have them."""
    low, high = clopper_pearson([0, 1, 5], [10, 20, 5])
    assert low == pytest.approx([0, 0.0012651, 0.4781762], abs=1e-6)
    assert high == pytest.approx([0.3084971, 0.2487328, 1], abs=1e-6)
