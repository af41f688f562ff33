"""Pictures in the documents that are older than the code are noticed.

Those of reports and tutorials are compared in test_examples.py, those of studies by `make smoke`.
"""

import pytest
from pictures import (
    DRAWN,
    PICTURES,
    difference,
    fingerprint,
    kept,
    of_code,
    seen,
)

SVG = """<svg><defs><path d="M 0 0"/></defs><g id="axes_1"><!-- {} -->
<path d="M 10 20 L 30 40"/><use xlink:href="#m" x="{}" y="50.0"/></g></svg>"""


def test_no_picture_is_drawn_by_other_code_than_it_was():
    stored = kept()
    old = [f"{n}: {DRAWN[n][0]}" for n, now in of_code().items() if stored.get(n) != now]
    assert not old, "\n".join(["docs/figures has pictures that other code drew:", *old,
                               "then: python tests/helpers/pictures.py drawn NAME"])  # fmt: skip


def test_each_picture_says_what_made_it():
    beginnings = {"sweep-": "sweeps", "hidden-": "hidden", "residuals-": "residuals"}
    for path in PICTURES.glob("*.png"):
        own = next((v for k, v in beginnings.items() if path.stem.startswith(k)), path.stem)
        assert own in kept(), path.name


@pytest.mark.parametrize(("words", "x", "said"), [
    ("right to 9.25 mgon", "60.0", ""), ("right to 9.26 mgon", "60.02", ""),
    ("right to 9.4 mgon", "60.0", "9.4 instead of 9.25"),
    ("right to 9.25 mgon", "66.0", "38 instead of 35"),
    ("wrong to 9.25 mgon", "60.0", "other words"),
    ("right to 9.25 and 3 mgon", "60.0", "other words"),
])  # fmt: skip
def test_words_and_points_count_and_last_digits_do_not(tmp_path, words, x, said):
    texts = []
    for given in (("right to 9.25 mgon", "60.0"), (words, x)):
        (tmp_path / "one.svg").write_text(SVG.format(*given), encoding="utf-8")
        texts.append(seen(tmp_path / "one.svg"))
    assert difference(fingerprint(texts[0]), texts[1]) == said
