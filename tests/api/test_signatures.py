"""Commands are made of functions: the same words, the same defaults, the same errors."""

import inspect
from dataclasses import fields
from typing import Any

import click
import pytest
from calling import refusal

import accelstudy
from accelstudy.basics.bounds import Range
from accelstudy.basics.units import Given
from accelstudy.campaign.simulated import CampaignSettings, simulate_campaign
from accelstudy.commands.main import main
from accelstudy.verbs import kinds

TERMINAL = {"out", "force", "quiet", "angle_unit", "plugin"}
"""What only a terminal asks."""
VERBS = [
    *("calibrate", "check-sigmas", "compare", "diagnose", "export", "history", "lot"),
    "plan",
]


def options(verb: str) -> dict[str, click.Parameter]:
    params = main.commands[verb].params
    return {p.name: p for p in params if p.expose_value and p.name and p.name not in TERMINAL}


def function(verb: str) -> Any:
    return getattr(accelstudy, verb.replace("-", "_"))


@pytest.mark.parametrize("verb", VERBS)
def test_options_are_keywords_and_arguments_are_positional(verb: str) -> None:
    signature = inspect.signature(function(verb)).parameters
    assert set(options(verb)) == set(signature)
    for name, option in options(verb).items():
        by_position = signature[name].kind is not inspect.Parameter.KEYWORD_ONLY
        assert by_position == isinstance(option, click.Argument), name


@pytest.mark.parametrize("verb", VERBS)
def test_a_wrong_value_ends_in_the_same_line(verb: str, tmp_path: Any) -> None:
    """It names the option to one user, and the keyword to the other."""
    paths = [name for name, one in options(verb).items() if isinstance(one, click.Argument)]
    out = [] if verb in ("check-sigmas", "export") else ["--out", tmp_path / "out"]
    needed = {"tilt_accuracy": "10mgon"} if verb == "plan" else {}
    for keyword in kinds.keywords(function(verb)):
        if not isinstance(keyword.kind, Given | Range | kinds.Share):
            continue
        given = {**needed, keyword.name: "5 parsec"}
        words = [
            word
            for one in kinds.keywords(function(verb)) if one.name in given
            for word in (f"--{one.option.replace('_', '-')}", given[one.name])
        ]  # fmt: skip
        line = refusal(verb, *paths, *words, *out).removeprefix("error: ").strip()
        with pytest.raises(accelstudy.InputError) as refused:
            function(verb)(*paths, **given)
        option = f"--{keyword.option.replace('_', '-')}"
        assert line == str(refused.value).replace(keyword.name, option, 1)
        assert line.startswith(f"{option}: ")


def test_a_simulated_campaign_has_the_keywords_and_defaults_of_its_settings() -> None:
    one = accelstudy.simulate_campaign(seed=3)
    other, _ = simulate_campaign(CampaignSettings(seed=3))
    assert one.forces.tolist() == other.forces.tolist()
    assert one.angles.tolist() == other.angles.tolist()
    keywords = inspect.signature(accelstudy.simulate_campaign).parameters
    assert [*keywords] == [each.name for each in fields(CampaignSettings)]
