"""What a study takes is said before it starts, and what no machine can do is refused."""

import pytest
import yaml
from calling import call
from places import ROOT
from study_helpers import content, grid, make_study

from accelstudy.basics.errors import InputError
from accelstudy.study.cells import study_cells
from accelstudy.study.config import read_study
from accelstudy.study.effort import study_effort


def effort(**keys):
    study = make_study(**keys)
    return study_effort(study, study_cells(study))


def test_the_study_of_the_paper():
    """It was measured to take about 80 s of processor time, and 0.07 GB of estimates."""
    study = read_study(ROOT / "config" / "config.yaml")
    found = study_effort(study, study_cells(study))
    assert found.cells >= 192
    assert 40 < found.seconds < 200
    assert 0.04e9 < found.disk < 0.15e9


def test_it_grows_with_the_work():
    small, large = (effort(grids=[grid(replicates=n)]) for n in (10_000, 1_000_000))
    assert large.calibrations == 100 * small.calibrations
    assert large.disk == 100 * small.disk
    assert large.seconds > 2 * small.seconds


def test_memory_and_disk_do_not_grow_where_nothing_is_kept():
    cells = grid(replicates=10_000), grid(replicates=10**9)
    small, large = (effort(grids=[cell], keep="summary") for cell in cells)
    assert large.memory == small.memory < 1e9
    assert large.disk < 1e9 < effort(grids=[cells[1]]).disk
    # Those that are kept for exact quantiles have a bound.
    assert effort(grids=[cells[1]]).memory < 1e9


def test_a_hundred_billion_calibrations_can_be_said():
    found = effort(grids=[grid(approaches="gravity", replicates=10**11)], keep="summary")
    assert found.calibrations == 10**11
    assert 100 < found.seconds / 3600 < 5000


@pytest.mark.parametrize(("keys", "words"), [
    ({"grids": [grid(replicates=10**9, sensor_sigma_mps2=[1e-3 * i for i in range(1, 5000)])]},
     ["grids", "calibrations", "lower replicates", "keep: summary"]),
    (
        {
            "grids": [
                grid(
                    sensor_sigma_mps2=[1e-3 * i for i in range(1, 1000)],
                    gravity_sigma_mps2=[1e-6 * i for i in range(1, 1000)],
                ),
            ],
        },
        ["grids.0: number of cells: must be from 1 to 100000"],
    ),
])  # fmt: skip
def test_what_no_machine_can_do(keys, words):
    with pytest.raises(InputError) as error:
        effort(**keys)
    for word in words:
        assert word in str(error.value)


def test_cells_says_it(tmp_path):
    (tmp_path / "tiny.yaml").write_text(yaml.safe_dump(content()), encoding="utf-8")
    result = call("cells", tmp_path / "tiny.yaml")
    assert result.exit_code == 0, result.output
    last = result.stdout.splitlines()[-1]
    assert "calibrations: about" in last
    assert "on one core" in last
