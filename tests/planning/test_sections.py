"""The configuration of plans: the example can be used, and what cannot be is said in a line."""

import pytest
from calling import refused
from places import ROOT
from snakemake_helpers import jobs, one_line, run_workflow

from accelstudy.basics.errors import InputError
from accelstudy.files.reading import read_layer
from accelstudy.planning.config import PlanConfig, parse_example, parse_section
from accelstudy.sequential.config import SequentialConfig
from accelstudy.sequential.simulation import SetUp

CLASSES = {
    "plan": PlanConfig,
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
    ("pole", {}, "file: pole: no longer a key; examples/pole works it out"),
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
    asked = {"tilt_accuracy": "10mgon", "sensor": "adxl355"}
    config = {"study": "tiny", "plan": {"cases": {"one": asked, "again": {**asked}}}}
    assert jobs(run_workflow("plan", tmp_path, config, "--dry-run").stdout) == {"plan": 2}


def test_without_a_section_there_is_nothing_to_do():
    with pytest.raises(InputError, match="nothing to do; give at least one of plan, designs, "):
        parse_example({"study": "x"})


def test_a_fixed_scheme_must_determine_the_model():
    with pytest.raises(InputError, match=r"sequential\.instead_of: faces-6: rank 6 of 9"):
        _ = SetUp(SequentialConfig(instead_of="faces-6"), "gravity", "known", 1.0).promise
