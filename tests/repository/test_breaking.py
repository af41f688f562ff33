"""The faults that `make test-breaks` makes can be made, and tests of these names are there."""

import pytest
from breaking import FAULTS
from places import ROOT


@pytest.fixture(scope="module")
def texts():
    """All code of the package, and all tests, one text each."""
    return [
        "\n".join(path.read_text("utf-8") for path in (ROOT / folder).rglob(files))
        for folder, files in (("accelstudy", "*.py"), ("tests", "test_*.py"))
    ]


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.what)
def test_a_fault_has_one_place_and_tests_that_should_fail(fault, texts):
    code, tests = texts
    assert code.count(fault.right) == 1, f"{fault.right!r} in tests/helpers/faults.txt"
    names = [name.partition("[")[0] for name in fault.tests]
    assert [name for name in names if f"\ndef {name}(" not in tests] == []
