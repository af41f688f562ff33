"""What is kept in this folder still comes out, and a change is told by file and line.

Here the quick parts; `make golden` compares all of them.
"""

import re

import pytest
from golden import compare, kept_of, report, same_number
from golden_parts import OF_DATA, PAGES, PARTS, QUICK
from places import ROOT, needs_data

from accelstudy.commands.main import main


@pytest.mark.usefixtures("drawn")
@pytest.mark.parametrize(
    "part", [pytest.param(part, marks=[needs_data] * (part in OF_DATA)) for part in QUICK]
)
def test_what_is_kept_still_comes_out(part, capsys):
    same = report(part)
    said = capsys.readouterr().out
    assert same, f"{said}\n`make golden-renew PART={part}` keeps what comes now"


# --- what is kept --------------------------------------------------------------------------------


def test_each_part_is_kept_and_3_mb_are_enough():
    sizes = {part: sum(map(len, kept_of(part).values())) for part in PARTS}
    assert all(sizes.values())
    assert sum(sizes.values()) < 3e6


def test_no_command_of_a_page_fails_and_no_picture_is_old():
    for part in PARTS.keys() - {"quiet"}:  # three of these are to fail
        for name, text in kept_of(part).items():
            assert not re.findall("^=== .*\nexit status .*", text, re.M), f"{part}/{name}"
            assert "not as its tutorial shows it" not in text, f"{part}/{name}; `make pictures`"


def test_what_is_refused_is_one_line_and_nothing_is_written():
    text = "".join(kept_of("refusals").values())
    answers = re.split(r"^(?:=== |acs\.|accelstudy (?!.*…)).*\n", text, flags=re.M)[1:]
    assert len(answers) > 300
    line = r"! error: .*\n+((accelstudy|parse) .*\n)?"  # and the command of the next ones
    assert [said for said in answers if not re.fullmatch(line, said)] == []


def test_each_help_has_an_example():
    texts = kept_of("help")
    assert texts.keys() == {"accelstudy", *main.commands}
    for command in main.commands:
        assert re.search(rf"Example:\n +accelstudy {command}\b", texts[command]), command


def test_each_command_with_quiet_is_kept():
    """But of plan, which takes longer, claims, which needs a study, and public, which downloads."""
    has = {name for name, c in main.commands.items() if "quiet" in {p.name for p in c.params}}
    has -= {"plan", "claims", "public"}
    text = kept_of("quiet")["quiet"]
    assert {*re.findall("^=== accelstudy ([a-z-]+).* --quiet", text, re.M)} == has


def test_the_readme_quotes_what_its_commands_print():
    text = (ROOT / "README.md").read_text("utf-8")
    blocks = re.findall(r"^```(\w*)\n(.*?)^```$", text, re.M | re.S)
    printed = "".join(kept_of(part)["README"] for part in ("readme", "plans"))
    quoted = [
        line for kind, block in blocks if not kind for line in block.splitlines() if line != "…"
    ]
    assert len(quoted) > 5
    assert [line for line in quoted if f"> {line}\n" not in printed] == []


def test_output_that_a_page_shows_is_what_came_out():
    kept = {line for part in PARTS for text in kept_of(part).values() for line in text.split("\n")}
    for path in {path for paths in PAGES.values() for path in paths if path.endswith(".md")}:
        text = (ROOT / path).read_text(encoding="utf-8")
        shown = re.findall(r"^```\{\.text \.wrap\}\n((?!--8<--|<!-- )[^`]*)^```", text, re.M)
        lines = {f"> {line}" for line in "".join(shown).splitlines() if line}
        assert lines <= kept, lines - kept


# --- comparing -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("one", "other", "same"),
    [
        ("0.1234567890123", "0.1234567890124", True),  # 1e-12 of its size
        ("1.00000000001e5", "100000.000002", True),
        ("-3e-17", "2.5e-16", True),  # rounding of zero
        ("3e-7", "2e-7", False),
        ("-0.00", "0.00", True),
        ("0.123456", "0.123457", True),  # printed with six digits: one in the last
        ("0.123456", "0.123458", False),
        ("0.12346", "0.123461", True),  # a zero at the end is not printed
        ("9.88", "9.87", False),  # too few digits
        ("−9.88", "9.88", False),
        ("123456", "123457", False),  # whole numbers are counted
    ],
)
def test_numbers_that_are_the_same(one, other, same):
    assert same_number(one, other) == same


KEPT = "ACCEPTED: p = 0.96\n  b_x = 0.10263162904837\nlast\n"


@pytest.mark.parametrize(
    ("now", "lines"),
    [
        (KEPT.replace("4837", "4839"), []),
        (KEPT.replace("b_x = ", "b_x =   "), []),  # numbers of other widths
        (KEPT.replace("\n  b", "\n b"), [2]),
        (KEPT.replace("0.102", "0.103"), [2]),
        (KEPT + "more\n", [4]),
        ("", [1, 2, 3]),
    ],
)
def test_a_difference_is_told_by_its_line(now, lines):
    differences, merged = compare(KEPT, now)
    assert [each.line for each in differences] == lines
    assert merged == (now if lines else KEPT)  # renewing changes no line that agrees
