"""What the documentation says of tables is what a study writes.

`make docs` checks the rest: links, anchors, and the files, commands and options that pages name.
"""

import sys

import pytest
from places import ROOT
from study_helpers import grid, make_study, run_study

from accelstudy.files.tables import read_table
from accelstudy.study.results.sensitivity import analyse_sensitivity, analyse_shapley

SENSITIVITY = {"base_samples": 2, "resamples": 2, "roll_gon": 10, "pitch_gon": 0}
PROVENANCE = {"config_hash": "0123456789abcdef", "seed": 1}


@pytest.fixture(scope="module")
def described():
    sys.path.insert(0, str(ROOT / "docs/hooks"))
    try:
        from file_formats import study_tables
    finally:
        sys.path.pop(0)
    return {name: list(columns) for name, (_, columns) in study_tables().items()}


def test_each_column_of_a_study_is_described(tmp_path, described):
    keys = {"grids": [grid(replicates=20)], "sensitivity": SENSITIVITY}
    written = run_study(tmp_path, **keys)
    study, summary = make_study(**keys), tmp_path / "summary.parquet"
    path = tmp_path / "sensitivity.parquet"
    analyse_sensitivity(study, summary, path, PROVENANCE)
    written["sensitivity"] = read_table(path)
    correlations, path = tmp_path / "correlations.parquet", tmp_path / "shapley.parquet"
    analyse_shapley(study, summary, correlations, path, PROVENANCE)
    written["shapley"] = read_table(path)
    for name, table in written.items():
        assert described[name] == list(table), name
