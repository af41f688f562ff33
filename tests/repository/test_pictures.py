"""Pictures in the documents that are older than the code are noticed.

Those of reports and tutorials are compared in test_examples.py, those of studies by `make smoke`.
"""

import pytest
from pictures import difference, fingerprint, seen

SVG = """<svg><defs><path d="M 0 0"/></defs><g id="axes_1"><!-- {} -->
<path d="M 10 20 L 30 40"/><use xlink:href="#m" x="{}" y="50.0"/></g></svg>"""


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
