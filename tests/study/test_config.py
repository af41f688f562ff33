"""Configurations: those of the repository are valid, and bad ones end with one clear line."""

import json

import pytest
import yaml
from calling import call
from places import ROOT
from snakemake.exceptions import WorkflowError
from snakemake.utils import validate
from study_helpers import NINE, content, grid, make_study

from accelstudy.approaches import approach_names, get_approach
from accelstudy.basics.errors import InputError
from accelstudy.basics.units import MGON
from accelstudy.files.reading import config_hash, overlay, read_layer
from accelstudy.noise_effects import get_noise_effect
from accelstudy.schemes import get_scheme
from accelstudy.sensors.models import get_model
from accelstudy.study.config import Study, config_schema, parse_study, read_study

CONFIG = ROOT / "config" / "config.yaml"
OVERLAYS = [ROOT / "config" / "smoke.yaml", *sorted((ROOT / "config" / "sweeps").glob("*.yaml"))]


# --- the files of the repository -----------------------------------------------------------------


def test_the_study_of_the_paper():
    study = read_study(CONFIG)
    assert study.gravity_mps2 == 9.80665
    assert (study.noise.sensor.sigma_mps2, study.noise.robot.sigma_mgon) == (0.002, 3.2)
    truth = study.truth(["bias", "scale", "nonorthogonality"])
    assert [truth[f"b_{axis}"] for axis in "xyz"] == [0.05, 0.01, 0.03]
    assert [truth[f"s_{axis}"] for axis in "xyz"] == pytest.approx(3 * [200e-6], rel=1e-14)
    assert truth["alpha_zx"] == pytest.approx(44 * MGON, rel=1e-14)


@pytest.mark.parametrize("path", [CONFIG, *OVERLAYS], ids=lambda path: path.stem)
def test_each_is_a_study_and_one_again_with_all_defaults_written_out(path):
    """As jobs get it."""
    study = read_study(CONFIG, path)
    assert (study.study == "paper") == (path == CONFIG)
    assert study.cells
    paper = read_study(CONFIG).sensor
    assert {name: study.sensor[name] for name in paper} == paper
    assert parse_study(study.model_dump(mode="json")) == study


def test_overlay_replaces_lists_and_merges_mappings(tmp_path):
    over = tmp_path / "over.yaml"
    over.write_text("noise: {robot: {sigma_mgon: 7}}\nsensor: {bias: {value: [1, 2, 3]}}\n")
    study = read_study(CONFIG, over)
    assert study.noise.robot.sigma_mgon == 7
    assert study.noise.sensor.sigma_mps2 == 0.002
    assert study.sensor["bias"].model_dump() == {"value": [1, 2, 3], "unit": "m/s^2"}


def test_the_schema_file_is_that_of_the_models():
    """Regenerate with `accelstudy config-schema > workflow/schemas/config.schema.json`."""
    printed = call("config-schema")
    assert printed.exit_code == 0
    path = ROOT / "workflow" / "schemas" / "config.schema.json"
    assert path.read_text(encoding="utf-8") == printed.stdout
    assert json.loads(printed.stdout) == config_schema()


def test_the_schema_accepts_what_the_models_accept():
    schema = str(ROOT / "workflow" / "schemas" / "config.schema.json")
    base = yaml.safe_load(CONFIG.read_text())
    validate(base, schema, set_default=False)
    for path in OVERLAYS:
        validate(overlay(base, read_layer(path)), schema, set_default=False)
    for changes in ({"seeed": 1}, {"grids": [grid(models=[])]}, {"seed": -1}):
        with pytest.raises(WorkflowError):
            validate({**base, **changes}, schema, set_default=False)


def test_the_schema_explains_every_key():
    schema = config_schema()
    for block in (schema, *schema["$defs"].values()):
        assert block["description"]
        for name, key in block["properties"].items():
            assert "description" in key or "$ref" in key, name
        assert block["additionalProperties"] is False


def test_config_yaml_has_every_top_level_key():
    assert set(yaml.safe_load(CONFIG.read_text())) == set(Study.model_fields)


# --- what is accepted ----------------------------------------------------------------------------


def test_one_may_stand_for_a_list():
    values = {"models": "mine", "schemes": "rings-24", "approaches": "robot", "robot_sigma_mgon": 2}
    one, many = (
        make_study(
            models={"mine": of("bias")},
            simulated_effects=of("bias"),
            grids=[grid(**{key: of(value) for key, value in values.items()})],
        )
        for of in (lambda value: value, lambda value: [value])
    )
    assert one == many


def test_names_become_the_things_that_they_name():
    study = make_study(
        models={"mine": "scale+bias"},
        grids=[grid(["mine", NINE], ["faces-6"], approaches="all")],
        noise={"effects": ["heavy_tails( nu=5 )"]},
    )
    mine = study.models["mine"]
    assert mine.parameter_names == ("s_x", "s_y", "s_z", "b_x", "b_y", "b_z")
    assert study.grids[0].models == [mine, get_model(NINE)]
    assert study.grids[0].schemes == [get_scheme("faces-6")]
    assert study.grids[0].approaches == [get_approach(name) for name in approach_names()]
    assert study.noise.effects == [get_noise_effect("heavy_tails(nu=5)")]
    # Nobody else's configuration has that model.
    with pytest.raises(InputError, match=r"grids\.0\.models: unknown model 'mine'"):
        make_study(grids=[grid("mine")])


def test_numbers_as_yaml_1_1_reads_them():
    """YAML 1.1 takes 2e-3 for text, as it has no point."""
    assert yaml.safe_load("2e-3") == "2e-3"
    assert make_study(noise={"sensor": {"sigma_mps2": "2e-3"}}).noise.sensor.sigma_mps2 == 2e-3


def test_the_hash_of_a_configuration_is_that_of_what_numbers_depend_on():
    assert config_hash(content(angle_unit="deg")) == config_hash(content())
    assert config_hash(content(seed=2)) != config_hash(content())
