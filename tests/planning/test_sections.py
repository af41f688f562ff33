"""The configuration of plans: the example can be used, and what cannot be is said in a line."""

import json

import pytest
from calling import refused
from places import ROOT
from snakemake_helpers import jobs, one_line, run_workflow

from accelstudy.basics.errors import InputError
from accelstudy.basics.units import MGON
from accelstudy.files.reading import read_layer
from accelstudy.files.tables import read_origin
from accelstudy.planning.config import PlanConfig, parse_example, parse_section
from accelstudy.pole import output as pole
from accelstudy.pole.config import PoleConfig
from accelstudy.sequential.config import SequentialConfig
from accelstudy.sequential.simulation import SetUp

CLASSES = {
    "plan": PlanConfig,
    "pole": PoleConfig,
    "sequential": SequentialConfig,
}


def of_example(section):
    example = parse_example(read_layer(ROOT / "config/plan-example.yaml"))
    return parse_section(example, section, CLASSES[section])


def case(section, content):
    """A single case of a section."""
    example = parse_example({"study": "x", section: {"cases": {"mine": content}}}, "file")
    return parse_section(example, section, CLASSES[section], "file").cases["mine"]


@pytest.mark.parametrize(("section", "content", "message"), [
    ("plam", {}, "file: plam: unknown key; did you mean 'plan'?"),
    ("study", "a/b", "file: study: "),
    ("plan", {"sensor": "paper"}, "file: plan.sensor: unknown key (known: cases, "),
    ("plan", {"sensors": "all"}, "file: plan.sensors: no longer a key; plan each sensor as a case"),
    ("field", {}, "file: field: no longer a key; `accelstudy plan` says"),
    ("plan", 5, "file: plan: "),
    ("sequential", {"approaches": "robots"}, "unknown approach 'robots'; did you mean 'robot'?"),
    ("sequential", {"rules": ["bounds"]}, "unknown rule 'bounds'; did you mean 'bound'?"),
    ("sequential", {"instead_of": "mclaren"}, "unknown scheme 'mclaren'"),
    ("sequential", {"model": "bias-scale+warm_up"}, "needs the time of each position"),
    ("sequential", {"session": 3}, "sequential.session: unknown key; did you mean 'sessions'?"),
    ("sequential", {"accuracies": 0}, "sequential.accuracies: must be greater"),
])  # fmt: skip
def test_a_section_that_cannot_be_used_is_said_in_a_line(section, content, message):
    with refused(message):
        parse_section(
            parse_example({"study": "x", section: content}, "file"),
            section,
            CLASSES.get(section, PlanConfig),
            "file",
        )


@pytest.mark.parametrize(("section", "content", "message"), [
    ("plan", {"tilt_accuracy": "9", "sigma": "1mg"}, "tilt_accuracy: expected a number with"),
    ("plan", {"tilt_accuracy": "9mgon", "sigma": "0mm/s2"}, "sigma: '0mm/s2': must be at"),
    ("plan", {"tilt_accuracy": "9mgon"}, "give sensor or sigma, one of them"),
    ("pole", {"sensr": "paper"}, "file: pole.cases.mine.sensr: unknown key"),
    ("pole", {"sensor": "papr"}, "file: pole.cases.mine: sensor: unknown sensor 'papr'; did"),
    ("pole", {"setup": {"length": "2"}}, "mine: setup: length: expected a number with its"),
    ("pole", {"setup": {"long": "2m"}}, "mine: setup: unknown quantity of a pole 'long'"),
    ("pole", {"hold": "2m"}, "mine: hold: '2m': the unit must be one of"),
    ("pole", {"calibration": "c.json", "hold": "2s"}, "calibration and hold exclude each"),
    ("pole", {"tilt_sigma": "10"}, "mine: tilt_sigma: expected a number with its unit"),
])  # fmt: skip
def test_a_case_that_cannot_be_used_is_said_in_a_line(section, content, message):
    with refused(message):
        case(section, content)


def test_the_workflow_says_it_too(tmp_path):
    result = run_workflow(
        "plan",
        tmp_path,
        {"study": "tiny", "plan": {"cases": {"a": {"tilt_accuracy": "1mgon", "sensor": "adxl35"}}}},
    )
    assert result.returncode == 1
    one_line(result.stdout, "tiny.yaml: plan.cases.a: unknown sensor 'adxl35'")
    assert not (tmp_path / "results").exists()


def test_a_section_alone_runs_only_its_rules(tmp_path):
    config = {"study": "tiny", "pole": {"cases": {"gnss": {}, "again": {}}}}
    assert jobs(run_workflow("plan", tmp_path, config, "--dry-run").stdout) == {"pole": 2}


def test_without_a_section_there_is_nothing_to_do():
    with pytest.raises(InputError, match="nothing to do; give at least one of plan, designs, "):
        parse_example({"study": "x"})


def test_a_fixed_scheme_must_determine_the_model():
    with pytest.raises(InputError, match=r"sequential\.instead_of: faces-6: rank 6 of 9"):
        _ = SetUp(SequentialConfig(instead_of="faces-6"), "gravity", "known", 1.0).promise


def test_the_pole_of_the_example_is_worked_out(tmp_path, monkeypatch):
    monkeypatch.setattr(pole, "save", lambda *_: "")
    station = of_example("pole").cases["total-station"].model_copy(update={"replicates": 10})
    station.write(3, tmp_path, {"config_hash": "abc", "seed": 3})
    assert read_origin(tmp_path / "budget.parquet")["config_hash"] == "abc"
    content = json.loads((tmp_path / "pole.json").read_text(encoding="utf-8"))
    assert content["setup_si"]["length"] == 1.5
    assert content["seed"] == 3
    assert station.files == []


def test_a_pole_takes_sigmas_of_roll_and_pitch_and_files_of_ones_own():
    sensor = case("pole", {"tilt_sigma": "10mgon"}).calibrated_sensor()
    assert sensor.tilt_sigma == pytest.approx(10 * MGON)
    assert case("pole", {"calibration": "c.json"}).files == ["c.json"]
