"""The documents on hidden effects: their score is that of the code, and the pages quote it."""

import math
import re

import numpy as np
import pytest
from places import ROOT

from accelstudy.files.reading import read_layer
from studies.hidden.baselines import METHODS
from studies.hidden.campaigns import parse_hidden, row_of, table_of
from studies.hidden.physics.generate import Case
from studies.hidden.scoring.figures import figures
from studies.hidden.scoring.page import markdown, sample_table
from studies.hidden.study import SETS

DOCS = ROOT / "docs"
CONFIG = parse_hidden(read_layer(ROOT / "studies/hidden/config/hidden-effects.yaml"))
RENEWED = "`make hidden-docs`, which takes an hour, makes the score anew"


def rows_of(text):
    """Rows of the first Markdown table of a text, {head: cell}."""
    lines = re.search(r"(?:^\|.*\n)+", text + "\n", re.MULTILINE)[0].splitlines()
    heads, _, *rows = ([cell.strip() for cell in line.split("|")[1:-1]] for line in lines)
    return [dict(zip(heads, row, strict=True)) for row in rows]


class Score:
    """The score as it stands in the documents."""

    def __init__(self, text):
        self.head, *parts = re.split(r"^## ", text, flags=re.MULTILINE)
        self.tables = {part.partition("\n")[0]: rows_of(part) for part in parts}

    def row(self, figure, cases):
        for name in ("Targets", "Beside the targets"):
            for row in self.tables.get(name, ()):
                if row["figure"] == figure and cases in row["campaigns"]:
                    return row
        pytest.fail(f"the score has no {figure!r} of {cases!r}; {RENEWED}")

    def measured(self, figure, cases):
        value = self.row(figure, cases)["measured"]
        return math.nan if value == "–" else float(value)

    def percent(self, figure, cases):
        return 100 * self.measured(figure, cases)

    def wanted(self, figure, cases):
        return float(re.search(r"[\d.]+", self.row(figure, cases)["target"])[0])

    def oracle(self, figure, cases):
        return float(re.search(r"oracle ([\d.]+)", self.row(figure, cases)["target"])[1])

    def interval(self, figure, cases):
        return [100 * float(x) for x in self.row(figure, cases)["95 % interval"].split(" … ")]

    def of_size(self, column, *sizes):
        """Column of the table over the size, of some sizes or of all."""
        table = {float(r["λ"]): r for r in self.tables["One effect, over its size"]}
        assert column in table[25], f"the score has no {column!r}; {RENEWED}"
        return [float(table[size][column]) for size in sizes or table]


SCORE = Score((DOCS / "guides/hidden-effects-score.md").read_text(encoding="utf-8"))


def test_the_score_is_that_of_the_study():
    """Of this configuration and, where the study was run here, of this very run."""
    assert f"configuration `{CONFIG.fingerprint}`, seed {CONFIG.seed}" in SCORE.head
    made = ROOT / "results/hidden-effects/score.md"
    text = (DOCS / "guides/hidden-effects-score.md").read_text(encoding="utf-8")
    assert not made.exists() or made.read_text(encoding="utf-8") == text


def test_the_score_is_that_of_the_code():
    """Of a sample of its campaigns a third, as the golden set has 400 more, gets the answers."""
    told = SCORE.tables.get("A sample", [])[::3]
    assert told, f"the score has no sample; {RENEWED}"
    asked = [(case_of(row["cell"]), int(row["campaign"])) for row in told]
    job = CONFIG.simulated(asked)._replace(baselines_every=0)
    answers = table_of(row_of(job, case, k)[0] for case, k in asked)
    now = rows_of(markdown(sample_table(answers)))
    changed = [
        f"{old}\n  now {new}" for old, new in zip(told, now, strict=True) if not alike(old, new)
    ]
    assert not changed, (
        f"{len(changed)} of {len(told)} campaigns of the sample get another answer; {RENEWED}:\n"
        + "\n".join(changed)
    )


def case_of(name):
    """The case of a name; the reverse of `Case.name`."""
    set_, *hidden, design, approach, sigma = name.split("/")
    what, size = [*hidden, "", ""][:2]
    kinds = {set_: what} if set_ in ("noise", "gross") else {}
    effects = () if kinds or not what else tuple(what.split("+"))
    lam = (float(size),) * len(effects) if size else ()
    return Case(set_, design, approach, sigma == "sigma given", effects, lam, **kinds)


def alike(old, new):
    """Whether two rows of the sample say the same; processors may round another way."""
    numbers = {"posterior": {"abs": 0.02}, "σ₀²": {"rel": 0.02}}
    for head, told in old.items():
        if head in numbers and "–" not in (told, new[head]):
            if float(told) != pytest.approx(float(new[head]), **numbers[head]):
                return False
        elif told != new[head]:
            return False
    return True


@pytest.mark.parametrize(("head", "new", "same"), [
    ("posterior", "0.715", True),
    ("posterior", "0.68", False),
    ("posterior", "–", False),
    ("verdict", "narrowed", False),
    ("explanation", "warm up", False),
    ("σ₀²", "1.31", True),
    ("σ₀²", "1.4", False),
])  # fmt: skip
def test_another_answer_is_noticed(head, new, same):
    row = {"verdict": "named", "explanation": "bias drift", "posterior": "0.71", "σ₀²": "1.30"}
    assert alike(row, {**row, head: new}) == same


def test_the_documents_name_every_figure_set_and_method():
    text = (DOCS / "guides/hidden-effects.md").read_text(encoding="utf-8")
    make = (ROOT / "Makefile").read_text(encoding="utf-8")
    for name in (*figures({}), *SETS, *METHODS, *CONFIG.tables):
        assert f"| `{name}` |" in text
    assert f"for name in {' '.join(figures({}))};" in make


# --- sentences that quote the score ---------------------------------------------------------------

BEST = "best name right, named or narrowed"
WRONG, ONE_TWO = "named, and wrong", "one and two effects"
FALSE, SETS_HOLD = "false alarm", "90 % set holds the truth"
OUTSIDE, NEVER = "named or narrowed wrongly", "never in the catalogue"
BOTH, NAMES, LONE = "both of two right", "names in a 90 % set", "one of the two alone"
BEYOND = "names in a 90 % set beyond the oracle's"
CONFIRMED = "confirmed, given a name or a function"


def campaigns(s):
    return int(re.search(r"^(\d+) campaigns", s.head, re.MULTILINE)[1])


def confirmed(s):
    """How many are confirmed where nothing is missing, of how many names."""
    rows = (("by gravity alone, sigma not given", "nothing"), (CONFIRMED, "nothing missing"))
    return [int(s.row(*row)["n"]) for row in rows]


def alarms(s):
    return [s.percent(FALSE, f"sigma {given}") for given in ("given", "not given")]


def explained(s, size):
    return [*s.of_size("explanation right", size), *s.of_size("oracle right", size)]


def withheld(s):
    return [100 * explained(s, 25)[0], s.percent(BEST, "λ = 25")]


def surer(s):
    return [s.percent(WRONG, f"posterior from {p} on") for p in ("0.8", "0.85")]


def larger(s, column):
    """Range of a share over the sizes from 10 on, percent."""
    values = s.of_size(column)[1:]
    return [100 * min(values), 100 * max(values)]


def learned(s):
    """How often a right place is confirmed, and how much its function explains, percent."""
    figures = "confirmed", "share of λ explained, median"
    return [s.percent(figure, "place right") for figure in figures]


def wrongly(s):
    """How often what is not in the catalogue gets a wrong name, percent."""
    return [s.percent(OUTSIDE, cases) for cases in (NEVER, "unforeseen", "family taken out")]


def confirmed_wrongly(s):
    """How many of the wrong names are confirmed, percent."""
    row = "confirmed, of those wrong"
    return [s.percent(row, cases) for cases in ("unforeseen", "family taken out")]


def places(s):
    """How often the place of physics outside the catalogue is right, and wrong, percent."""
    return [s.percent(f"place {what}", NEVER) for what in ("right", "wrong")]


QUOTES = {
    "guides/hidden-effects.md": {
        r"in ([\d.]+) % \(sigma given\) and ([\d.]+) % of\s+([\d ]+) campaigns": lambda s: [
            *alarms(s), sum(int(row["n"]) for row in s.tables["Targets"] if row["figure"] == FALSE)
        ],
        r"In ([\d.]+) % of them something is confirmed": lambda s: [
            s.percent("confirmed", "nothing missing")
        ],
        r"([\d.]+) for ([\d.]+) at λ = 16": lambda s: explained(s, 16),
        r"([\d.]+) for ([\d.]+) at 25": lambda s: explained(s, 25),
        r"([\d.]+) for ([\d.]+) at 40": lambda s: explained(s, 40),
        r"in ([\d.]+) % at λ = 6 and in ([\d.]+) to ([\d.]+) % from 10 on": lambda s: [
            s.percent(SETS_HOLD, "λ = 6"), *larger(s, "set holds the truth")
        ],
        r"with ([\d.]+) names more than the oracle's sets at\s+λ = 10.5": lambda s: [
            s.measured(BEYOND, "λ = 10.5")
        ],
        r"and ([\d.]+) more at 60": lambda s: [s.measured(BEYOND, "λ = 60")],
        r"is right in (\d+) % of the campaigns, and given in (\d+) %": withheld,
        r"Of those withheld, (\d+) % need more than four": lambda s: [
            s.percent("more than 4 explanations, of those withheld", "λ = 25")
        ],
        r"Of the others (\d+) % have the noise in their set": lambda s: [
            s.percent("noise in the set, of the others withheld", "λ = 25")
        ],
        r"at its limit now\s+\(([\d.]+) %, ([\d.]+) to ([\d.]+)\)": lambda s: [
            s.percent("named or narrowed to effects", "wrong noise"),
            *s.interval("named or narrowed to effects", "wrong noise"),
        ],
        r"([\d.]+), ([\d.]+) and ([\d.]+) at λ = 25, 40 and 60": lambda s: [
            s.measured(NAMES, f"λ = {size}") for size in (25, 40, 60)
        ],
        r"where ([\d.]+), ([\d.]+) and ([\d.]+) are wanted": lambda s: [
            s.wanted(NAMES, f"λ = {size}") for size in (25, 40, 60)
        ],
        r"the oracle itself\s+needs ([\d.]+), ([\d.]+) and ([\d.]+)": lambda s: [
            s.oracle(NAMES, f"λ = {size}") for size in (25, 40, 60)
        ],
        r"`named`, and wrong: ([\d.]+) %": lambda s: [s.percent(WRONG, ONE_TWO)],
        r"posteriors\s+expect ([\d.]+) %": lambda s: [
            s.percent("named, and wrong, as the posteriors expect", ONE_TWO)
        ],
        r"In ([\d.]+) % of the wrong single names the oracle is wrong": lambda s: [
            s.percent("the oracle wrong, too", "a wrong single name")
        ],
        r"Names from 0.8 on are wrong in ([\d.]+) %, and those from 0.85 on in ([\d.]+) %": surer,
        r"Both are named in (\d+) and (\d+) % \(oracle (\d+) and (\d+) %\)": lambda s: [
            *(s.percent(BOTH, f"λ = {size}") for size in (25, 40)),
            *(100 * s.oracle(BOTH, f"λ = {size}") for size in (25, 40)),
        ],
        r"alone in another (\d+) %": lambda s: [s.percent(LONE, "λ = 25")],
        r"named wrongly in ([\d.]+) %, and among what nobody foresaw in ([\d.]+) %": lambda s: [
            s.percent(OUTSIDE, NEVER), s.percent(OUTSIDE, "unforeseen")
        ],
        r"The place is right in (\d+) % and wrong in ([\d.]+) %": places,
        r"that are right (\d+) % are confirmed, and the function explains (\d+) %": learned,
        r"that can be learned it is right in (\d+) %": lambda s: [
            s.percent("place right", "can be learned")
        ],
        r"imitate it in ([\d.]+) %": lambda s: [s.percent(OUTSIDE, "family taken out")],
        r"(\d+) % of these are confirmed": lambda s: [
            s.percent("confirmed, of those wrong", "family taken out")
        ],
        r"nothing missing:\*\* (\d+) of (\d+) \(([\d.]+) to ([\d.]+) %\)": lambda s: [
            *confirmed(s), *s.interval(CONFIRMED, "nothing missing")
        ],
        r"(\d+) of these (\d+) are sessions by gravity alone": lambda s: [
            confirmed(s)[0] * s.measured("by gravity alone, sigma not given", "nothing"),
            confirmed(s)[0],
        ],
        r"takes ([\d.]+) s of processor time": lambda s: [
            float(re.search(r"took ([\d.]+) s", s.head)[1])
        ],
    },
    "guides/missing.md": {
        r"In ([\d ]+) campaigns it finds": lambda s: [campaigns(s)],
        r"it gives are right in (\d+) %": lambda s: [100 - s.percent(WRONG, ONE_TWO)],
        r"it alarms in (\d+) %": lambda s: [100 * share_of_alarms(s)],
    },
    "limitations.md": {
        r"are of ([\d ]+) simulated campaigns": lambda s: [campaigns(s)],
        r"A wrong name\*\* is given in ([\d.]+) %": lambda s: [s.percent(WRONG, ONE_TWO)],
        r"from 0.85 on it is ([\d.]+) %": lambda s: surer(s)[1:],
        r"is right in (\d+) % of the campaigns and given in (\d+) %": withheld,
        r"both named in (\d+) %; an oracle manages (\d+) %": lambda s: [
            s.percent(BOTH, "λ = 25"), 100 * s.oracle(BOTH, "λ = 25")
        ],
        r"a wrong name in ([\d.]+) %, in ([\d.]+) % of physics[^.]*, and in ([\d.]+) %": wrongly,
        r"names of these two, (\d+) % and (\d+) % are even confirmed": confirmed_wrongly,
        r"the place is found in (\d+) %, and a wrong one in ([\d.]+) %": places,
        r"(\d+) of (\d+) were confirmed \((\d+) to (\d+) %": lambda s: [
            *confirmed(s), *s.interval(CONFIRMED, "nothing missing")
        ],
        r"nothing missing that is ([\d.]+) %": lambda s: [
            s.percent("confirmed", "nothing missing")
        ],
        r"taken for an effect in ([\d.]+) %": lambda s: [
            s.percent("named or narrowed to effects", "wrong noise")
        ],
    },
    "theory/evidence.md": {
        r"Measured in ([\d ]+) simulated": lambda s: [campaigns(s)],
        r"([\d.]+) % with a stated sigma, ([\d.]+) % without": alarms,
        r"([\d.]+) at \$\\lambda\$ = 6, ([\d.]+) to ([\d.]+) from 10 on": lambda s: [
            s.measured(SETS_HOLD, "λ = 6"), *(x / 100 for x in larger(s, "set holds the truth"))
        ],
        r"(\d+) % of those given": lambda s: [100 - s.percent(WRONG, ONE_TWO)],
        r"catalogue ([\d.]+) % got a wrong[^.]*, ([\d.]+) %; where[^.]*, ([\d.]+) %":
            wrongly,
        r"names of these two, (\d+) % and (\d+) % were confirmed": confirmed_wrongly,
        r"wrong in ([\d.]+) %, from 0.8 on in ([\d.]+) %, from 0.85 on in ([\d.]+) %": lambda s: [
            s.percent(WRONG, ONE_TWO), *surer(s)
        ],
    },
    "tutorials/hidden.md": {
        r"Of ([\d ]+) names that a study": lambda s: [int(s.row(WRONG, ONE_TWO)["n"])],
        r"([\d.]+) % were wrong": lambda s: [s.percent(WRONG, ONE_TWO)],
    },
}  # fmt: skip
"""Of each page: sentences, and the numbers of the score that they quote."""


def share_of_alarms(s):
    (null,) = (row for row in s.tables["Verdicts"] if row["campaigns"] == "nothing missing")
    return float(null["alarm"])


def off(said, value):
    """Whether a number differs from the score by more than it is rounded."""
    digits = len(said.partition(".")[2])
    return not abs(float(said.replace(" ", "")) - value) <= 0.51 * 10**-digits


@pytest.mark.parametrize("page", QUOTES)
def test_a_page_quotes_the_score(page):
    text = (DOCS / page).read_text(encoding="utf-8")
    wrong = []
    for pattern, values in QUOTES[page].items():
        found = re.search(pattern, text)
        assert found, f"{page}: no sentence {pattern}"
        expected = values(SCORE)
        if any(off(*pair) for pair in zip(found.groups(), expected, strict=True)):
            wrong.append(f"{found[0]!r}: the score has {', '.join(f'{x:.4g}' for x in expected)}")
    assert not wrong, f"docs/{page}:\n" + "\n".join(wrong)


def test_the_oracle_does_no_better_than_is_said():
    """In hidden-effects.md, missing.md and evidence.md.

    Finding within 0.01 from λ = 25 on, naming within 0.02 from 40 on, both within 0.05 below.
    """
    found, oracle = (np.array(SCORE.of_size(column)) for column in ("found", "oracle"))
    np.testing.assert_allclose(found[3:], oracle[3:], atol=0.0101)
    assert np.all(np.abs(found - oracle)[:3] < 0.0501)
    right, oracle = (np.array(SCORE.of_size(f"{who} right")) for who in ("explanation", "oracle"))
    np.testing.assert_allclose(right[4:], oracle[4:], atol=0.0201)
    assert np.all(np.abs(right - oracle) < 0.0501)


def test_what_is_said_of_the_sets_that_cannot_fail():
    assert SCORE.measured("recognised", "gross errors") == 1
    (unseen,) = (r for r in SCORE.tables["Verdicts"] if r["campaigns"] == "cannot be seen")
    assert float(unseen["alarm"]) == 0
