"""What `accelstudy init` writes is a study that is ready to run, and overwrites nothing."""

import importlib.util

import pytest
from calling import call
from snakemake_helpers import snakemake

from accelstudy.study.config import read_study
from accelstudy.study.figures import figure_names


def init(*arguments):
    return call("init", *arguments)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("init") / "My sensor 2.0"
    result = init(folder)
    assert result.exit_code == 0, result.output
    assert str(folder / "results" / "My-sensor-2-0") in result.output
    return folder


def test_the_configuration_is_a_study_with_figures(folder):
    study = read_study(folder / "config" / "config.yaml")
    assert study.study == "My-sensor-2-0"
    assert {"closed-forms", "leveling-overview", "sweep-positions"} <= {*figure_names(study)}


def test_the_workflow_takes_it_from_there(folder):
    planned = snakemake(folder, "--dry-run", "--cores", "1")
    assert planned.returncode == 0, planned.stdout
    for rule in ("simulate", "summarise", "collect", "figures", "study"):
        assert f"\n{rule} " in planned.stdout


def test_nothing_is_overwritten(folder):
    config = folder / "config" / "config.yaml"
    before = config.read_text(encoding="utf-8")
    config.write_text(before.replace("seed: 1", "seed: 2"), encoding="utf-8")
    result = init(folder)
    assert result.exit_code == 2
    (line,) = result.stderr.splitlines()
    assert line.startswith(f"error: {folder}: is not empty")
    assert "seed: 2" in config.read_text(encoding="utf-8")
    assert init(folder, "--force").exit_code == 0
    assert config.read_text(encoding="utf-8") == before


def test_without_snakemake_one_line_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    result = init(tmp_path / "new")
    assert result.exit_code == 0
    (line,) = result.stderr.splitlines()
    assert "pip install 'accelstudy[workflow]'" in line
