"""What `accelstudy init` writes is a study that is ready to run, and overwrites nothing."""

import importlib.util

import pytest
from calling import refusal, succeed
from places import ROOT
from snakemake_helpers import snakemake

from accelstudy.study.config import read_study
from accelstudy.study.figures import figure_names


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("init") / "2026.11.29"
    assert str(folder / "results" / "2026-11-29") in succeed("init", folder).output
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
    succeed("init", folder, "--force")
    assert config.read_text(encoding="utf-8") == before


def test_without_snakemake_one_line_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    output = succeed("init", tmp_path / "new").output
    (line,) = (line for line in output.splitlines() if "missing" in line)
    assert "pip install 'accelstudy[workflow]'" in line


# --- what it is -----------------------------------------------------------------------------------


def test_a_new_study_is_planned_by_its_workflow_with_all_profiles(folder):
    profiles = {p.relative_to(ROOT) for p in (ROOT / "profiles").rglob("*.yaml")}
    for profile in profiles:
        text = (ROOT / profile).read_text(encoding="utf-8")
        assert (folder / profile).read_text(encoding="utf-8") == text
    planned = snakemake(folder, "--profile", "profiles/slurm", "--dry-run")
    assert planned.returncode == 0, planned.stdout
    assert "All results of the study 2026-11-29" in planned.stdout
    assert not (folder / "results").exists()
    assert "snakemake --cores 2 " in (folder / "README.md").read_text("utf-8")
