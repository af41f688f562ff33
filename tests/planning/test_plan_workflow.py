"""The workflow of a plan: what it makes, and what it says of a bad configuration."""

from functools import partial

import pytest
from places import ROOT
from snakemake_helpers import jobs, one_line, run_workflow

from accelstudy.basics.errors import InputError
from accelstudy.files.layers import read_layer
from accelstudy.plan.batch.config import PlanConfig
from accelstudy.plan.batch.example import parse_example, parse_section

run = partial(run_workflow, "plan")


def test_the_example_can_be_used():
    example = parse_example(read_layer(ROOT / "config/plan-example.yaml"))
    assert parse_section(example, "plan", PlanConfig).chosen_sensors


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ({"study": "x", "plam": {}}, "mine: plam: unknown key; did you mean 'plan'?"),
        ({"study": "a/b"}, "mine: study: "),
        ({"study": "x", "plan": {"sensor": "paper"}}, "mine: plan.sensor: unknown key; did you"),
        ({"study": "x", "plan": {"sensors": "adxl35"}}, "did you mean 'adxl355'?"),
        ({"study": "x", "plan": 5}, "mine: plan: "),
        ({"study": "x"}, "mine: nothing to do; give at least one of plan, designs, "),
    ],
)
def test_what_cannot_be_used_is_said_in_a_line(content, message):
    with pytest.raises(InputError) as error:
        parse_section(parse_example(content, "mine"), "plan", PlanConfig, "mine")
    assert message in str(error.value)
    assert "\n" not in str(error.value)


def test_a_section_alone_runs_only_its_rules(tmp_path):
    config = {"study": "tiny", "pole": {"cases": {"gnss": {}, "again": {}}}}
    assert jobs(run(tmp_path, config, "--dry-run").stdout) == {"pole": 2}


def test_the_workflow_says_it_too(tmp_path):
    result = run(tmp_path, {"study": "tiny", "plan": {"sensors": ["adxl35"]}})
    assert result.returncode == 1
    one_line(result.stdout, "tiny.yaml: plan.sensors: unknown sensor 'adxl35'")
    assert not (tmp_path / "results").exists()
