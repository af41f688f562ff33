"""Where the repository is, and the public measurements that some tests use."""

import os
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SHARED = Path(os.environ.get("ACCELSTUDY_SHARED", ROOT.parent / "shared"))
DATA = SHARED / "data"
needs_data = pytest.mark.skipif(
    not DATA.is_dir(), reason=f"needs the public data in {DATA}; set ACCELSTUDY_SHARED"
)
