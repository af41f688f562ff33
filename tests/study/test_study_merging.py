"""However a cell is shared out to jobs, and whether its replicates are kept: the same tables."""

import dataclasses
from itertools import pairwise

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest
from scheme_helpers import KNOWN
from study_helpers import grid, make_cells, make_study, parts_in, run_study

from accelstudy.study import batches as batching
from accelstudy.study import cell as cells_module
from accelstudy.study.batches import batches, job_size
from accelstudy.study.cells import study_cells
from accelstudy.study.claims import evidence_from
from accelstudy.study.monte_carlo import distributions, replicates, simulate
from accelstudy.study.monte_carlo.moments import Moments, Node, Tree, paired_moments
from accelstudy.study.tables import TABLES

RNG = np.random.default_rng(3)
# 330 replicates are 7 chunks of 50, the last one not full.
SMALL = {
    "grids": [
        grid(approaches="gravity", replicates=330, sensor_sigma_mps2=2),  # a part fails
        grid("bias-scale", "mclaren-24", 330, approaches="robot"),
        grid("bias-scale", "faces-6", 60, approaches=["gravity", "robot"]),
    ],
    "leveling": {"attitudes": 5},
}


@pytest.fixture(scope="module", autouse=True)
def _small_chunks():
    """Blocks of 25 replicates and chunks of 2 blocks."""
    with pytest.MonkeyPatch.context() as patch:
        for module in (cells_module, replicates, simulate, batching):
            patch.setattr(module, "BLOCK", 25)
            patch.setattr(module, "CHUNK", 2)
        yield


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    folder = tmp_path_factory.mktemp("kept")
    tables = run_study(folder, batch_size=10**9, **SMALL)
    (path,) = folder.glob("*/*/estimates.parquet")
    assert pq.ParquetFile(path).num_row_groups == 7 + 7 + 2 + 2  # a chunk each
    return tables


@pytest.fixture(scope="module")
def summed(tmp_path_factory):
    folder = tmp_path_factory.mktemp("summed")
    return run_study(folder, batch_size=10**9, keep="summary", **SMALL)


def assert_same(first, second):
    for name in TABLES:
        pd.testing.assert_frame_equal(first[name], second[name], check_exact=True)


# --- the same bits -------------------------------------------------------------------------------


@pytest.mark.parametrize("size", [50, 151])
def test_splitting_a_cell_changes_no_bit(kept, summed, size, tmp_path):
    parts = run_study(tmp_path / "kept", batch_size=size, **SMALL)
    assert_same(parts, kept)
    labels = dict.fromkeys(("cell", "parameter", "unit"), str)
    pd.testing.assert_frame_equal(
        parts["estimates"].astype(labels), kept["estimates"].astype(labels), check_exact=True
    )
    assert_same(run_study(tmp_path / "summed", batch_size=size, keep="summary", **SMALL), summed)
    assert len(list((tmp_path / "summed").glob("*/*/sketches.parquet"))) > 5


def leaf(x, y, converged):
    """Moments of numbers (R, k), as of one chunk."""
    k = x.shape[1]
    return Moments(
        simulated=len(x),
        converged=int(converged.sum()),
        redundancy=3,
        centre=np.zeros(2),
        **paired_moments(x, y, converged),
        apart=np.full((3, 2, 17), float(len(x))),
        correlation_sum=np.full((2, 2), 0.1 * len(x)),
        first=x[0] if converged.any() else np.full(k, np.nan),
    )


def test_a_tree_does_not_depend_on_how_its_leaves_come():
    leaves = []
    for n in (5, 0, 3, 5, 5, 5, 1, 5, 5, 4, 5):
        converged = np.arange(5) < n
        x = RNG.standard_normal((5, 4)) * converged[:, None]
        leaves.append(leaf(x, RNG.standard_normal((5, 4)), converged))
    whole = Tree(Node(i, 1, leaf) for i, leaf in enumerate(leaves)).total
    for ends in ([0, 11], [0, 1, 11], [0, 3, 4, 9, 11], range(12)):
        tree = Tree()
        for first, end in pairwise(ends):
            for node in Tree(Node(i, 1, leaves[i]) for i in range(first, end)).nodes:
                tree.add(node)
        for field in dataclasses.fields(whole):
            np.testing.assert_array_equal(
                getattr(tree.total, field.name), getattr(whole, field.name)
            )
    assert (whole.simulated, whole.converged) == (55, 43)
    with pytest.raises(ValueError, match="chunk 12 does not follow"):
        Tree([Node(0, 1, leaves[0])]).add(Node(12, 1, leaves[0]))


def test_merged_moments_are_those_of_all():
    """Though the means are far from zero, and the differences small."""
    y = 1e3 + RNG.standard_normal((100, 3))
    x = y + 1e-4 * RNG.standard_normal((100, 3))
    converged = np.arange(100) != 7
    parts = (np.split(each, 10) for each in (x, y, converged))
    tree = Tree(Node(i, 1, leaf(*part)) for i, part in enumerate(zip(*parts, strict=True)))
    total, whole = tree.total, leaf(x, y, converged)
    for name in ("difference", "linear", "squares", "linear_converged"):
        np.testing.assert_allclose(getattr(total, name), getattr(whole, name), rtol=1e-7)
    centred = y - y.mean(axis=0)
    np.testing.assert_allclose(total.squares[2], (centred**2).sum(axis=0), rtol=1e-10)
    np.testing.assert_allclose(total.difference, (x - y).mean(axis=0), rtol=1e-7)


# --- nothing is kept -----------------------------------------------------------------------------


def test_without_replicates_the_tables_are_the_same(kept, summed):
    """Bit by bit but for quantiles, which are within a thousandth of the exact ones."""
    assert "estimates" not in summed
    for name in ("cells", "summary", "correlations"):
        pd.testing.assert_frame_equal(summed[name], kept[name], check_exact=True)
    exact = [name for name in kept["leveling"] if "q95" not in name]
    pd.testing.assert_frame_equal(summed["leveling"][exact], kept["leveling"][exact])
    keys = ["cell", "quantity", "name", "probability"]
    both = kept["quantiles"].merge(summed["quantiles"], on=keys, suffixes=("", "_sketched"))
    assert len(both) == len(kept["quantiles"]) > 100
    assert (both["relative_error"] == 0).all()
    assert (both["relative_error_sketched"] == 2**-10).all()
    near = both[(both["quantity"] != "tilt") & (both["probability"] != 0.5)]
    np.testing.assert_allclose(near["value_sketched"], near["value"], rtol=0.002)


def test_many_kept_replicates_are_sketched(kept, monkeypatch, tmp_path):
    monkeypatch.setattr(distributions, "EXACT", 100)
    tables = run_study(tmp_path, batch_size=200, **SMALL)
    for name in ("cells", "summary", "correlations"):
        pd.testing.assert_frame_equal(tables[name], kept[name], check_exact=True)
    by_cell = tables["quantiles"].groupby("cell")["relative_error"].unique()
    assert by_cell["bias-scale/mclaren-24/robot"].tolist() == [2**-10]
    assert by_cell["bias-scale/faces-6/robot"].tolist() == [0.0]


def test_claims_need_no_replicates(tmp_path):
    """Each session with each, rather than those of one number: the same within Monte Carlo."""
    keys = {"grids": [grid(replicates=600)], "leveling": {"attitudes": 5}}
    ratios = {}
    for keep in ("replicates", "summary"):
        run_study(tmp_path / keep, batch_size=200, keep=keep, **keys)
        evidence = evidence_from(
            study_cells(make_study(**keys)), parts_in(tmp_path / keep),
            make_study(**keys).leveling.model_dump(), scheme="mclaren-24",
            correlations=None, sensitivity=None, shapley=None, base_samples=2, resamples=1, seed=1,
        )  # fmt: skip
        ratios[keep] = evidence.ratios["mclaren-24", "bias"]
    for p, limit in ((0.025, 0.08), (0.5, 0.04), (0.975, 0.08)):
        kept, summed = (float(ratio.at(p).value) for ratio in ratios.values())
        assert summed == pytest.approx(kept, rel=limit)
    assert ratios["summary"].share_below(0.6) == pytest.approx(
        ratios["replicates"].share_below(0.6), abs=0.06
    )


# --- jobs ----------------------------------------------------------------------------------------


def test_jobs_grow_with_the_study():
    """No study has more jobs than Snakemake can plan."""
    for count, jobs in ((10, 1), (10**6, 3), (10**8, 63), (10**11, 1954)):
        (batch,) = batches([*make_cells(grid(approaches="robot", replicates=count)).values()])
        assert len(batch.jobs) == pytest.approx(jobs, rel=0.01)
        first = [share.first for (share,) in batch.jobs]
        ends = [share.first + share.count for (share,) in batch.jobs]
        assert first == [0, *ends[:-1]]
        assert ends[-1] == batch.cells[0].n_chunks
    assert job_size([]) == 400_000
    few = [*make_cells(grid(schemes=[*KNOWN], replicates=2_000_000)).values()]
    assert job_size(few) == job_size(few[:-1]) == 800_000
