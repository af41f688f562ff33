"""What people write for a model, and effects that say no more than they must."""

import re

import pytest
import yaml
from calling import refused

from accelstudy.basics.errors import InputError
from accelstudy.campaign.simulated import CampaignSettings, simulate_campaign
from accelstudy.effects import Effect, effect_names, get_effect
from accelstudy.effects.base import expressions
from accelstudy.sensors.models import MODELS, get_model
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


@pytest.mark.parametrize(("text", "words"), [
    ("bias-scal", "unknown model 'bias-scal'; did you mean 'bias-scale'"),
    ("bias-scale+warmup", "unknown model or effect 'warmup'; did you mean 'warm_up'"),
    ("bias+warm_up(tau=1)+warm_up(tau=2)", "'warm_up' is in it twice"),
    ("bias+warm_up(tau=1,tau=2)", "tau is given twice"),
    ("bias++scale", "a part is empty"),
    ("bias+saturation[k_sat]", "did you mean 'k_sat_"),
    ("nowhere/model.yaml", "nowhere/model.yaml: no such file"),
    (f"{'x' * 300}.yaml", "too long for the name of a file"),
])  # fmt: skip
def test_what_is_no_model_is_one_line(text, words):
    with refused(words):
        get_model(text)


@pytest.mark.parametrize(("content", "expected"), [
    ({"models": {"mine": ["bias", "scale", "warm_up(tau=80)"]}}, "bias-scale+warm_up(tau=80)"),
    ({"models": {}, "simulated_effects": ["bias", "scale"]}, "bias-scale"),
    ({"models": {"a": ["bias"], "b": ["scale"]}}, InputError("several models (a, b)")),
    ({"models": {"mine": ["bias", "bais"]}}, InputError("models.mine: unknown effect 'bais'")),
    ({"models": {"mine": 3}}, InputError("models.mine: must be a list of effects")),
    ({"models": [1]}, InputError("models: must be a mapping")),
    ({"study": "x"}, InputError("no model in it")),
])  # fmt: skip
def test_the_model_of_a_file(content, expected, tmp_path):
    path = tmp_path / "model.yaml"
    path.write_text(yaml.safe_dump(content), encoding="utf-8")
    with pytest.raises(InputError, match=re.escape(f"a folder, not a model; take {path}")):
        get_model(str(tmp_path))
    if isinstance(expected, str):
        assert get_model(str(path)).name == expected
        return
    with pytest.raises(InputError, match=re.escape(f"{path}: {expected}")):
        get_model(str(path))
    if len(content.get("models", ())) == 2:
        assert get_model(f"{path}:b").name == "scale"
        with pytest.raises(InputError, match="no model 'c' in it; it has a, b"):
            get_model(f"{path}:c")


def test_a_part_of_an_effect_takes_its_share_of_the_true_values():
    study = parse_study({
        "study": "part", "seed": 1,
        "sensor": {"saturation": {"value": [0.1, 0.2, 0.3], "unit": "1"}},
        "grids": [{"models": "all", "schemes": "faces-6", "replicates": 2}],
    })  # fmt: skip
    assert study.truth(["saturation(knee=9)[k_sat_z]"]) == {"k_sat_z": 0.3}


# --- what an effect need not say -----------------------------------------------------------------


@pytest.mark.parametrize("name", effect_names())
def test_defaults_come_from_the_formulas(name):
    effect = get_effect(name)
    assert Effect.equation.fget(effect)
    low, high = Effect.typical.fget(effect)
    assert 0 < low < high < 1


def test_formulas_are_those_of_the_effect():
    warm_up = expressions(get_effect("warm_up(tau=312.5)"))[0]
    assert [*map(str, warm_up)] == [f"w_{i}*exp(-0.0032*time)" for i in "xyz"]
    assert [*map(str, expressions(get_effect("saturation(knee=9)[k_sat_y]"))[0])][::2] == ["0", "0"]
    assert [*map(str, expressions(get_effect("encoder_offset"))[2])] == ["c_roll", "c_pitch"]
    assert Effect.equation.fget(get_effect("quadratic_scale")) == "f_i² k2_i/g"
    assert set(MODELS[NINE]) <= set(effect_names())


def test_a_campaign_of_a_composition_has_each_effect_once():
    settings = CampaignSettings(
        model=f"{NINE}+warm_up(tau=300)", effects=("warm_up(tau=500): 0.1, 0.2, 0.3",)
    )
    truth = simulate_campaign(settings).truth
    assert [e["name"] for e in truth["sensor"]] == ["bias", "scale", "nonorthogonality"]
    assert [e["name"] for e in truth["effects"]] == ["warm_up"]
    twice = CampaignSettings(effects=("warm_up", "warm_up(tau=3)"))
    with pytest.raises(InputError, match="occur in two effects"):
        simulate_campaign(twice)
