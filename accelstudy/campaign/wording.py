"""Wording of what is said to a person."""

from __future__ import annotations

from collections.abc import Sequence


def one_line(text: object, length: int = 100) -> str:
    """Text, or what an error says, in one line that fits into a message."""
    line = " ".join(str(text).split()) or type(text).__name__
    return line if len(line) <= length else f"{line[:length]} …"


def counted(number: int, noun: str) -> str:
    """Number and noun, in the plural where that is right."""
    return f"{number} {noun}" + ("" if number == 1 else "s")


def listed(names: Sequence[str], most: int = 20) -> str:
    """Names, the first ones of many and the beginnings of long ones, in one line."""
    shown = ", ".join(one_line(name, 30) if name.strip() else repr(name) for name in names[:most])
    return shown + (", …" if len(names) > most else "")
