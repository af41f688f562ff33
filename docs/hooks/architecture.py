"""On the page of the architecture: the rooms and what they import, and the rules of a study."""

import ast
import re
import subprocess
import tempfile
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

from grimp import build_graph
from markdown_text import plain, table

import accelstudy

ROOT = Path(accelstudy.__file__).parent


def rooms():
    """Names of the rooms and what each says of itself, in one sentence."""
    found = {}
    for init in sorted(ROOT.glob("*/__init__.py")):
        text = ast.get_docstring(ast.parse(init.read_text(encoding="utf-8"))) or ""
        found[init.parent.name] = " ".join(text.partition("\n\n")[0].split())
    return found


@cache
def imports():
    """Rooms that each room imports, within functions too, but not for type checkers."""
    known = rooms()
    graph = build_graph("accelstudy", exclude_type_checking_imports=True, cache_dir=None)
    for room in known:
        graph.squash_module(f"accelstudy.{room}")
    targets = {
        room: graph.find_modules_directly_imported_by(f"accelstudy.{room}") for room in known
    }
    names = {room: {each.split(".")[-1] for each in targets[room]} for room in known}
    return {room: (names[room] & known.keys()) - {room} for room in known}


def _below(graph, room):
    """All rooms that a room needs, by whatever way."""
    return graph[room].union(*(_below(graph, each) for each in graph[room]))


def levels(graph):
    """Rooms by their level: one above the highest that they import.

    Raises
    ------
    ValueError
        If rooms import each other in a circle.
    """
    order, rows = TopologicalSorter(graph), []
    order.prepare()
    while order.is_active():
        rows.append(sorted(order.get_ready()))
        order.done(*rows[-1])
    return rows


def rules():
    """Rules of the study of the paper, and those that each needs, as Snakemake has them."""
    root = ROOT.parent
    study = ["--snakefile", root / "Snakefile", "--configfile", root / "config/config.yaml"]
    with tempfile.TemporaryDirectory() as folder:  # so that it looks at no results
        command = ["snakemake", *study, "--directory", folder, "--rulegraph", "dot"]
        ran = subprocess.run(command, capture_output=True, text=True, check=True)
    names = dict(re.findall(r'(\d+)\[label = "(\w+)"', ran.stdout))
    graph = {name: set() for name in names.values()}
    for needed, rule in re.findall(r"(\d+) -> (\d+)", ran.stdout):
        graph[names[rule]].add(names[needed])
    return graph


def drawing(graph, linked):
    """Boxes in rows, each above all that it needs; `linked` ones lead to lines of the table."""
    rows = []
    for row in reversed(levels(graph)):
        names = [(name, name.replace("_", " ")) for name in row]
        boxes = [f'<a href="#{n}">{t}</a>' if linked else f"<span>{t}</span>" for n, t in names]
        rows.append(f"<div>{''.join(boxes)}</div>")
    return f'<div class="rows">{"".join(rows)}</div>'


def rooms_drawing():
    """The rooms and their imports, drawn."""
    return drawing(imports(), linked=True)


def rules_drawing():
    """The rules of a study, drawn."""
    return drawing(rules(), linked=False)


def rooms_table():
    """The rooms in a table."""
    known, graph = rooms(), imports()
    lines = [
        (
            f'<span id="{room}"></span>`{room}/`',
            plain(known[room]),
            len([*(ROOT / room).rglob("*.py")]),
            ", ".join(f"[{each}](#{each})" for each in sorted(graph[room])),
        )
        for row in reversed(levels(graph))
        for room in row
    ]
    return table(("room", "what it holds", "files", "imports"), lines)
