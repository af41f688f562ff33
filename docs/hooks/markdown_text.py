"""Texts of the code as Markdown: paragraphs, cells, tables."""

from collections.abc import Iterable, Sequence


def plain(text: str) -> str:
    """Text of a docstring or a help: no tags or links, and code in single backticks."""
    parts = text.replace("``", "`").split("`")
    return "`".join(_literal(p) if i % 2 == 0 else p for i, p in enumerate(parts))


def _literal(text: str) -> str:
    return text.replace("<", "&lt;").replace("[", "&#91;")


def code(value: object) -> str:
    """A name as code; nothing where there is none."""
    return f"`{value}`" if str(value) else ""


def table(heads: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A table; columns that are empty throughout are left out."""
    filled = [[_cell(value) for value in row] for row in rows]
    kept = [i for i in range(len(heads)) if any(row[i] for row in filled)]
    lines = [[heads[i] for i in kept], ["---" for _ in kept]]
    lines += [[row[i] for i in kept] for row in filled]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines) + "\n"


def _cell(value: object) -> str:
    """Text on one line; a bar outside code does not end the cell."""
    parts = " ".join(str(value).split()).split("`")
    return "`".join(p.replace("|", "\\|") if i % 2 == 0 else p for i, p in enumerate(parts))


def page(*parts: str) -> str:
    """A page of its parts, an empty line between them."""
    return "\n\n".join(part.strip("\n") for part in parts if part) + "\n"
