"""What a person reads where a file does not fit its model."""

import importlib
import re

import pytest
from calling import refused
from places import ROOT
from pydantic import BaseModel, Field

from accelstudy.basics.errors import InputError
from accelstudy.campaign.header import LogLayout
from accelstudy.files.validation import WORDS, Block, checked


class Grid(Block):
    size: int = Field(ge=1)


class Plan(Block):
    grid: Grid
    names: tuple[str, ...] = ()


@pytest.mark.parametrize(("content", "key", "said"), [
    ({"grid": {"size": 0}}, "grid.size", "must be at least 1, not 0"),
    ({"grid": {"sise": 1, "size": 1}}, "grid.sise", "unknown key; did you mean 'size'? (known:"),
    ({}, "grid", "must be given"),
    ({"gird": {"size": 1}}, "gird", "unknown key; did you mean 'grid'? (known:"),
    ({"grid": [1]}, "grid", "expected keys and values, not [1]"),
    ({"grid": {"size": 0}, "names": 3}, "grid.size", "(and 1 more)"),
    (3, "", "expected keys and values, not 3"),
])  # fmt: skip
def test_an_error_is_one_line_with_source_and_key(content, key, said):
    for section in ("", "case"):
        place = ".".join(filter(None, (section, key)))
        with refused(said, start=f"plan.yaml: {place}{': ' if place else ''}"):
            checked(Plan, content, "plan.yaml", section)


ERRORS_OF = {
    "any": "", "bool": "bool_type bool_parsing", "dataclass": "dataclass_type",
    "dataclass-args": "missing", "dataclass-field": "", "default": "", "definition-ref": "",
    "definitions": "", "dict": "dict_type", "float": "float_type float_parsing finite_number",
    "function-after": "", "function-before": "", "function-plain": "", "function-wrap": "",
    "with-info": "",
    "int": "int_type int_parsing int_parsing_size int_from_float", "list": "list_type",
    "literal": "literal_error", "model": "model_type", "model-field": "", "model-fields": "missing",
    "nullable": "", "str": "string_type string_unicode",
    "tuple": "tuple_type too_short too_long missing", "union": "",
}  # fmt: skip
"""Errors of pydantic by the type of a part of a model; those of functions are ours."""
ERRORS_OF_BOUND = {
    "gt": "greater_than", "ge": "greater_than_equal", "lt": "less_than", "le": "less_than_equal",
    "min_length": "too_short string_too_short", "max_length": "too_long string_too_long",
}  # fmt: skip


def models():
    """All models of what is read from files."""
    for path in (ROOT / "accelstudy").rglob("*.py"):
        if re.search(r"^class \w+\((Block|\w*Model|\w+Layout)\)", path.read_text("utf-8"), re.M):
            importlib.import_module(".".join(path.relative_to(ROOT).with_suffix("").parts))
    found = [BaseModel]
    for model in found:
        found += [m for m in model.__subclasses__() if m.__module__.startswith(("acc", "pydantic"))]
    return [model for model in found if model.__module__.startswith("accelstudy.")]


def parts(schema):
    """All parts of a schema of pydantic."""
    if isinstance(schema, dict):
        if isinstance(schema.get("type"), str) and schema["type"] != "no-info":
            yield schema
        for key, value in schema.items():
            if key not in ("metadata", "cls", "ref", "schema_ref"):
                yield from parts(value)
    elif isinstance(schema, list | tuple):
        for each in schema:
            yield from parts(each)


def test_all_errors_are_in_plain_words():
    everything = models()
    assert len(everything) > 30
    for model in everything:
        for part in parts(model.__pydantic_core_schema__):
            errors = ERRORS_OF[part["type"]].split()
            for bound in ERRORS_OF_BOUND.keys() & part.keys():
                errors += ERRORS_OF_BOUND[bound].split()
            assert WORDS.keys() >= {*errors}


WRONG = [None, True, -1, 0.5, 10**400, float("nan"), "x", "\ud800", [], [[]], {"k": {}}, {3: -1}]


def test_no_mark_of_pydantic_is_in_a_message():
    """Such as the key columns.fx.constrained-int."""
    marks = r"constrained|function|nullable|union|nput should|\.(str|int|float|list|dict|bool)\b"
    said = set()
    for model in models():
        keys = [field.alias or name for name, field in model.model_fields.items()]
        for content in [{key: value} for key in keys for value in WRONG]:
            try:
                checked(model, content, "file")
            except InputError as error:
                said.add(re.sub(r"[‘'\"].*?[’'\"]|\(known: .*", "", str(error)))
    assert len(said) > 500
    assert [text for text in said if re.search(marks, text)] == []


def test_one_of_two_kinds_is_said_with_both():
    with refused(start="log: columns.fx: must be a whole number or a text, not 0.5"):
        checked(LogLayout, {"columns": {"fx": 0.5}}, "log")
