"""Errors that the user can correct: one clear line, exit status 2, never a traceback."""

from __future__ import annotations

import re
import reprlib
import unicodedata
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from difflib import get_close_matches

OPTIONS: ContextVar[Mapping[str, str] | None] = ContextVar("options", default=None)
"""Options of the command that runs, by the keywords that they are; None in a program."""


def key(name: str) -> str:
    """Spell the name of a keyword as its user does: --time-unit on a command line, or time_unit."""
    options = OPTIONS.get()
    return name if options is None else options.get(name, f"--{name.replace('_', '-')}")


def for_user(text: str) -> str:
    """Spell the keywords in a text, which stand in backticks, as options of the command that runs.

    Words in backticks that are no keywords of it, such as commands and keys of files, stay.
    """
    options = OPTIONS.get() or {}
    return re.sub(r"`(\w+)`", lambda word: options.get(word[1], word[0]), text)


class InputError(ValueError):
    """Input that cannot be used; the message says where, what is wrong and what would be right.

    The message may quote a file. So characters that control a terminal are spelled out in it.
    Keywords stand in backticks in it, see `for_user`.
    """

    def __init__(self, message: str) -> None:
        super().__init__(printable(for_user(message)))


@contextmanager
def locate_errors(place: object) -> Iterator[None]:
    """Begin the message of an `InputError` within a ``with`` block with the place of the error."""
    try:
        yield
    except InputError as error:
        raise InputError(f"{place}: {error}") from None


def reason_of(error: OSError) -> str:
    """Return the reason that the system gives; Arrow puts more before it."""
    return str(error.strerror or error).rpartition("] ")[2]


def printable(text: str) -> str:
    """Spell out the invisible characters of a text that would control a terminal."""
    if text.isprintable():
        return text
    return "".join(
        c
        if c.isprintable() or unicodedata.category(c) == "Zs"  # such as a space that does not break
        else c.encode("unicode_escape").decode("ascii")
        for c in text
    )


def printable_line(text: str) -> str:
    """Make a text from a file one printable line: of a name, no line of another file is made."""
    if text.isprintable():
        return text
    return "\t".join(map(printable, " ".join(text.splitlines()).split("\t")))


_BRIEF = reprlib.Repr()
_BRIEF.maxlevel, _BRIEF.maxstring, _BRIEF.maxother, _BRIEF.maxlong = 3, 60, 60, 60


def brief(value: object) -> str:
    """Show a value in a message as Python writes it, cut short; a table by its class."""
    try:
        text = _BRIEF.repr(value)
    except ValueError:  # Python writes no integer of more than 4300 digits
        text = "a huge number"
    if "\n" in text:
        return f"a {type(value).__name__}"
    return text if len(text) <= 80 else f"{text[:80]} …"


def did_you_mean(name: object, known: Iterable[str]) -> str:
    """Say which of the known names may be meant, whatever its case; empty if none is near."""
    lower = {each.lower(): each for each in known}
    near = get_close_matches(name[:100].lower() if isinstance(name, str) else "", lower, n=1)
    return f"; did you mean {lower[near[0]]!r}?" if near else ""


class UnknownNameError(InputError):
    """A name that no registry has; the message lists those that there are, and `more` to know."""

    def __init__(self, kind: str, name: object, known: Iterable[str], more: str = "") -> None:
        known = tuple(known)
        hint = did_you_mean(name, known)
        super().__init__(f"unknown {kind} {brief(name)}{hint} (known: {', '.join(known)}{more})")


def check_name(kind: str, name: object, known: Collection[str]) -> None:
    """Raise `UnknownNameError` unless a name is one of those that there are."""
    if name not in known:
        raise UnknownNameError(kind, name, known)
