"""The golden set: what commands print and write, and what studies find, kept as text in git.

    python tests/helpers/golden.py [PART ...]            # compare with what is kept
    python tests/helpers/golden.py --renew PART ...      # keep what comes out now instead

`golden_parts.py` makes the texts of each part, which are kept as tests/golden/PART/NAME.txt.

Words must be the same, and so must whole numbers. Other numbers may differ by 1e-7 of their size,
by 1e-10, by anything where both are at most 1e-8, which is rounding of zero, or, printed with 6 to
9 digits, by one in the last digit. A number printed with fewer digits must be the same: another
processor changes most numbers by 1e-12 or so, and of a million numbers of five digits hardly one
lies so near to the middle between two. Renewing leaves a line that agrees as it was kept.
"""

import difflib
import os
import re
import sys
import tempfile
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from itertools import zip_longest
from pathlib import Path
from typing import NamedTuple

from golden_parts import OF_DATA, PARTS
from places import DATA, ROOT
from transcript import FORK, import_all

GOLDEN = ROOT / "tests" / "golden"
RELATIVE, ABSOLUTE, ZERO, DIGITS = 1e-7, 1e-10, 1e-8, 6
SHOWN = 20
"""Differences of a file that are shown one by one."""
NUMBER = re.compile(r"(?<![\w.])[-−+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")
WHOLE = re.compile(r"[-−+]?\d+")


def value(number):
    return float(number.replace("−", "-"))


def numbers(text):
    """Numbers of a text, without their units."""
    return [value(number) for number in NUMBER.findall(text)]


def last_digit(number):
    """How many digits a number is printed with, and the worth of the last one."""
    mantissa, _, exponent = number.lower().lstrip("+-−").partition("e")
    digits = len(mantissa.replace(".", "").lstrip("0"))
    return digits, 10.0 ** (int(exponent or 0) - len(mantissa.partition(".")[2]))


def same_number(one, other):
    if one == other:
        return True
    if WHOLE.fullmatch(one) and WHOLE.fullmatch(other):
        return False
    off, size = abs(value(one) - value(other)), max(abs(value(one)), abs(value(other)))
    if off <= max(RELATIVE * size, ABSOLUTE) or size <= ZERO:
        return True
    digits, unit = max(last_digit(one), last_digit(other))
    return digits >= DIGITS and off <= 1.001 * unit


def words(line):
    """A line without its numbers, and without the spaces that align them."""
    return re.sub(r"(?<=\S) +", " ", NUMBER.sub("#", line.rstrip()))


def changes(one, other):
    """Relative changes of the numbers that differ between two lines of the same words."""
    pairs = zip(NUMBER.findall(one), NUMBER.findall(other), strict=True)
    apart = [(value(a), value(b)) for a, b in pairs if not same_number(a, b)]
    return [abs(a - b) / max(abs(a), abs(b), ZERO) for a, b in apart]  # 0 became −0


class Difference(NamedTuple):
    """A line that differs, and the largest relative change in it; None where words differ."""

    line: int
    expected: str | None
    got: str | None
    change: float | None = None

    def __str__(self):
        said = [("expected", self.expected), ("got     ", self.got)]
        return "\n".join([str(self.line), *(f"  {k} {v}" for k, v in said if v is not None)])


def compare(kept, now):
    """What differs between two texts, and the new one with the lines of the old that agree."""
    old, new = kept.splitlines(), now.splitlines()
    wordings = [[words(line) for line in lines] for lines in (old, new)]
    blocks = [("equal", 0, len(old), 0, len(new))]
    if wordings[0] != wordings[1]:
        blocks = difflib.SequenceMatcher(None, *wordings, autojunk=False).get_opcodes()
    differences, merged = [], []
    for kind, start, end, first, last in blocks:
        pairs = zip_longest(old[start:end], new[first:last])
        for line, (one, other) in enumerate(pairs, start + 1):
            moved = changes(one, other) if kind == "equal" else [None]
            if moved:
                differences.append(Difference(min(line, end + 1), one, other, max(moved)))
            if other is not None:
                merged.append(other if moved else one)
    return differences, "".join(f"{line}\n" for line in merged)


def kept_of(part):
    """Texts of a part as they are kept."""
    return {path.stem: path.read_text("utf-8") for path in sorted((GOLDEN / part).glob("*.txt"))}


def made(part):
    """Texts of a part as they come out now."""
    with tempfile.TemporaryDirectory(prefix="golden-") as folder:
        return dict(PARTS[part](Path(folder)))


def report(part, renew=False):
    """Say where a part differs from what is kept; or by how much, and keep it anew."""
    before = sum(os.times()[:4])
    kept, now = kept_of(part), made(part)
    said = []
    for name in sorted({*kept, *now}):
        path = GOLDEN / part / f"{name}.txt"
        found, merged = compare(kept.get(name, ""), now.get(name, ""))
        if not found:
            continue
        moved = [each.change for each in found if each.change is not None]
        alone = f", {len(moved)} in numbers alone, by up to {max(moved):.1g}" if moved else ""
        said.append(f"{path.relative_to(ROOT)}: {len(found)} lines differ{alone}")
        if not renew:
            said += map(str, found[:SHOWN])
        elif name in now:
            path.parent.mkdir(exist_ok=True)
            path.write_text(merged, "utf-8")
        else:
            path.unlink()
    verdict = "as kept" if not said else "renewed" if renew else "differs"
    print(f"{part}: {verdict} ({sum(os.times()[:4]) - before:.0f} s)", *said, sep="\n", flush=True)
    return not said


def main(*arguments):
    renew = "--renew" in arguments
    parts = [name for name in arguments if name != "--renew"] or ([] if renew else [*PARTS])
    if not parts or not {*parts} <= PARTS.keys():
        sys.exit(f"name parts of {', '.join(PARTS)}")
    if not DATA.is_dir() and (without := [part for part in parts if part in OF_DATA]):
        print(f"{', '.join(without)}: not compared; there is no {DATA}: set ACCELSTUDY_SHARED")
        parts = [part for part in parts if part not in OF_DATA]
    import_all()
    with ProcessPoolExecutor(int(os.environ.get("CORES", 2)), FORK) as pool:
        same = [*pool.map(partial(report, renew=renew), parts)]
    sys.exit(not (renew or all(same)))


if __name__ == "__main__":
    main(*sys.argv[1:])
