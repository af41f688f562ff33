"""Errors that are the user's to mend: one clear line, exit status 2, never a traceback."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


class InputError(ValueError):
    """Input that cannot be used; the message says where, what is wrong and what would be right.

    What a file says may stand in the message. So nothing in it steers a terminal.
    """

    def __init__(self, message: str) -> None:
        super().__init__(printable(message))


def printable(text: str) -> str:
    """Text in which characters that nobody sees, but that a terminal obeys, are spelled out."""
    if text.isprintable():
        return text
    return "".join(
        c if c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in text
    )


class UnknownNameError(InputError):
    """A name that stands in no registry; the message lists the names that do."""

    def __init__(self, kind: str, name: object, known: Iterable[str]) -> None:
        known = tuple(known)
        near = difflib.get_close_matches(str(name), known, n=1)
        hint = f"; did you mean {near[0]!r}?" if near else ""
        super().__init__(f"unknown {kind} {name!r}{hint} (known: {', '.join(known)})")
