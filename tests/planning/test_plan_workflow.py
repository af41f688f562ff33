"""The workflow of a plan: what it makes, and what it says of a bad configuration."""

import re

import pytest
import yaml
from places import ROOT
from snakemake_helpers import one_line, snakemake

from accelstudy.basics.errors import InputError
from accelstudy.files.layers import read_layer
from accelstudy.plan.batch.config import PlanConfig
from accelstudy.plan.batch.example import parse_example, parse_section


def run(folder, config, *words):
    (folder / "tiny.yaml").write_text(yaml.safe_dump(config), encoding="utf-8")
    fixed = ["--snakefile", ROOT / "workflow" / "plan.smk", "--cores", 1]
    return snakemake(folder, *fixed, "--configfile", "tiny.yaml", *words)


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
    sections = {"plan": {"sensors": "adxl355"}, "pole": {"cases": {"gnss": {}}}}
    for name, rule in (("plan", "plan_sensors"), ("pole", "pole")):
        text = run(tmp_path, {"study": "tiny", name: sections[name]}, "--dry-run").stdout
        assert re.findall(r"^(\w+) +\d+$", text, re.MULTILINE) == [rule, "plan_example", "total"]


def test_the_workflow_says_it_too(tmp_path):
    result = run(tmp_path, {"study": "tiny", "plan": {"sensors": ["adxl35"]}})
    assert result.returncode == 1
    one_line(result.stdout, "tiny.yaml: plan.sensors: unknown sensor 'adxl35'")
    assert not (tmp_path / "results").exists()
