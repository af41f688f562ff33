"""Wording of what is said to a person."""

from __future__ import annotations


def one_line(text: object, length: int = 100) -> str:
    """Text, or what an error says, in one line that fits into a message."""
    line = " ".join(str(text).split()) or type(text).__name__
    return line if len(line) <= length else f"{line[:length]} …"


def counted(number: int, noun: str) -> str:
    """Number and noun, in the plural where that is right."""
    return f"{number} {noun}" + ("" if number == 1 else "s")
