"""What CONTRIBUTING.md says to add works as it stands there: each file, loaded as a plug-in."""

import re
import subprocess
import sys

import pandas as pd
import pytest
import yaml
from calling import succeed
from places import ROOT
from plugin_helpers import forgotten

from accelstudy.basics import plugins
from accelstudy.study.claims.verdicts import ClaimData, judge_claim
from accelstudy.study.config import read_study
from accelstudy.study.figures import caption, draw, figure_names, get_figure

PAGE = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
EXAMPLES = dict(re.findall(r"`(accelstudy/[\w/]+\.py)`:\n\n```python\n(.*?)```", PAGE, re.DOTALL))
(CLAIM,) = re.findall(r"```yaml\n- (claim: .*?)```", PAGE, re.DOTALL)
STUDY = read_study(ROOT / "config/config.yaml")


@pytest.fixture(scope="module", autouse=True)
def added(tmp_path_factory):
    """Folder with all examples of the page, which are loaded until the end."""
    folder = tmp_path_factory.mktemp("added")
    for path, text in EXAMPLES.items():
        (folder / path).parent.mkdir(parents=True)
        (folder / path).write_text(text, encoding="utf-8")
    with pytest.MonkeyPatch.context() as patch, forgotten():
        patch.chdir(folder)
        plugins.load_files(EXAMPLES)
        yield folder


@pytest.mark.parametrize(("kind", "name", "room"), [
    ("effect", "dead_zone", "effects"),
    ("noise effect", "shared_noise", "noise_effects"),
    ("scheme", "cones-N", "schemes"),
    ("approach", "turntable", "approaches"),
    ("figure", "tilt-over-condition", "study/figures"),
])  # fmt: skip
def test_each_checklist_has_one_new_file(kind, name, room):
    path, _ = plugins.source_of(kind, name)
    assert path.rpartition("/")[0] == f"accelstudy/{room}"
    assert not (ROOT / path).exists()
    for words in (["check"], ["format", "--check"]):
        ruff = [sys.executable, "-m", "ruff", *words, "--no-cache", "--stdin-filename", ROOT / path]
        subprocess.run([*ruff, "-"], input=EXAMPLES[path], text=True, check=True)


def test_effects_are_in_the_catalogue_and_in_models():
    catalogue = succeed("effects").stdout
    assert "dead_zone: −k_i f_i exp(−(f_i/w)²)\n" in catalogue
    assert "settings: width=1 m/s² (above 0)" in catalogue
    assert "shared_noise: √(1 − ρ) v + √ρ σ w" in catalogue
    effects = ("--effect", "dead_zone(width=2): 0.02, 0.01, -0.01")
    effects += ("--noise-effect", "shared_noise")
    succeed("simulate-campaign", "--out", "mine", "--scheme", "fibonacci-60", *effects)
    words = ("--model", "bias-scale+dead_zone(width=2)", "--approach", "turntable")
    said = succeed("check-sigmas", "mine", *words, "--replicates", "10").stdout
    assert re.search(r"^ *k_dead_x +ppm +\d", said, re.MULTILINE)


def test_a_scheme_and_an_approach_say_what_they_determine():
    said = succeed("schemes", "cones-18", "cones-40", "--approach", "turntable").stdout
    rows = {line.split()[0]: line.split() for line in said.splitlines() if line.strip()}
    for n in (18, 40):
        assert rows[f"cones-{n}"][1:4] == [str(n), "generated", "9/9"]
        assert int(rows[f"cones-{n}"][5]) == 2 * n - 9


def test_a_figure_belongs_to_the_study_and_draws_its_tables():
    name = "tilt-over-condition"
    assert name in figure_names(STUDY)
    assert caption(name, STUDY).startswith("The tilt error (roll, rms)")
    assert get_figure(name).tables == ("cells", "leveling")
    cells = pd.DataFrame({"cell": ["a", "b"], "approach": "gravity", "condition": [2.0, 3.0]})
    leveling = pd.DataFrame({"cell": ["a"], "roll_rms_mgon": [10.0]})
    (ax,) = draw(name, {"cells": cells, "leveling": leveling}, STUDY).axes
    assert [line.get_xydata().tolist() for line in ax.get_lines()] == [[[2.0, 10.0]]]


def test_a_claim_is_judged():
    pairs = [("b_x", "s_x", -0.01), ("b_x", "b_y", 0.5), ("s_x", "s_y", 0.25)]
    correlations = pd.DataFrame(pairs, columns=["parameter_1", "parameter_2", "adjustment"])
    cell = STUDY.sensitivity.cell("gravity")
    data = ClaimData(STUDY, {"correlations": correlations.assign(cell=cell)})
    claim = judge_claim(yaml.safe_load(CLAIM.replace("\n  ", "\n")), data)
    assert (claim["claim"], claim["ours"]) == ("bias-and-scale", 0.01)
    assert claim["verdict"] == "reproduced"
