"""Graphs on the page of the architecture: rooms and their imports, and the rules of a study."""

import ast
import re
import subprocess
import tempfile
from collections import defaultdict
from functools import cache
from graphlib import TopologicalSorter
from itertools import pairwise
from pathlib import Path

from grimp import build_graph
from markdown_text import plain, table

import accelstudy

ROOT = Path(accelstudy.__file__).parent
BOX, HEIGHT = 112, 28
"""Size of a box in the drawing."""
GAP, ROW, PASSAGE = 14, 70, 22
"""Space between two boxes, height of a row, and width that a passing arrow has."""


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


def needed(graph):
    """Imports without those that follow from others, so that the drawing stays clear."""

    return {
        room: {
            each for each in targets if not any(each in _below(graph, other) for other in targets)
        }
        for room, targets in graph.items()
    }


def routed(rows, arrows):
    """Rows with a place for each arrow that passes them, and the ways of the arrows.

    Returns
    -------
    rows : list of lists of rooms and of passing arrows, (room, target, number of the row)
    ways : list of lists of such, from a room to one that it imports
    """
    level = {room: number for number, row in enumerate(rows) for room in row}
    rows, ways = [list(row) for row in rows], []
    for room, targets in arrows.items():
        for target in sorted(targets):
            passing = range(level[room] - 1, level[target], -1)
            for number in passing:
                rows[number].append((room, target, number))
            ways.append([room, *((room, target, number) for number in passing), target])
    return rows, ways


def arranged(rows, ways):
    """Horizontal middle of each item; those of a row stand near what they are joined to."""
    beside = defaultdict(set)
    for one, other in (pair for way in ways for pair in pairwise(way)):
        beside[one].add(other)
        beside[other].add(one)
    x = {}
    for step in range(30):
        for row in rows if step % 2 else reversed(rows):
            known = {item: [x[b] for b in beside[item] if b in x] for item in row}
            wanted = {item: sum(k) / len(k) if k else 0.0 for item, k in known.items()}
            row.sort(key=lambda item: (wanted[item], str(item)))
            x |= _apart(row, wanted)
    return x


def _apart(row, wanted):
    """Places near the wanted ones, in order, that do not overlap: groups that would are joined."""
    groups = []
    for item in row:
        width = BOX + GAP if isinstance(item, str) else PASSAGE
        groups.append(([(item, width)], width, wanted[item]))
        while len(groups) > 1 and _end(groups[-2]) > _start(groups[-1]):
            (one, w1, x1), (other, w2, x2) = groups[-2:]
            middle = (x1 * len(one) + x2 * len(other)) / (len(one) + len(other))
            groups[-2:] = [(one + other, w1 + w2, middle)]
    places = {}
    for group in groups:
        at = _start(group)
        for item, width in group[0]:
            places[item] = at + width / 2
            at += width
    return places


def _start(group):
    return group[2] - group[1] / 2


def _end(group):
    return group[2] + group[1] / 2


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


def squeezed(name):
    """What makes a long name as wide as its box."""
    return f' textLength="{BOX - 8}" lengthAdjust="spacingAndGlyphs"' if len(name) > 14 else ""


def drawing(graph, what, linked):
    """A graph as SVG, what is needed below; `linked` boxes lead to their lines in the table."""
    rows, ways = routed(levels(graph), needed(graph))
    x = arranged(rows, ways)
    left = min(x.values()) - BOX / 2 - 4
    width = max(x.values()) + BOX / 2 + 4 - left
    x = {item: round(value - left) for item, value in x.items()}
    y = {item: (len(rows) - 1 - i) * ROW + 4 for i, row in enumerate(rows) for item in row}
    parts = []
    for way in ways:
        path = f"M{x[way[0]]} {y[way[0]] + HEIGHT}"
        for one, other in pairwise(way):
            bend = (ROW - HEIGHT) // 2
            end = y[other] - (4 if other == way[-1] else 0)
            path += f"C{x[one]} {y[one] + HEIGHT + bend} {x[other]} {end - bend} {x[other]} {end}"
            if other != way[-1]:
                path += f"v{HEIGHT}"
        parts.append(f'<path class="arrow" marker-end="url(#tip)" d="{path}"/>')
    for room in graph:
        name = room.replace("_", " ")
        box = (
            f'<rect x="{x[room] - BOX // 2}" y="{y[room]}" width="{BOX}" height="{HEIGHT}" rx="4"/>'
            f'<text x="{x[room]}" y="{y[room] + 20}"{squeezed(name)}>{name}</text>'
        )
        parts.append(f'<a href="#{room}">{box}</a>' if linked else box)
    tip = (
        '<defs><marker id="tip" viewBox="0 0 8 8" refX="6" refY="4" markerWidth="7" '
        'markerHeight="7" orient="auto"><path d="M0 0L8 4L0 8z"/></marker></defs>'
    )
    return (
        f'<div class="rooms"><svg role="img" aria-label="{what}" style="max-width: {width:.0f}px" '
        f'viewBox="0 0 {width:.0f} {len(rows) * ROW - ROW + HEIGHT + 8}">{tip}{"".join(parts)}'
        "</svg></div>"
    )


def rooms_drawing():
    """The rooms and their imports, drawn."""
    return drawing(imports(), "Rooms and their imports", linked=True)


def rules_drawing():
    """The rules of a study, drawn."""
    return drawing(rules(), "Rules of a study", linked=False)


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
