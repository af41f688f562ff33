"""The profile for SLURM fits the workflow; study/test_new_study.py plans a study with it."""

import re

import yaml
from places import ROOT

RULE = re.compile(
    r"^(?:rule|use rule \w+ as) (\w+)(?: with)?:\n(.*?)(?=^\S|\Z)", re.MULTILINE | re.DOTALL
)
INCLUDED = re.compile(r'^include: "(rules/\w+.smk)"', re.MULTILINE)


def rules(*files):
    return {name: text for path in files for name, text in RULE.findall(path.read_text())}


WORKFLOW = ROOT / "workflow"
STUDY = rules(*(WORKFLOW / name for name in INCLUDED.findall((WORKFLOW / "Snakefile").read_text())))
HIDDEN = rules(ROOT / "studies" / "hidden" / "hidden.smk")


def profile(name):
    return yaml.safe_load((ROOT / "profiles" / name / "config.yaml").read_text())


def test_the_profile_names_rules_that_there_are_and_groups_those_of_a_study():
    settings = profile("slurm")
    assert set(STUDY) <= set(settings["groups"]) <= {*STUDY, *HIDDEN}
    assert set(settings.get("set-resources", {})) <= set(settings["groups"])
    assert set(settings["group-components"]) == set(settings["groups"].values())


def test_another_attempt_gets_more_memory():
    assert "attempt" in profile("slurm")["default-resources"]["mem_mb"]
    assert re.search(r"mem_mb=lambda wildcards, attempt: .* \* attempt,", STUDY["simulate"])
