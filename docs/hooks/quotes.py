"""What pages quote of computed numbers, put in while the site is built.

A page says ``<!-- quotes.kept("logs", "xsens-mti") -->`` for a text of the golden set,
``<!-- quotes.printed("log", "accelstudy import") -->`` for what a command of an example prints, and
``{real-data: rms after}`` for a number of the golden part on public measurements.

Of the score of the hidden effects it says ``{score: figure; campaigns}`` for what was measured in
the row with this figure and these campaigns, ``{score: figure; campaigns; %}`` for the same in
percent, and n or oracle % for their number and what the oracle reaches;
``{score: found; λ = 25; %}`` is of an effect by its size.
"""

import re
from decimal import Decimal
from pathlib import Path

SCORE = Path(__file__).parents[1] / "guides" / "hidden-effects-score.md"
GOLDEN = Path(__file__).parents[2] / "tests/golden"
QUOTE = re.compile(r"\{score:\s([^;}]+);\s([^;}]+)(?:;\s([^;}]+))?\}")


def rows(text):
    """Rows of all tables of a page, {head: cell}."""
    for lines in re.findall(r"(?:^\|.*\n)+", text, re.MULTILINE):
        heads, _, *cells = (
            [c.strip() for c in line.split("|")[1:-1]] for line in lines.splitlines()
        )
        yield from (dict(zip(heads, row, strict=True)) for row in cells)


def quoted(figure, campaigns, what="", score=None):
    """A number of the score as a sentence has it."""
    for row in rows(SCORE.read_text(encoding="utf-8") if score is None else score):
        if row.get("figure") == figure and row["campaigns"] == campaigns:
            if what == "n":
                return f"{int(row['n']):,}".replace(",", " ")
            oracle = what == "oracle %"
            number = re.search(r"oracle ([\d.]+)", row["target"])[1] if oracle else row["measured"]
        elif figure in row and f"λ = {row.get('λ')}" == campaigns:
            number = row[figure]
        else:
            continue
        return f"{Decimal(number).scaleb(2):f} %" if what.endswith("%") else number
    raise ValueError(f"{SCORE.name} has no {figure!r} of {campaigns!r}")


def kept(part, name):
    """A text of the golden set."""
    return (GOLDEN / part / f"{name}.txt").read_text(encoding="utf-8")


def printed(example, *commands):
    """What commands of an example print, by their beginnings; numbers at the end choose lines."""
    ends = [one for one in commands if isinstance(one, int)] or [None]
    (path,) = GOLDEN.glob(f"tutorial*/{example}.txt")
    steps = path.read_text(encoding="utf-8").split("=== ")[1:]
    chosen = [s for s in steps if s.startswith(tuple(c for c in commands if isinstance(c, str)))]
    lines = []
    for step in chosen:  # as on a terminal warnings come first, and files follow
        said = step.partition("\n--- ")[0].splitlines()
        lines += [line[2:] for mark in "!>" for line in said if line.startswith(mark)]
    return "\n".join(lines[slice(*ends)])


def number(name):
    """A number that was computed of public measurements, or a list of words."""
    return dict(line.split(": ", 1) for line in kept("real-data", "numbers").splitlines())[name]


def claims():
    """The claims of the paper, as the golden set has them."""
    table = kept("paper", "claims-command").partition("> |")[2]
    return "|" + table.replace("\n> ", "\n")


def fill(markdown):
    """Put the numbers into a page."""
    markdown = re.sub(r"\{real-data: ([^}]+)\}", lambda quote: number(quote[1]), markdown)
    return QUOTE.sub(lambda quote: quoted(*(part for part in quote.groups() if part)), markdown)
