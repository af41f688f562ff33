"""The rooms of the package: their imports go one way."""

import re

import grimp
import pytest
from places import ROOT

PACKAGE = "accelstudy"


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
