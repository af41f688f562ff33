"""What a person reads where a file does not fit its model."""

import pytest
from pydantic import Field

from accelstudy.basics.errors import InputError
from accelstudy.files.validation import Block, checked


class Grid(Block):
    size: int = Field(ge=1)


class Plan(Block):
    grid: Grid
    names: tuple[str, ...] = ()


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ({"grid": {"size": 0}}, "grid.size: must be at least 1, not 0"),
        ({"grid": {"sise": 1, "size": 1}}, "grid.sise: unknown key; did you mean 'size'? (known:"),
        ({}, "grid: must be given"),
        ({"grid": [1]}, "grid: expected keys and values, not [1]"),
        ({"grid": {"size": 0}, "names": 3}, "(and 1 more)"),
    ],
)
def test_an_error_is_one_line_with_source_and_key(content, said):
    for section, start in (("", "plan.yaml: "), ("case", "plan.yaml: case.")):
        with pytest.raises(InputError) as error:
            checked(Plan, content, "plan.yaml", section)
        text = str(error.value)
        assert text.startswith(start)
        assert said in text
        assert "\n" not in text


def test_no_mapping_at_all_has_no_key():
    for section, key in (("", ""), ("case", "case: ")):
        said = rf"^plan.yaml: {key}expected keys and values, not 3$"
        with pytest.raises(InputError, match=said):
            checked(Plan, 3, "plan.yaml", section)
