"""What CONTRIBUTING.md says to add works as it stands there: one file each, in a copy."""

import json
import os
import re
import shutil
import subprocess
import sys

import pytest
from places import ROOT

PAGE = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
EXAMPLES = dict(re.findall(r"`(accelstudy/[\w/]+\.py)`:\n\n```python\n(.*?)```", PAGE, re.DOTALL))

(CLAIM,) = re.findall(r"```yaml\n(- claim: .*?)```", PAGE, re.DOTALL)

LOOK = r"""
import json
import sys

from accelstudy.study.config import read_study
from accelstudy.study.figures import caption, draw, figure_names, get_figure

study = read_study("config/config.yaml")
found = {"figures": figure_names(study)}
found["loaded"] = [name for name in ("matplotlib", "pandas") if name in sys.modules]

import pandas as pd
from click.testing import CliRunner

from accelstudy.commands.main import main
from accelstudy.study.claims.verdicts import claim_table, judge_claim
from accelstudy.study.claims.quantities import Evidence

found["captions"] = {name: caption(name, study) for name in found["figures"]}
found["tables"] = get_figure("tilt-over-condition").tables
cells = pd.DataFrame({"cell": ["a", "b"], "approach": "gravity", "condition": [2.0, 3.0]})
leveling = pd.DataFrame({"cell": ["a"], "roll_rms_mgon": [10.0]})
(ax,) = draw("tilt-over-condition", {"cells": cells, "leveling": leveling}, study).axes
found["points"] = [line.get_xydata().tolist() for line in ax.get_lines()]

pairs = [("b_x", "s_x", -0.01), ("b_x", "b_y", 0.5), ("s_x", "s_y", 0.25)]
correlations = pd.DataFrame(pairs, columns=["parameter_1", "parameter_2", "adjustment"])
settings = study.sensitivity
cell = settings.cell("gravity")
tables = {"correlations": correlations.assign(cell=cell)}
evidence = Evidence(study, tables)
found["claims"] = [judge_claim(claim_table()["paper"][-1], evidence)]

found["said"] = []
for line in sys.stdin.read().splitlines():
    result = CliRunner().invoke(main, json.loads(line))
    found["said"].append([result.exit_code, result.output])
json.dump(found, open("found.json", "w"))
"""
COMMANDS = {
    "effects": ("effects",),
    "scheme": ("schemes", "cones-18", "cones-40", "--approach", "turntable"),
    "simulate": (
        "simulate-campaign", "--out", "mine", "--scheme", "fibonacci-60",
        "--effect", "dead_zone(width=2): 0.02, 0.01, -0.01", "--noise-effect", "shared_noise",
    ),
    "calibrate": (
        "check-sigmas", "mine", "--model", "bias-scale+dead_zone(width=2)",
        "--approach", "turntable", "--replicates", "10",
    ),
}  # fmt: skip


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    """What a copy of the package with all examples of the page says."""
    clone = tmp_path_factory.mktemp("clone")
    for folder in ("accelstudy", "config", "profiles", "workflow"):
        ignored = shutil.ignore_patterns("__pycache__")
        shutil.copytree(ROOT / folder, clone / folder, ignore=ignored)
    shutil.copy(ROOT / "pyproject.toml", clone)
    for path, text in EXAMPLES.items():
        assert not (clone / path).exists(), path
        (clone / path).write_text(text, encoding="utf-8")
    claims = clone / "accelstudy/study/claims/claims.yaml"
    papers, others = claims.read_text(encoding="utf-8").split("\n# Each is judged")
    claims.write_text(f"{papers}{CLAIM}\n# Each is judged{others}", encoding="utf-8")
    checks = (["check", "--no-cache"], ["format", "--check", "--no-cache"])
    for words in checks:
        subprocess.run([sys.executable, "-m", "ruff", *words, *EXAMPLES], cwd=clone, check=True)
    looked = subprocess.run(
        [sys.executable, "-c", LOOK], cwd=clone, text=True, capture_output=True,
        input="\n".join(json.dumps(words) for words in COMMANDS.values()),
        env={**os.environ, "PYTHONPATH": str(clone), "PYTHONDONTWRITEBYTECODE": "1"},
    )  # fmt: skip
    assert looked.returncode == 0, looked.stderr
    said = json.loads((clone / "found.json").read_text(encoding="utf-8"))
    for name, (status, output) in zip(COMMANDS, said.pop("said"), strict=True):
        assert status == 0, f"{name}: {output}"
        said[name] = output
    return said


def test_each_checklist_has_one_file():
    rooms = [path.split("/")[1:-1] for path in EXAMPLES]
    assert rooms == [
        ["effects"], ["noise_effects"], ["schemes"], ["approaches"],
        ["study", "figures"],
    ]  # fmt: skip


def test_an_effect_is_in_the_catalogue_and_in_models(found):
    catalogue = found["effects"]
    assert "dead_zone: −k_i f_i exp(−(f_i/w)²)\n" in catalogue
    assert "settings: width=1 m/s^2" in catalogue
    assert re.search(r"^ *k_dead_x +ppm +\d", found["calibrate"], re.MULTILINE)


def test_a_noise_effect_is_in_the_catalogue(found):
    assert "shared_noise: √(1 − ρ) v + √ρ σ w" in found["effects"]


def test_a_scheme_and_an_approach_say_what_they_determine(found):
    rows = {line.split()[0]: line.split() for line in found["scheme"].splitlines() if line.strip()}
    for n in (18, 40):
        assert rows[f"cones-{n}"][1:4] == [str(n), "generated", "9/9"]
        assert int(rows[f"cones-{n}"][5]) == 2 * n - 9


def test_a_figure_belongs_to_the_study_and_draws_its_tables(found):
    assert found["loaded"] == []
    assert "tilt-over-condition" in found["figures"]
    assert found["captions"]["tilt-over-condition"].startswith("The tilt error (roll, rms)")
    assert found["tables"] == ["cells", "leveling"]
    assert found["points"] == [[[2.0, 10.0]]]


def test_a_claim_is_judged(found):
    (claim,) = found["claims"]
    assert (claim["claim"], claim["ours"]) == ("bias-and-scale", 0.01)
    assert claim["verdict"] == "reproduced"
