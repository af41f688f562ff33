"""Compositions in all that takes a model: commands, studies, batches and the round trip."""

import json

import pytest
import yaml
from click.testing import CliRunner
from study_helpers import content, grid

from accelstudy.campaign.batch_config import parse_batch
from accelstudy.cli import main
from accelstudy.diagnosis.round_trip import parse_round_trip
from accelstudy.errors import InputError
from accelstudy.figures.style import model_title
from accelstudy.study.cells import study_cells
from accelstudy.study.config import parse_study

NINE = "bias-scale-nonorthogonality"
HIDDEN = f"{NINE}+warm_up(tau=400)+thermal_bias"


def run(*arguments, code=0):
    result = CliRunner().invoke(main, [str(argument) for argument in arguments])
    assert result.exit_code == code, result.output
    return result.output


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A campaign of a sensor that warms up and whose bias follows the temperature."""
    folder = tmp_path_factory.mktemp("any-model")
    run(
        "simulate-campaign", "--out", folder / "c", "--truth", folder / "truth.yaml", "--seed", "4",
        "--scheme", "fibonacci-30", "--order", "random", "--temperature", "15:40",
        "--temperature-order", "ABBA", "--model", f"{NINE}+warm_up(tau=400)",
        "--effect", "thermal_bias",
    )  # fmt: skip
    return folder


def parameters(path):
    document = json.loads(path.read_text(encoding="utf-8"))
    return {p["name"]: (p["value"], p["sigma"]) for p in document["parameters"]}


def test_a_composition_is_calibrated_and_checked(made):
    truth = yaml.safe_load((made / "truth.yaml").read_text(encoding="utf-8"))
    known = {p["name"]: p["value"] for e in truth["sensor"] + truth["effects"]
             for p in e["parameters"]}  # fmt: skip
    run("calibrate", made / "c", "--model", HIDDEN, "--approach", "robot", "--out", made / "k")
    found = parameters(made / "k/calibration.json")
    assert set(found) == set(known)
    assert max(abs(value - known[name]) / sigma for name, (value, sigma) in found.items()) < 4.5
    document = json.loads((made / "k/calibration.json").read_text(encoding="utf-8"))
    assert document["model"] == HIDDEN
    assert document["quality"]["global_test"]["accepted"]
    assert 1 < document["quality"]["tilt_rms_mgon"]["roll"] < 20
    text = run("check-sigmas", made / "c", "--model", HIDDEN, "--replicates", "50")
    assert text.count("b_T_") == 3
    assert "thermal_scale" in run("effects", "--campaign", made / "c", "--model", HIDDEN)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["calibrate", "c", "--out", "no"], "no vibration_mps2"),
        (["diagnose", "c", "--out", "no"], "no vibration_mps2"),
        (["check-sigmas", "c"], "no vibration_mps2"),
        (["effects", "--campaign", "c"], "no vibration_mps2"),
        (["effects", "--scheme", "mclaren-24"], "which a scheme does not tell"),
        (["schemes", "mclaren-24"], "which a scheme does not tell"),
        (["simulate-campaign", "--out", "no"], "vibration: missing"),
    ],
)
def test_what_cannot_feed_a_model_says_so_in_one_line(arguments, words, made, monkeypatch):
    monkeypatch.chdir(made)
    text = run(*arguments, "--model", "bias-scale+vibration_rectification", code=2)
    assert "'vibration_rectification'" in text
    assert words in text
    assert text.count("\n") == 1
    assert not (made / "no").exists()


def test_a_study_of_compositions(tmp_path):
    path = tmp_path / "model.yaml"
    path.write_text(yaml.safe_dump({"models": {"mine": ["bias", "scale", "quadratic_scale"]}}))
    plain = parse_study(content(grids=[grid()]))
    study = parse_study(
        content(
            grids=[grid(), grid(models=[f"{NINE} + warm_up( tau=300 )", str(path)])],
            holds={"interval_s": 60},
        )
    )
    old, new = study_cells(plain), study_cells(study)
    assert [cell.model for cell in new[len(old) :: 2]] == [
        f"{NINE}+warm_up(tau=300)", "bias-scale+quadratic_scale",
    ]  # fmt: skip
    assert {cell.name for cell in old} < {cell.name for cell in new}
    assert new[len(old)].estimated_model.n_parameters == 12
    assert len({cell.name for cell in new}) == len(new)
    assert all(len(cell.name.split("/")) == 3 for cell in new)
    assert model_title(new[len(old)].model) == "9 + warm up(tau=300)"
    # The condition of the holds is part of a cell, so seeds are compared without it.
    beside = parse_study(content(grids=[grid(), grid(models="bias-scale+quadratic_scale")]))
    seeds = {cell.name: cell.seed(1, 0).entropy for cell in study_cells(beside)}
    assert all(seeds[cell.name] == cell.seed(1, 0).entropy for cell in old)
    with pytest.raises(InputError, match=r"holds\.interval_s: missing; the effect 'warm_up'"):
        parse_study(content(grids=[grid(models=f"{NINE}+warm_up(tau=300)")]))
    with pytest.raises(InputError, match=r"grids\.0\.models.*unknown model or effect 'warmup'"):
        parse_study(content(grids=[grid(models=f"{NINE}+warmup")]))


def test_the_sensitivity_of_a_composition():
    name = f"{NINE}+quadratic_scale+cubic_scale"
    settings = {"roll_gon": [0], "pitch_gon": [0], "model": "bias+scale + nonorthogonality"}
    study = parse_study(content(grids=[grid()], sensitivity=settings))
    assert study.sensitivity.model == NINE
    settings["model"] = f"{NINE}+ cross_coupling"
    study = parse_study(content(grids=[grid(models=settings["model"])], sensitivity=settings))
    assert study.sensitivity.model == study_cells(study)[0].model == f"{NINE}+cross_coupling"
    assert parse_study(content(grids=[grid(models=name)])).grids[0].models == [
        f"{NINE}-quadratic-cubic"
    ]


def test_batches_and_the_round_trip_take_a_composition():
    batch = parse_batch({"batch": "b", "model": f"{NINE} +thermal_bias",
                         "campaigns": [{"campaign": "c"}]})  # fmt: skip
    assert batch.tasks()[0].model == f"{NINE}+thermal_bias"
    with pytest.raises(InputError, match="model: unknown model or effect 'thermal'"):
        parse_batch({"batch": "b", "model": f"{NINE}+thermal", "campaigns": [{"campaign": "c"}]})
    trip = parse_round_trip({"campaign": {"name": "t"}, "model": "bias+scale"})
    assert trip.model == "bias-scale"
