"""The figure of rare events, of a study that asks for them."""

import numpy as np
import pytest
from scipy.stats import binomtest
from study_helpers import NINE, grid, make_study, run_rare, run_study

from accelstudy.study.figures import draw, figure_names

KEYS = {
    "keep": "summary",
    "leveling": {"attitudes": 5},
    "rare": {"replicates": 2000, "shares": [0.01, 1e-4]},
    "grids": [grid(replicates=300), grid(replicates=60, approaches="gravity", sensor_sigma_mps2=3)],
}


@pytest.fixture(scope="module")
def study():
    return make_study(**KEYS)


@pytest.fixture(scope="module")
def tables(tmp_path_factory):
    folder = tmp_path_factory.mktemp("rare")
    tables = run_study(folder, **KEYS)
    return {**tables, "rare": run_rare(folder, make_study(**KEYS))}


@pytest.fixture(scope="module")
def axes(study, tables):
    return draw("rare-events", tables, study).axes


def test_only_a_study_that_asks_for_rare_tilt_errors_has_it(study):
    assert "rare-events" in figure_names(study)
    assert "rare-events" not in figure_names(make_study(grids=KEYS["grids"]))


def test_tails_are_the_quantiles_of_the_set_up_with_the_least_noise(axes, tables):
    tails, _ = axes
    drawn = {line.get_gid(): line.get_xydata() for line in tails.get_lines()}
    points = {gid: drawn.pop(gid) for gid in [*drawn] if gid.endswith(" rare")}
    cells = [f"{NINE}/mclaren-24/{approach}" for approach in ("gravity", "robot")]
    assert set(drawn) == {f"{cell} {angle}" for cell in cells for angle in ("roll", "pitch")}
    table = tables["quantiles"]
    one = table[(table["cell"] == cells[1]) & (table["name"] == "roll")]
    (q99,) = one.loc[one["probability"] == 0.99, "value"]
    x, y = drawn[f"{cells[1]} roll"].T
    assert y[np.isclose(x, 0.01)] == pytest.approx([q99])
    assert (np.diff(x) < 0).all()
    assert (np.diff(y) > 0).all()
    assert set(points) == {f"{gid} rare" for gid in drawn}
    rare = tables["rare"]
    one = rare[(rare["cell"] == cells[1]) & (rare["name"] == "roll")]
    np.testing.assert_array_equal(
        points[f"{cells[1]} roll rare"], one[["share_beyond", "value_mgon"]]
    )


def test_failures_have_exact_intervals(axes, tables):
    failures = axes[1]
    cells = tables["cells"].set_index("cell")
    n, converged = cells.loc[f"{NINE}/mclaren-24/gravity/sensor_sigma_mps2=3"][
        ["n_replicates", "n_converged"]
    ]
    (bars,) = [one for one in failures.containers if len(one[0].get_xdata())]
    (x,), (share,) = bars[0].get_data()
    assert (x, share) == (3, (n - converged) / n)
    interval = binomtest(int(n - converged), int(n)).proportion_ci(method="exact")
    ((_, low), (_, high)) = bars[2][0].get_segments()[0]
    assert (low, high) == pytest.approx((interval.low, interval.high))
    limits = [line for line in failures.get_lines() if line.get_marker() == "v"]
    highest = binomtest(0, 300).proportion_ci(method="exact").high
    assert [line.get_ydata() for line in limits] == [pytest.approx([highest])] * 2
