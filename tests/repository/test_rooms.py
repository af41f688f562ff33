"""The rooms of the package: their imports go one way, and none is too full to look through."""

import re
from collections import Counter

import grimp
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


@pytest.fixture(scope="module")
def graph():
    """What each module imports, within functions too, but not for type checkers."""
    return grimp.build_graph(PACKAGE, exclude_type_checking_imports=True, cache_dir=None)


def test_imports_between_rooms_go_one_way(graph):
    rooms = {module.rpartition(".")[0] for module in graph.modules} - {""}
    assert {f"{PACKAGE}.campaign", f"{PACKAGE}.study"} < rooms
    assert [each for room in rooms for each in graph.nominate_cycle_breakers(room)] == []


def test_the_table_for_contributors_has_all_rooms_in_the_order_of_imports(graph):
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    lines = re.findall(r"^\|[^|`]*\|([^|]*`\w+/`[^|]*)\|$", text, re.MULTILINE)
    layers = [grimp.Layer(*re.findall(r"`(\w+)/`", line), independent=False) for line in lines]
    folders = {path.parent.name for path in (ROOT / PACKAGE).glob("*/__init__.py")}
    assert {room for layer in layers for room in layer.module_tails} == folders
    upwards = graph.find_illegal_dependencies_for_layers(layers[::-1], containers={PACKAGE})
    assert upwards == set()


def test_no_room_is_too_full():
    package = ROOT / PACKAGE
    counts = Counter(
        path.parent.relative_to(package).as_posix() for path in package.rglob("[!_]*.py")
    )
    assert counts.keys() >= REGISTRIES
    full = {
        room: n for room, n in counts.items() if n > MOST_FILES and room not in REGISTRIES | FLAT
    }
    assert full == {}
