"""Settings of all tests: the same examples, no clock, and angles in gon whatever the user chose."""

import os

import pytest
from hypothesis import settings

from accelstudy.drawing import saving

settings.register_profile("repeatable", deadline=None, derandomize=True, max_examples=50)
settings.load_profile("repeatable")
os.environ.pop("ACCELSTUDY_ANGLE_UNIT", None)


LONGEST = (
    "test_campaign_batch.py", "test_plan.py", "test_workflow.py", "test_every_path.py",
    "test_optimal.py", "test_golden.py", "test_examples.py", "test_hidden_documents.py",
    "test_diagnosis.py", "test_designs.py", "test_diagnosis_workflow.py", "test_any_model.py",
)  # fmt: skip
"""The longest first."""


def pytest_collection_modifyitems(items):
    """Let the longest files come first, or one process would still be at them, and others wait."""
    rank = {name: place for place, name in enumerate(LONGEST)}
    items.sort(key=lambda item: rank.get(item.path.name, len(rank)))


@pytest.fixture
def not_rendered(monkeypatch):
    """Figures of pages are composed, but not rendered, which takes more time than all the rest."""
    monkeypatch.setattr(saving, "save", lambda *_: "<svg></svg>")
