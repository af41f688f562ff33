"""What `accelstudy init` writes is a study that is ready to run, and overwrites nothing."""

import importlib.util

import numpy as np
import pytest
from calling import call, refusal
from places import ROOT
from snakemake_helpers import snakemake

import accelstudy as acs
from accelstudy.basics.units import MGON
from accelstudy.campaign.format import write_campaign
from accelstudy.files.reading import read_layer
from accelstudy.study.config import read_study
from accelstudy.study.figures import figure_names
from accelstudy.study.new_study import TEMPLATES


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
    (line,) = result.stderr.splitlines()
    assert "pip install 'accelstudy[workflow]'" in line


# --- templates and sensors -----------------------------------------------------------------------


@pytest.mark.parametrize("template", TEMPLATES)
def test_each_template_is_planned_by_its_workflow_with_all_profiles(template, tmp_path):
    init(tmp_path / "mine", "--template", template)
    profiles = {p.relative_to(ROOT) for p in (ROOT / "profiles").rglob("*.yaml")}
    for profile in profiles:
        text = (ROOT / profile).read_text(encoding="utf-8")
        assert (tmp_path / "mine" / profile).read_text(encoding="utf-8") == text
    planned = snakemake(tmp_path / "mine", "--profile", "profiles/slurm", "--dry-run")
    assert planned.returncode == 0, planned.stdout
    assert (
        f"All results of the {'batch' if template == 'campaigns' else template} mine"
        in planned.stdout
    )
    assert "snakemake --cores 2 " in (tmp_path / "mine" / "README.md").read_text("utf-8")


def test_the_noise_of_a_data_sheet_is_that_of_a_usual_hold(tmp_path):
    (tmp_path / "box.yaml").write_text(
        "velocity_random_walk: 1 mm/s^2/sqrt(Hz)\nscale: 3000 ppm\n", encoding="utf-8"
    )
    init(tmp_path / "mine", "--sensor", tmp_path / "box.yaml")
    study = read_study(tmp_path / "mine" / "config" / "config.yaml")
    assert study.noise.sensor.sigma_mps2 == pytest.approx(1e-3 / np.sqrt(10), rel=1e-3)
    assert study.sensor["scale"].value == [3000, -3000, 3000]
    assert study.sensor["bias"].value == [0.05, 0.01, 0.03]  # of the paper


def test_a_campaign_brings_noise_gravity_positions_and_what_its_calibration_finds(tmp_path):
    effects = ("bias: 0.12, -0.07, 0.2", "scale: 0.003, -0.002, 0.001")
    campaign = acs.simulate_campaign(
        name="box", scheme="fibonacci-30", effects=effects, sigma=1e-5, gravity=9.81,
        robot_sigma=MGON,
    )  # fmt: skip
    folder = tmp_path / "a box: 1"
    write_campaign(campaign, folder)
    for template in TEMPLATES:
        init(tmp_path / template, "--template", template, "--sensor", folder)
    study = read_study(tmp_path / "study" / "config" / "config.yaml")
    assert study.noise.sensor.sigma_mps2 == 1e-5
    assert study.noise.robot.sigma_mgon == pytest.approx(1)
    assert study.gravity_mps2 == 9.81
    assert study.sensor["bias"].value == pytest.approx([0.12, -0.07, 0.2], abs=1e-4)
    assert study.sensor["scale"].value == pytest.approx([3000, -2000, 1000], abs=10)
    (measured,) = read_layer(tmp_path / "campaigns/config/config.yaml")["campaigns"]
    assert measured["campaign"] == str(folder)


@pytest.mark.parametrize(("words", "reason"), [
    (("--template", "plan"), "--template plan: no longer a template; `accelstudy plan` needs"),
    (("--template", "studio"), "unknown template 'studio'; did you mean 'study'?"),
    (("--sensor", "adxl-355"), "unknown sensor 'adxl-355'; did you mean 'adxl355'?"),
    (("--sensor", "."), "campaign.yaml: no such file"),
    (("--sensor", "no.yaml"), "no.yaml: no such file"),
])  # fmt: skip
def test_what_there_is_not_is_one_line(words, reason, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert reason in refusal("init", "new", *words)
    assert not (tmp_path / "new").exists()
