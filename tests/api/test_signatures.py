"""Test that a command and its function have the same words and the same defaults."""

import inspect
from typing import Any

import click
import pytest

import accelstudy
from accelstudy.commands import main

TERMINAL = {"out", "force", "quiet", "angle_unit", "plugin"}
"""What only a terminal asks."""
GROUP = next(value for value in vars(main).values() if isinstance(value, click.Group))
VERBS = ["calibrate", "check-sigmas", "compare", "diagnose", "history", "lot"]


def options(verb: str) -> dict[str, click.Parameter]:
    command = GROUP.get_command(click.Context(GROUP), verb)
    assert command is not None
    return {p.name: p for p in command.params if p.name and p.name not in TERMINAL}


def keywords(verb: str) -> dict[str, inspect.Parameter]:
    function: Any = getattr(accelstudy, verb.replace("-", "_"))
    return dict(inspect.signature(function).parameters)


@pytest.mark.parametrize("verb", VERBS)
def test_options_are_keywords(verb: str) -> None:
    assert set(options(verb)) == set(keywords(verb))


@pytest.mark.parametrize("verb", VERBS)
def test_arguments_are_positional_and_options_are_not(verb: str) -> None:
    signature = keywords(verb)
    for name, option in options(verb).items():
        by_position = signature[name].kind is not inspect.Parameter.KEYWORD_ONLY
        assert by_position == isinstance(option, click.Argument), name
