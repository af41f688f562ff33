"""What `accelstudy init` writes is a study that is ready to run, and overwrites nothing."""

import importlib.util

import pytest
from calling import call, refusal
from places import ROOT
from snakemake_helpers import snakemake

from accelstudy.study.config import read_study
from accelstudy.study.figures import figure_names


def init(*arguments):
    return call("init", *arguments)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("init") / "2026.11.29"
    result = init(folder)
    assert result.exit_code == 0, result.output
    assert str(folder / "results" / "2026-11-29") in result.output
    return folder


def test_the_configuration_is_a_study_with_figures(folder):
    study = read_study(folder / "config" / "config.yaml")
    assert study.study == "2026-11-29"  # no date
    assert {"leveling-overview", "sweep-positions"} <= {*figure_names(study)}


def test_nothing_is_overwritten(folder):
    config = folder / "config" / "config.yaml"
    before = config.read_text(encoding="utf-8")
    config.write_text(before.replace("seed: 1", "seed: 2"), encoding="utf-8")
    assert refusal("init", folder).startswith(f"error: {folder}: is not empty")
    assert "seed: 2" in config.read_text(encoding="utf-8")
    assert init(folder, "--force").exit_code == 0
    assert config.read_text(encoding="utf-8") == before


def test_without_snakemake_one_line_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    result = init(tmp_path / "new")
    assert result.exit_code == 0
    (line,) = (line for line in result.output.splitlines() if "missing" in line)
    assert "pip install 'accelstudy[workflow]'" in line


# --- what it is -----------------------------------------------------------------------------------


def test_a_new_study_is_planned_by_its_workflow_with_all_profiles(tmp_path):
    init(tmp_path / "mine")
    profiles = {p.relative_to(ROOT) for p in (ROOT / "profiles").rglob("*.yaml")}
    for profile in profiles:
        text = (ROOT / profile).read_text(encoding="utf-8")
        assert (tmp_path / "mine" / profile).read_text(encoding="utf-8") == text
    planned = snakemake(tmp_path / "mine", "--profile", "profiles/slurm", "--dry-run")
    assert planned.returncode == 0, planned.stdout
    assert "All results of the study mine" in planned.stdout
    assert "snakemake --cores 2 " in (tmp_path / "mine" / "README.md").read_text("utf-8")
