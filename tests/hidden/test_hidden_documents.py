"""The documents on hidden effects: their score is that of the code, and the pages quote it."""

import pandas as pd
import pytest
import quotes
from hidden_sample import SAMPLE, answers
from places import ROOT

from accelstudy.files.reading import read_layer
from studies.hidden.baselines import METHODS
from studies.hidden.campaigns import parse_hidden, row_of
from studies.hidden.physics.generate import Case
from studies.hidden.scoring.page import frames
from studies.hidden.scoring.tables import SCORES
from studies.hidden.study import SETS

DOCS = ROOT / "docs"
CONFIG = parse_hidden(read_layer(ROOT / "studies/hidden/config/hidden-effects.yaml"))
RENEWED = "`make hidden-docs`, which takes an hour, makes the score anew"


@pytest.mark.parametrize("study", ["hidden-effects", "real-noise"])
def test_the_score_is_that_of_the_study(study):
    """Of this configuration and, where the study was run here, of this very run."""
    config = parse_hidden(read_layer(ROOT / f"studies/hidden/config/{study}.yaml"))
    score = (DOCS / f"guides/{study}-score.md").read_text(encoding="utf-8")
    assert f"configuration `{config.fingerprint}`, seed {config.seed}" in score
    made = ROOT / f"results/{study}/score.md"
    assert not made.exists() or made.read_text(encoding="utf-8") == score


def test_the_score_is_that_of_the_code():
    """Of a sample of its campaigns an eighth, as the golden set has 400 more, gets the answers."""
    told = pd.read_csv(SAMPLE, keep_default_na=False).to_dict("records")[::8]
    assert len(told) > 5
    asked = [(case_of(row["cell"]), int(row["campaign"])) for row in told]
    quiet = CONFIG.model_copy(update={"baselines_every": 0})
    judged = frames([row_of(quiet, case, k) for case, k in asked], CONFIG)["campaigns"]
    now = answers(judged).astype(object).fillna("").to_dict("records")
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
    numbers = {"posterior": {"abs": 0.02}, "sigma0": {"rel": 0.02}}
    for head, told in old.items():
        if head in numbers and "" not in (told, new[head]):
            if float(told) != pytest.approx(float(new[head]), **numbers[head]):
                return False
        elif str(told) != str(new[head]):
            return False
    return True


def test_the_documents_name_every_set_and_method_and_take_every_figure():
    text = (DOCS / "guides/hidden-effects.md").read_text(encoding="utf-8")
    make = (ROOT / "Makefile").read_text(encoding="utf-8")
    for name in (*SETS, *METHODS):
        assert f"| `{name}` |" in text
    assert f"for name in {' '.join(SCORES['score']['figures'])};" in make


def test_every_quote_of_the_pages_is_in_the_score():
    pages = {path: path.read_text(encoding="utf-8") for path in DOCS.rglob("*.md")}
    quoting = [path.name for path, text in pages.items() if "{score: " in text]
    assert {"hidden-effects.md", "limitations.md", "evidence.md"} <= {*quoting}
    for path, text in pages.items():
        assert "{score" not in quotes.fill(text), path


@pytest.mark.parametrize(("quote", "said"), [
    ("found; 10 effects", "0.031"),
    ("found; 10 effects; %", "3.1 %"),
    ("found; 10 effects; n", "13 500"),
    ("found; 10 effects; oracle %", "64 %"),
    ("right; λ = 10.5; %", "7.0 %"),
])  # fmt: skip
def test_a_quote_of_a_score(quote, said):
    score = """
| figure | campaigns | target | measured | 95 % interval | n |
| --- | --- | --- | --- | --- | --- |
| found | 10 effects | ≥ 0.42 (oracle 0.64) | 0.031 | 0.028 … 0.34 | 13500 |

| λ | right |
| --- | --- |
| 10.5 | 0.070 |
"""
    assert quotes.quoted(*quote.split("; "), score=score) == said


def test_a_quote_that_the_score_lacks_is_an_error():
    with pytest.raises(ValueError, match="has no 'luck' of 'all'"):
        quotes.fill("By {score: luck; all; %} of it.")
