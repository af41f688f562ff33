"""Settings of all tests: the same examples, no clock, no pictures, and angles in gon."""

import os

import pytest
import stand_ins
from hypothesis import HealthCheck, settings

from accelstudy.drawing import saving

settings.register_profile(
    "repeatable",
    deadline=None,
    derandomize=True,
    max_examples=50,
    suppress_health_check=[HealthCheck.too_slow],  # no test fails by a clock
)
settings.load_profile("repeatable")
os.environ.pop("ACCELSTUDY_ANGLE_UNIT", None)
saving._element = stand_ins.element  # unless a test asks for `composed` or `drawn`


LONGEST = (
    "test_golden.py", "test_workflow.py", "test_every_path.py", "test_explorer.py", "test_lots.py",
    "test_diagnosis.py", "test_gross_errors.py", "test_history.py", "test_plan.py", "test_level.py",
    "test_hidden_physics.py", "test_type_file.py", "test_results.py", "test_figures.py",
    "test_diagnosis_input.py", "test_installed.py", "test_kernel.py", "test_diagnosis_output.py",
)  # fmt: skip
"""The longest first."""


def pytest_collection_modifyitems(items):
    """Let the longest files come first, or one process would still be at them, and others wait."""
    rank = {name: place for place, name in enumerate(LONGEST)}
    items.sort(key=lambda item: rank.get(item.path.name, len(rank)))


@pytest.fixture
def composed():
    """Figures of pages are composed, but not rendered."""
    with stand_ins.composed():
        yield


@pytest.fixture
def drawn():
    """Figures of pages are drawn."""
    with stand_ins.drawn():
        yield
