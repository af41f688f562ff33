"""The rooms of the package: their imports go one way, and none is too full to look through."""

import ast
import re
from collections import defaultdict
from graphlib import CycleError, TopologicalSorter

import pytest
from places import ROOT

PACKAGE = "accelstudy"
MOST_FILES = 10
REGISTRIES = {
    "approaches",
    "campaign/gross_errors",
    "commands",
    "effects",
    "noise_effects",
    "schemes",
    "study/claims",
    "study/figures",
}
"""One idea a file, so that they may grow."""
FLAT = {"sequential"}
"""A file more than others, as nobody would look for a part of one session in a folder."""


def modules():
    """Path of each module of the package, by its name."""
    return {
        ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): path
        for path in (ROOT / PACKAGE).rglob("*.py")
    }


def imported(tree, known):
    """Modules that a file imports, within functions too, but not for type checkers."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.If) and ast.unparse(node.test).endswith("TYPE_CHECKING"):
            continue
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name in known)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "imports name the whole path"
            whole = (f"{node.module}.{alias.name}" for alias in node.names)
            found = {name if name in known else node.module for name in whole}
            yield from sorted(found & known.keys())
        else:
            yield from imported(node, known)


@pytest.fixture(scope="module")
def arrows():
    """What each module imports of the package."""
    known = modules()
    return {
        name: set(imported(ast.parse(path.read_text(encoding="utf-8")), known))
        for name, path in known.items()
    }


def among(arrows, parent):
    """Imports between the rooms and modules right below a package."""
    depth = len(parent.split(".")) + 1
    found = defaultdict(set)
    for module, others in arrows.items():
        for other in others:
            if all(f"{name}.".startswith(f"{parent}.") for name in (module, other)):
                one, two = (".".join(name.split(".")[:depth]) for name in (module, other))
                if one != two and parent not in (one, two):
                    found[one].add(two)
    return found


def test_imports_between_rooms_go_one_way(arrows):
    parents = {PACKAGE, *(name.rpartition(".")[0] for name in arrows if "." in name)}
    assert {"accelstudy.campaign", "accelstudy.study"} < parents
    cycles = []
    for parent in sorted(parents):
        try:
            TopologicalSorter(among(arrows, parent)).prepare()
        except CycleError as error:
            cycles.append(" → ".join(reversed(error.args[1])))
    assert cycles == []


def test_the_table_for_contributors_has_all_rooms_in_the_order_of_imports(arrows):
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    lines = re.findall(r"^\|[^|`]*\|([^|]*`\w+/`[^|]*)\|$", text, re.MULTILINE)
    line_of = {
        f"{PACKAGE}.{room}": number
        for number, line in enumerate(lines)
        for room in re.findall(r"`(\w+)/`", line)
    }
    folders = {path.parent.name for path in (ROOT / PACKAGE).glob("*/__init__.py")}
    assert {name.removeprefix(f"{PACKAGE}.") for name in line_of} == folders
    upwards = [
        f"{room} imports {other}"
        for room, others in among(arrows, PACKAGE).items()
        for other in others
        if room in line_of and line_of.get(other, 0) > line_of[room]
    ]
    assert upwards == []


def test_no_room_is_too_full():
    folders = {path.parent for path in modules().values()}
    counts = {
        folder.relative_to(ROOT / PACKAGE).as_posix(): len(list(folder.glob("[!_]*.py")))
        for folder in folders
    }
    assert counts.keys() >= REGISTRIES
    full = {
        room: n for room, n in counts.items() if n > MOST_FILES and room not in REGISTRIES | FLAT
    }
    assert full == {}
