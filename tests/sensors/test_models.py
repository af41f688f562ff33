"""What people write for a model, and effects that say no more than they must."""

import pytest
import yaml

import accelstudy as acs
from accelstudy.sensors.models import get_model
from accelstudy.study.config import parse_study

NINE = "bias-scale-nonorthogonality"


@pytest.mark.parametrize(("text", "name", "number"), [
    (NINE, NINE, 9),
    ("bias+scale+nonorthogonality", NINE, 9),
    (f" {NINE} + warm_up( tau=300 )", f"{NINE}+warm_up(tau=300)", 12),
    (f"{NINE}+warm_up+quadratic_scale", f"{NINE}+warm_up(tau=600)+quadratic_scale", 15),
    ("warm_up(tau=1e+3)+bias", "warm_up(tau=1000)+bias", 6),
    ("bias-scale+saturation(knee=9)[k_sat_z]", "bias-scale+saturation(knee=9)[k_sat_z]", 7),
])  # fmt: skip
def test_a_composition_has_one_name(text, name, number):
    model = get_model(text)
    assert (model.name, model.n_parameters) == (name, number)
    assert get_model(model.name) is model


@pytest.mark.parametrize(("content", "which", "expected"), [
    ({"models": {"mine": ["bias", "warm_up(tau=80)"]}}, "", "bias+warm_up(tau=80)"),
    ({"models": {}, "simulated_effects": ["bias", "scale"]}, "", "bias-scale"),
    ({"models": {"a": ["bias"], "b": ["scale"]}}, ":b", "scale"),
])  # fmt: skip
def test_the_model_of_a_file(content, which, expected, tmp_path):
    path = tmp_path / "model.yaml"
    path.write_text(yaml.safe_dump(content), encoding="utf-8")
    assert get_model(f"{path}{which}").name == expected


def test_a_part_of_an_effect_takes_its_share_of_the_true_values():
    study = parse_study({
        "study": "part", "seed": 1,
        "sensor": {"saturation": {"value": [0.1, 0.2, 0.3], "unit": "1"}},
        "grids": [{"models": "all", "schemes": "faces-6", "replicates": 2}],
    })  # fmt: skip
    assert study.truth(["saturation(knee=9)[k_sat_z]"]) == {"k_sat_z": 0.3}


def test_a_campaign_of_a_composition_has_each_effect_once():
    effects = "warm_up(tau=500): 0.1, 0.2, 0.3"
    truth = acs.simulate_campaign(model=f"{NINE}+warm_up(tau=300)", effects=effects).truth
    assert [e["name"] for e in truth["sensor"]] == ["bias", "scale", "nonorthogonality"]
    assert [e["name"] for e in truth["effects"]] == ["warm_up"]
