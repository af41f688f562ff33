"""The rooms of the package: their imports go one way, and a file is worth opening."""

import ast
import re

import grimp
import pytest
from places import ROOT

PACKAGE = "accelstudy"
REGISTRIES = (
    *("approaches", "campaign.gross_errors", "effects", "noise_effects", "schemes"),
    "study.figures",
)
"""Rooms in which each idea has a file, however small."""
SMALL = 40
"""Lines of code below which a file with one user in its own room is a fragment of that user."""


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


@pytest.fixture(scope="module")
def both():
    """What each module of the package and of the studies imports."""
    return grimp.build_graph(PACKAGE, "studies", cache_dir=None)


def test_studies_import_the_package_and_nothing_of_it_imports_them(both):
    used = {
        (importer.split(".")[0], imported.split(".")[0])
        for importer in both.modules
        for imported in both.find_modules_directly_imported_by(importer)
    }
    assert used == {(PACKAGE, PACKAGE), ("studies", "studies"), ("studies", PACKAGE)}


def test_the_generator_of_hidden_campaigns_knows_nothing_of_what_it_judges(both):
    allowed = (
        "accelstudy.campaign.session", "accelstudy.campaign.format", "accelstudy.basics.errors",
        "accelstudy.basics.units", "studies.hidden.physics",
    )  # fmt: skip
    own = [module for module in both.modules if module.startswith("studies.hidden.physics")]
    used = {each for module in own for each in both.find_modules_directly_imported_by(module)}
    assert {each for each in used if not each.startswith(allowed)} == set()


def test_a_small_file_with_one_user_belongs_to_its_user(graph):
    fragments = [module for module in sorted(graph.modules) if is_fragment(module, graph)]
    assert fragments == [], f"less than {SMALL} lines of code, and one module of the room uses them"


def is_fragment(module, graph):
    """Whether a module is small, and only one of its room uses it."""
    path = ROOT / f"{module.replace('.', '/')}.py"
    folder = module.removeprefix(f"{PACKAGE}.").rpartition(".")[0]
    users = graph.find_modules_that_directly_import(module)
    if not path.exists() or folder in REGISTRIES or len(users) != 1:
        return False
    (user,) = users
    return user.split(".")[1:2] == module.split(".")[1:2] and code_lines(path) < SMALL


def code_lines(path):
    """Number of lines on which a statement or an expression begins, without docstrings."""
    nodes = list(ast.walk(ast.parse(path.read_text(encoding="utf-8"))))
    lines = {node.lineno for node in nodes if isinstance(node, ast.stmt | ast.expr)}
    texts = (n for n in nodes if isinstance(n, ast.Expr) and isinstance(n.value, ast.Constant))
    return len(lines - {text.lineno for text in texts})
