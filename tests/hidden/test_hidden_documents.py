"""The documents on hidden effects: their score is that of the code, and the pages quote it."""

import pytest
import quotes
from places import ROOT

from accelstudy.files.reading import read_layer
from studies.hidden.baselines import METHODS
from studies.hidden.campaigns import parse_hidden
from studies.hidden.scoring.tables import SCORES
from studies.hidden.study import SETS

DOCS = ROOT / "docs"


@pytest.mark.parametrize("study", ["hidden-effects", "real-noise"])
def test_the_score_is_that_of_the_study(study):
    """Of this configuration and, where the study was run here, of this very run."""
    config = parse_hidden(read_layer(ROOT / f"studies/hidden/config/{study}.yaml"))
    score = (DOCS / f"guides/{study}-score.md").read_text(encoding="utf-8")
    assert f"configuration `{config.fingerprint}`, seed {config.seed}" in score
    made = ROOT / f"results/{study}/score.md"
    assert not made.exists() or made.read_text(encoding="utf-8") == score


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
