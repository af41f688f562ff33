"""The global test: its level holds in a seeded Monte Carlo, within 4.5 standard errors."""

import math

import numpy as np
import pytest
from quality_helpers import BOTH, NINE, STANDARD_ERRORS, draw
from scipy.stats import chi2, kstest

from accelstudy.adjustment import calibrate
from accelstudy.adjustment.quality import global_test
from accelstudy.basics.levels import REFUTED


@BOTH
def test_the_global_test_is_two_sided_and_uniform(approach):
    result = calibrate(NINE, approach, draw(3, replicates=2000))
    tests = [global_test(omega, result.redundancy) for omega in result.omega]
    p = [t.p_value for t in tests]
    assert kstest(p, "uniform").pvalue > 1e-4
    assert np.mean([not t.accepted for t in tests]) == pytest.approx(
        REFUTED, abs=STANDARD_ERRORS * math.sqrt(REFUTED * (1 - REFUTED) / 2000)
    )


def test_the_global_test_rejects_on_either_side():
    assert global_test(15.0, 15).accepted
    assert not global_test(40.0, 15).accepted
    assert not global_test(3.0, 15).accepted
    assert global_test(40.0, 15, alpha=1e-4).accepted
    assert global_test(60.0, 15, variance=4.0).accepted
    limits = chi2.ppf([0.025, 0.975], 15)
    assert [global_test(x, 15).p_value for x in limits] == pytest.approx([0.05, 0.05])


def test_the_global_test_says_what_it_cannot_find():
    assert global_test(0.0, 0) is None
    assert [global_test(1.0, r).powerless for r in (1, 2, 3)] == [True, True, False]
