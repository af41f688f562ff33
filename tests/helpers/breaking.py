"""Break a copy of the package on purpose, in one place after the other, and see a test fail.

`make test-breaks` tries all faults, `python tests/helpers/breaking.py diagnosis` those of one room.
The faults are in faults.txt: each is a line that is slightly wrong. It is looked up by its text,
wherever in the package that stands, and a test by its name, so that code and tests may move.
"""

import os
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
WRITTEN = Path(__file__).with_name("faults.txt")
FAILED, PASSED = 1, 0


@dataclass(frozen=True)
class Fault:
    """A text of the package, what becomes of it, and the tests that should fail then.

    Where no test has such a name any more, all tests of the folder `room` are run instead, which
    takes minutes.
    """

    room: str
    what: str
    right: str
    wrong: str
    tests: tuple[str, ...]

    @classmethod
    def read(cls, text: str) -> "Fault":
        """Read it as it stands in faults.txt."""
        first, right, wrong, *tests = text.splitlines()
        room, what = first.split(": ", 1)
        return cls(room, what, right[2:], wrong[2:], tuple(test[2:] for test in tests))


FAULTS = [Fault.read(block) for block in WRITTEN.read_text(encoding="utf-8").split("\n\n")]


def main() -> None:
    """Exit with 0 if every fault of the chosen rooms is caught."""
    rooms, known = sys.argv[1:], list(dict.fromkeys(one.room for one in FAULTS))
    if unknown := [room for room in rooms if room not in known]:
        sys.exit(f"no faults in {', '.join(unknown)}; there are some in {', '.join(known)}")
    chosen = [one for one in FAULTS if not rooms or one.room in rooms]
    with tempfile.TemporaryDirectory(prefix="accelstudy-breaks-") as folder:
        package = Path(folder) / "accelstudy"
        shutil.copytree(ROOT / "accelstudy", package)
        missed = missed_of(chosen, package)
    print(f"{len(chosen) - missed} of {len(chosen)} faults are caught")
    sys.exit(missed > 0)


def missed_of(chosen: list[Fault], package: Path) -> int:
    """Print a line for each fault, and return how many no test catches."""
    used = python("-c", "import accelstudy; print(accelstudy.__file__)", package=package)
    if Path(used.stdout.strip()).parent != package:
        sys.exit(f"tests would use {used.stdout.strip()}, not the copy\n{used.stderr}")
    status, failed = run(sorted({test for one in chosen for test in places(one)}), package)
    if status != PASSED:
        sys.exit(f"before anything is broken, tests fail: {failed}")
    missed = 0
    for one in chosen:
        verdict = verdict_on(one, package)
        missed += not verdict.startswith("caught")
        print(f"{one.room + ':':12}{one.what}\n{'':12}{verdict}", flush=True)
    return missed


def verdict_on(one: Fault, package: Path) -> str:
    """Break the package, run the tests, and mend it."""
    texts = {path: path.read_text(encoding="utf-8") for path in package.rglob("*.py")}
    times = sum(text.count(one.right) for text in texts.values())
    if times != 1:
        return f"NOT TRIED: {one.right!r} is in the package {times} times, not once"
    path, text = next((path, text) for path, text in texts.items() if one.right in text)
    path.write_text(text.replace(one.right, one.wrong), encoding="utf-8")
    status, failed = run(places(one), package)
    path.write_text(text, encoding="utf-8")
    if status == FAILED:
        return f"caught by {failed}"
    return "NOT CAUGHT" if status == PASSED else f"NOT TRIED: pytest ends with status {status}"


def places(one: Fault) -> list[str]:
    """Where the tests are that should fail: files with names of tests, or a whole folder."""
    files = {path: path.read_text("utf-8") for path in (ROOT / "tests").rglob("test_*.py")}
    found = [
        f"{path.relative_to(ROOT)}::{name}"
        for name in one.tests
        for path, text in files.items()
        if f"\ndef {name.partition('[')[0]}(" in text
    ]
    return found or [f"tests/{one.room}"]


def run(tests: list[str], package: Path) -> tuple[int, str]:
    """Exit status of pytest with a package, and the first test that fails."""
    # The folder that pyproject.toml puts first would have the package unbroken.
    options = ["-q", "-x", "-rfE", "--no-header", "--tb=no", "-p", "no:cacheprovider"]
    options += ["--override-ini", "pythonpath=tests/helpers docs/hooks benchmarks"]
    lines = (done := python("-m", "pytest", *options, *tests, package=package)).stdout.splitlines()
    failed = [line.split()[1] for line in lines if line.startswith(("FAILED", "ERROR"))]
    return done.returncode, " ".join(failed)


def python(*words: str, package: Path) -> subprocess.CompletedProcess[str]:
    """Run Python with a package, and with nothing of this folder."""
    environment = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join(map(str, (package.parent, ROOT))),  # studies/ is there alone
        "PYTHONDONTWRITEBYTECODE": "1",
        "OPENBLAS_NUM_THREADS": "1",
    }
    command = [sys.executable, "-P", *words]
    return subprocess.run(command, cwd=ROOT, env=environment, text=True, capture_output=True)


if __name__ == "__main__":
    main()
