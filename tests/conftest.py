"""Settings of all tests: the same examples, no clock, and angles in gon whatever the user chose."""

import os

import pytest
from hypothesis import settings

from accelstudy.drawing import saving

settings.register_profile("repeatable", deadline=None, derandomize=True, max_examples=50)
settings.load_profile("repeatable")
os.environ.pop("ACCELSTUDY_ANGLE_UNIT", None)


LONGEST = ("test_workflow.py", "test_campaign_batch.py", "test_every_path.py", "test_diagnosis.py")


def pytest_collection_modifyitems(items):
    """Let the longest files come first, or one process would still be at them, and others wait."""
    items.sort(key=lambda item: item.path.name not in LONGEST)


@pytest.fixture
def not_rendered(monkeypatch):
    """Figures of pages are composed, but not rendered, which takes more time than all the rest."""
    monkeypatch.setattr(saving, "save", lambda *_: "<svg></svg>")
