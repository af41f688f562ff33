"""Where the repository is, and the public measurements that some tests use."""

import os
from pathlib import Path

ROOT = Path(__file__).parents[2]
SHARED = Path(os.environ.get("ACCELSTUDY_SHARED", ROOT.parent / "shared"))
DATA = SHARED / "data"
