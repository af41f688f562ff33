"""Numbers that pages quote from the score of the hidden effects, put in while the site is built.

A page says ``{score: figure; campaigns; what}``: what was measured in the row with this figure and
these campaigns, or with %, n, interval, oracle, oracle % or target that of it; or of an effect by
its size, as in ``{score: found; λ = 25}``.
"""

import re
from decimal import Decimal
from pathlib import Path

SCORE = Path(__file__).parents[1] / "guides" / "hidden-effects-score.md"
CLAIMS = Path(__file__).parents[2] / "tests/golden/paper/claims-command.txt"
QUOTE = re.compile(r"\{score:\s([^;}]+);\s([^;}]+)(?:;\s([^;}]+))?\}")


def rows(text):
    """Rows of all tables of a page, {head: cell}."""
    for lines in re.findall(r"(?:^\|.*\n)+", text, re.MULTILINE):
        heads, _, *cells = (
            [c.strip() for c in line.split("|")[1:-1]] for line in lines.splitlines()
        )
        yield from (dict(zip(heads, row, strict=True)) for row in cells)


def quoted(figure, campaigns, what="measured", score=None):
    """A number of the score as a sentence has it."""
    for row in rows(SCORE.read_text(encoding="utf-8") if score is None else score):
        if row.get("figure") == figure and row["campaigns"] == campaigns:
            if what.startswith("oracle"):
                oracle = re.search(r"oracle ([\d.]+)", row["target"])[1]
                return percent(oracle) + " %" if what == "oracle %" else oracle
            if what == "target":
                return re.search(r"[\d.]+", row["target"])[0]
            if what == "n":
                return f"{int(row['n']):,}".replace(",", " ")
            if what == "interval":
                low, high = map(percent, row["95 % interval"].split(" … "))
                return f"{low} to {high} %"
            return percent(row["measured"]) + " %" if what == "%" else row["measured"]
        if figure in row and f"λ = {row.get('λ')}" == campaigns:
            return percent(row[figure]) + " %" if what == "%" else row[figure]
    raise ValueError(f"{SCORE.name} has no {figure!r} of {campaigns!r}")


def claims():
    """The claims of the paper, as the golden set has them."""
    table = CLAIMS.read_text(encoding="utf-8").partition("> |")[2].partition("\n>\n")[0]
    return "|" + table.replace("\n> ", "\n")


def percent(share):
    """A share as a percentage with as many digits."""
    return f"{Decimal(share).scaleb(2):f}"


def fill(markdown):
    """Put the numbers into a page."""
    return QUOTE.sub(lambda quote: quoted(*(part for part in quote.groups() if part)), markdown)
