"""The ways that the benchmarks compare solve the same problem."""

import numpy as np
import pytest
from golden import compare
from places import DATA, ROOT, needs_data

from accelstudy.approaches import get_approach


# Not Numba, which only benchmarks need; each run of the benchmarks compares all of them.
@pytest.mark.parametrize("approach", ["gravity", "robot"])
@pytest.mark.parametrize("name", ["compiled", "numpy", "scipy", "scipy_jacobian"])
def test_a_way_gives_the_estimates_of_the_adjustment(name, approach):
    from problem import drawn, ideal_session
    from ways import WAYS

    way = WAYS.get(name)
    approach = get_approach(approach)
    observed = drawn(ideal_session(), approach).first(3)
    expected = WAYS.get("numpy")(approach).solve(observed)
    estimates, sigma = way(approach).solve(observed)
    tolerance = max(way.difference, 1e-10)
    np.testing.assert_array_less(np.abs(estimates - expected[0]), tolerance * expected[1])
    np.testing.assert_allclose(sigma, expected[1], rtol=tolerance)


@needs_data
def test_the_comparison_with_authors_is_what_its_page_shows():
    import comparison

    page = (ROOT / "docs/guides/comparison.md").read_text(encoding="utf-8")
    shown = page.partition("<!-- authors -->")[2].partition("<!-- end of authors -->")[0]
    assert compare(shown.strip(), comparison.authors(DATA).strip())[0] == []
