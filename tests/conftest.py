"""Settings of all tests: the same examples, no clock, and angles in gon whatever the user chose."""

import os

import pytest
from hypothesis import settings

from accelstudy.figures import saving

settings.register_profile("repeatable", deadline=None, derandomize=True, max_examples=50)
settings.load_profile("repeatable")
os.environ.pop("ACCELSTUDY_ANGLE_UNIT", None)


@pytest.fixture
def not_rendered(monkeypatch):
    """Figures of pages are composed, but not rendered, which takes more time than all the rest."""
    monkeypatch.setattr(saving, "save", lambda *_: "<svg></svg>")
