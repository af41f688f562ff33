"""Names that become folders stay within them."""

import pytest

from accelstudy.basics.errors import InputError
from accelstudy.basics.names import check_path_name, path_name

BAD = ["../mydata", "/tmp/x", ".hidden", "-rf", "a/b", "a\\b", "{x}", "a b", "a\n", "", "x" * 300]


@pytest.mark.parametrize("name", BAD)
def test_names_of_folders(name):
    with pytest.raises(InputError) as error:
        check_path_name(name)
    assert len(str(error.value)) < 200


def test_usual_names():
    for name in ("paper", "2024-05.b", "Prüfstand_1", "x" * 100):
        assert check_path_name(name) == name


def test_names_of_sources():
    """A folder is named after its source, which may be called anything; not too long, though."""
    assert [path_name(name, "x") for name in ("a{x}", "-b c", "'$(d)'")] == ["a-x-", "b-c", "d-"]
    assert path_name("x" * 300, "x") == "x" * 100
