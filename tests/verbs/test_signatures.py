"""Commands are made of functions: the same words, the same defaults, the same errors."""

import inspect
import pickle
from typing import Any

import click
import pytest
from calling import refusal

import accelstudy
from accelstudy.basics.errors import OPTIONS
from accelstudy.basics.units import STANDARD_GRAVITY
from accelstudy.campaign.header import LogLayout
from accelstudy.campaign.importing.settings import ImportSettings
from accelstudy.commands.main import main
from accelstudy.verbs import kinds

TERMINAL = {"out", "force", "quiet", "angle_unit", "plugin", "figure", "truth"}
"""What only a terminal asks: where to write, and what to show."""
VERBS = [*main.commands]
NAMES = {
    "import": "find_holds", "design": "find_positions",
    "effects": "list_effects", "schemes": "list_schemes",
}  # fmt: skip
"""Functions that cannot be called as their commands: these are a word of Python and packages."""
NUMBERS = {"quantity", "integer", "share", "numbers", "columns"}
"""Kinds of which "5 parsec" is none."""
NEEDED = {
    "plan": {"tilt_accuracy": "10mgon"}, "advise": {"tilt_accuracy": "10mgon"},
}  # fmt: skip


def function(verb: str) -> Any:
    return getattr(accelstudy, NAMES.get(verb, verb.replace("-", "_")))


def options(verb: str) -> dict[str, click.Parameter]:
    of_terminal = TERMINAL - {*inspect.signature(function(verb)).parameters}
    params = main.commands[verb].params
    return {p.name: p for p in params if p.expose_value and p.name and p.name not in of_terminal}


@pytest.mark.parametrize("verb", VERBS)
def test_options_are_keywords_and_arguments_are_positional(verb: str) -> None:
    """They have the same names, the same defaults, and are needed alike."""
    signature = inspect.signature(function(verb)).parameters
    assert [*options(verb)] == [*signature]
    for name, option in options(verb).items():
        said = signature[name]
        by_position = said.kind is not inspect.Parameter.KEYWORD_ONLY
        assert by_position == isinstance(option, click.Argument), name
        assert option.required == (said.default is said.empty), name
        if not option.required and not by_position:
            assert option.default == said.default, name


@pytest.mark.parametrize("verb", VERBS)
def test_a_wrong_value_ends_in_the_same_line(verb: str, tmp_path: Any) -> None:
    """It names the option to one user, and the keyword to the other."""
    paths = [name for name, one in options(verb).items() if isinstance(one, click.Argument)]
    writes = any(option.name == "out" for option in main.commands[verb].params)
    out = ["--out", tmp_path / "out.yaml"] if writes else []
    needed = NEEDED.get(verb, {})
    keywords = kinds.keywords(function(verb))
    for keyword in keywords.values():
        if keyword.ends or keyword.kind.name not in NUMBERS:
            continue
        given = {**needed, keyword.name: "5 parsec"}
        words = [
            word
            for one in keywords.values() if one.name in given
            for word in (one.option, given[one.name])
        ]  # fmt: skip
        line = refusal(verb, *paths, *words, *out).removeprefix("error: ").strip()
        with pytest.raises(accelstudy.InputError) as refused:
            function(verb)(*paths, **given)
        assert line == str(refused.value).replace(keyword.name, keyword.option, 1)
        assert line.startswith(f"{keyword.option}: ")


def test_keywords_of_an_import_are_the_keys_of_its_settings() -> None:
    """But those of a reference."""
    keywords = {*kinds.keywords(accelstudy.find_holds)} - {"settings"}
    assert {name for name in keywords if not name.startswith("reference")} == {
        *ImportSettings.model_fields
    } - {"sensor", "gravity_sigma"}
    for text, si in (("8g", 8 * STANDARD_GRAVITY), (30, 30.0)):
        assert ImportSettings.model_validate({"range": text}).range == si
    # What accelstudy wrote itself still reads.
    assert LogLayout.model_validate({"rate_hz": 50}).rate == 50


def test_a_message_calls_a_keyword_as_its_user_does() -> None:
    said = "give `time_unit`; `apply` takes the same"
    assert str(accelstudy.InputError(said)) == said
    token = OPTIONS.set({"time_unit": "--time-unit"})
    try:
        command = accelstudy.InputError(said)
    finally:
        OPTIONS.reset(token)
    assert str(command) == "give --time-unit; `apply` takes the same"
    assert str(pickle.loads(pickle.dumps(command))) == str(command)


def test_a_number_without_a_unit_is_in_si_where_it_may_be() -> None:
    bare = kinds.si("m/s^2", 0, 100)
    assert [bare.read(text) for text in ("9.81", "981 mg", "1g")] == [
        9.81, pytest.approx(0.981 * STANDARD_GRAVITY), STANDARD_GRAVITY,
    ]  # fmt: skip
    for wrong in ("fast", "1e400", "-1", "nan"):
        with pytest.raises(accelstudy.InputError):
            bare.read(wrong)
