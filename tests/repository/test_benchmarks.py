"""The ways that the benchmarks compare solve the same problem."""

import re

import numpy as np
import pytest
from page_helpers import assert_told_alike
from places import DATA, ROOT, needs_data

from accelstudy.approaches import get_approach

BENCHMARKS = ROOT / "benchmarks"


@pytest.fixture(autouse=True, scope="module")
def in_benchmarks():
    """Modules of the benchmarks import each other by their names."""
    patch = pytest.MonkeyPatch()
    patch.syspath_prepend(BENCHMARKS)
    yield
    patch.undo()


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


def test_a_way_that_is_not_installed_says_what_it_needs(monkeypatch):
    import speeds
    from ways import WAYS

    monkeypatch.setattr(WAYS.get("numba"), "missing", lambda: "uv pip install numba")
    rates = {way: np.array([1e5, 2e5]) for way in WAYS.names() if way != "numba"}
    both = dict.fromkeys(("gravity", "robot"), rates)
    found = speeds.tables((both, dict.fromkeys(both, dict.fromkeys(rates, 0.0))))
    (row,) = [line for line in found.splitlines() if "Numba" in line]
    assert row.count("not measured: uv pip install numba") == 2


@needs_data
def test_the_comparison_with_authors_is_what_its_page_shows():
    import comparison

    page = (ROOT / "docs/guides/comparison.md").read_text(encoding="utf-8")
    shown = page.partition("<!-- authors -->")[2].partition("<!-- end of authors -->")[0]
    assert_told_alike(comparison.authors(DATA), shown)


def test_each_table_of_the_page_of_speed_is_replaced_and_the_rest_is_kept(monkeypatch):
    for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
        monkeypatch.setenv(variable, "1")  # as `run` sets them, until this test ends
    from page import put
    from run import NAMES

    page = (BENCHMARKS.parent / "docs/guides/speed.md").read_text()
    assert page.count("<!-- end of ") == len(NAMES)
    for name in NAMES:
        before, _, after = re.split(rf"<!-- (?:end of )?{name} -->", page)
        marks = f"<!-- {name} -->", f"<!-- end of {name} -->"
        new = put(page, name, r"| \1 |")
        assert new == f"{before}{marks[0]}\n\n| \\1 |\n\n{marks[1]}{after}"
    with pytest.raises(ValueError, match="nothing"):
        put(page, "nothing", "x")
