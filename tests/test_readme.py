"""The README: its example runs, and its commands exist."""

import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def test_the_example_runs():
    example = next(
        block for block in re.findall(r"```python\n(.*?)```", README, re.S) if "calibrate(" in block
    )
    run = subprocess.run([sys.executable, "-c", example], capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    assert len(re.findall(r"\d", run.stdout)) > 50  # three arrays of numbers


def test_make_targets_and_files_exist():
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    targets = set(re.findall(r"(?:^    |`)make ([a-z-]+)", README, re.M)) - {"help"}
    assert {"reproduce", "test", "smoke"} <= targets
    for target in targets:
        assert re.search(rf"^{target}:", makefile, re.M), target
    for name in re.findall(r"`((?:config|benchmarks|docs|accelstudy)/[\w/.]+)`", README):
        assert (ROOT / name).exists(), name
