"""What a person reads where a file does not fit its model."""

import importlib
import re

from places import ROOT
from pydantic import BaseModel, create_model

from accelstudy.basics.errors import InputError
from accelstudy.files.validation import ConfigSection, validate


def models():
    """All models of what is read from files."""
    bases = r"ConfigSection|Configuration|Document|Part|\w*Model|\w+Layout"
    declared = re.compile(rf"^class \w+\(({bases})\)", re.M)
    for path in (ROOT / "accelstudy").rglob("*.py"):
        if declared.search(path.read_text("utf-8")):
            importlib.import_module(".".join(path.relative_to(ROOT).with_suffix("").parts))
    found = [BaseModel]
    for model in found:
        found += [m for m in model.__subclasses__() if m.__module__.startswith(("acc", "pydantic"))]
    return [model for model in found if model.__module__.startswith("accelstudy.")]


WRONG = [
    *(None, True, -1, 0.5, 1e9, 10**400, float("nan"), "x", "", "\ud800", "x" * 999, "9" * 9999),
    *([], [[]], ["x"] * 99, [1] * 4, {"k": {}}, {3: -1}),
]
MARKS = (
    r"constrained|function-|nullable|union|should|required|nable|\.(str|int|float|list|dict|bool)\b"
)
"""What only pydantic says, such as the key columns.fx.constrained-int."""


def test_all_errors_are_in_plain_words():
    """Of each key of each model alone, as a message is of the first one that is wrong.

    It begins with the key, or says which keys there are.
    """
    assert len(models()) > 30
    said = set()
    for model in models():
        for name, field in model.model_fields.items():
            key = field.alias or name
            alone = create_model(name, __base__=ConfigSection, **{name: (field.annotation, field)})
            for content in ({}, 3, *({key: value} for value in WRONG)):
                try:
                    validate(alone, content, "file")
                except InputError as error:
                    said.add((f"file: {key}", str(error)))
    begins = [text.startswith((key, "file: expected keys")) for key, text in said]
    plain = {re.sub(r"[‘'\"].*?[’'\"]|\(known: .*", "", text) for _, text in said}
    assert all(begins)
    assert len(plain) > 1500
    assert [text for text in plain if re.search(MARKS, text)] == []
