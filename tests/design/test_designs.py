"""The command `design`, its file, and where a scheme of a file is used."""

import pickle

import numpy as np
import pytest
import yaml
from calling import succeed
from study_helpers import make_study
from usual import NINE, ROBOT

from accelstudy import find_positions
from accelstudy.basics.errors import InputError
from accelstudy.basics.units import GON, MGON
from accelstudy.design.estimability import estimability
from accelstudy.design.order import _drift_shown, field_order
from accelstudy.design.task import Task
from accelstudy.leveling.error import cap_forces, tilt_error
from accelstudy.schemes import files, get_scheme
from accelstudy.study.config import parse_study


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A design, and what the command said."""
    path = tmp_path_factory.mktemp("designs") / "mine.yaml"
    said = succeed("design", "--positions", 8, "--tilt-range", "30gon", "--starts", 1,
               "--pole-distance", "15gon", "--roll", "-110gon", "110gon",
               "--out", path)  # fmt: skip
    return path, said.output


def test_a_design_says_what_it_brings(made):
    path, said = made
    scheme = get_scheme(str(path))
    zero, f_b = np.zeros(9), cap_forces(30 * GON, 200)
    error = tilt_error(NINE, zero, NINE, zero, f_b)
    for directions, line in {
        scheme: "these 8 positions",
        get_scheme("mclaren-24"): "the 24 of",
    }.items():
        roll, pitch = error.rms_of_all(estimability(directions, NINE, ROBOT).cofactors)
        expected = f": roll {roll / MGON:.2f} mgon, pitch {pitch / MGON:.2f} mgon"
        assert any(line in row and expected in row for row in said.splitlines())
    content = yaml.safe_load(path.read_text(encoding="utf-8"))
    assert content["design"]["rms_roll_mgon"] == pytest.approx(
        error.rms_of_all(estimability(scheme, NINE, ROBOT).cofactors)[0] / MGON,
        rel=1e-5,
    )
    assert 0.5 < content["design"]["efficiency"] <= 1
    rolls = [row["roll_gon"] for row in content["positions"]]
    assert min(rolls) >= -110.001


def test_a_design_is_made_again_to_the_bit(tmp_path):
    asked = ["design", "--positions", 9, "--starts", 1, "--attitudes", "cube", "--out"]
    path, copy = tmp_path / "mine.yaml", tmp_path / "other/mine.yaml"
    copy.parent.mkdir()
    succeed(*asked, path)
    before = path.read_bytes()
    succeed(*asked, copy)
    assert copy.read_bytes() == before


def study(path, **more):
    grid = {"models": "bias-scale", "schemes": [str(path)], "approaches": "robot", "replicates": 2}
    return parse_study({"study": "own", "seed": 1, "grids": [grid], **more})


def test_a_study_depends_on_what_the_file_holds(tmp_path):
    path = tmp_path / "some.yaml"

    def write(*directions):
        path.write_text(yaml.safe_dump({"scheme": "mine", "directions": directions}))
        return study(path)

    (cell,) = write([0, 0, 2], [0, 1, 0], [1, 0, 0], [0, -1, 0]).cells
    assert cell.scheme.startswith("mine@")
    np.testing.assert_array_equal(cell.positions.directions[0], [0, 0, 1])
    (other,) = write([0, 0, 2], [0, 1, 0], [1, 0, 0], [0, 1, 1]).cells
    assert other.scheme != cell.scheme
    assert other.seed(1, 0).entropy != cell.seed(1, 0).entropy
    moved = path.rename(tmp_path / "elsewhere.yaml")
    assert study(moved).cells == [other]


def test_a_job_needs_no_file(tmp_path, monkeypatch):
    path = tmp_path / "some.yaml"
    path.write_text("directions: [[0, 0, 1], [0, 1, 0], [1, 0, 0]]\n")
    (cell,) = study(path).cells
    path.unlink()
    monkeypatch.setattr(files, "_read", {})
    same = pickle.loads(pickle.dumps(cell))
    assert same == cell
    np.testing.assert_array_equal(same.positions.directions, np.eye(3)[::-1])
    with pytest.raises(InputError, match="unknown scheme 'some@"):
        get_scheme(cell.scheme)
    assert make_study().cells[0].directions is None  # of schemes that come along


def test_what_was_measured_before_counts():
    """Six faces leave the angles between the axes open, and six more positions determine them."""
    asked = {"positions": 6, "approach": "gravity", "starts": 1}
    assert find_positions(after="faces-6", **asked).state == "found"


def test_the_order_is_a_round_trip_of_small_turns():
    task, directions = Task(NINE, ROBOT), get_scheme("random-16-3").directions
    order = field_order(task, directions)
    assert sorted(order) == list(range(16))

    def length(tour):
        cosines = np.sum(directions[tour] * directions[np.roll(tour, -1)], axis=1)
        return np.arccos(np.clip(cosines, -1, 1)).sum()

    rng = np.random.default_rng(1)
    assert length(order) < 0.85 * min(length(rng.permutation(16)) for _ in range(200))
    sweep = np.argsort(directions[:, 0])
    ordered, swept = _drift_shown(task, directions[[order, sweep]])
    assert ordered > 3 * swept
