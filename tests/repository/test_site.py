"""What the documentation says of files is what studies, calibrations and batches write.

`make docs` checks links and anchors, test_pages.py the names that pages use.
"""

import inspect
import re
from importlib import import_module
from unittest.mock import ANY

import griffe
import pandas as pd
from places import ROOT
from study_helpers import grid, make_study, run_study

import accelstudy
from accelstudy.campaign.batch import COLUMNS, PARAMETERS
from accelstudy.study.sensitivity import sensitivity_table, shapley_table

SENSITIVITY = {"base_samples": 2, "roll_gon": 10, "pitch_gon": 0}


def described(page):
    """Keys or columns of each file of which a page of the reference has a table, in order."""
    files = {}
    text = (ROOT / f"docs/reference/{page}.md").read_text(encoding="utf-8")
    for section in re.split(r"^## ", text, flags=re.MULTILINE)[1:]:
        cells = re.findall(r"^\| (`.+?`) \|", section, re.MULTILINE)
        if not (names := re.findall("`([^`]+)`", " ".join(cells))):
            continue  # a hook makes this table
        if first := re.search("first columns are those of `(.+)` up to `(.+)`", section):
            shared = files[first[1]]
            names = [*shared[: shared.index(first[2]) + 1], *names]
        files[re.search("`([^`]+)`", section)[1]] = names
    return files


def test_each_column_of_a_study_is_described(tmp_path):
    said = described("tables")
    keys = {"grids": [grid(replicates=20)], "sensitivity": SENSITIVITY}
    written = run_study(tmp_path, **keys)
    study, summary = make_study(**keys), written["summary"]
    written["sensitivity"] = sensitivity_table(study, summary)
    written["shapley"] = shapley_table(study, summary, written["correlations"])
    for name, table in written.items():
        file = "estimates/*.parquet" if name == "estimates" else f"{name}.parquet"
        assert said[file] == list(table), name


def test_each_column_of_a_calibration_is_described(tmp_path):
    campaign = accelstudy.simulate_campaign(scheme="fibonacci-12")
    accelstudy.calibrate(campaign, model="bias-scale").save(tmp_path)
    assert described("file-formats") == {
        "positions.parquet": list(pd.read_parquet(tmp_path / "positions.parquet")),
        "calibration.h": ANY,
        "calibration.params": ANY,
        "campaigns.parquet": list(COLUMNS),
        "parameters.parquet": ["campaign", "parameter", *PARAMETERS],
    }


def test_each_name_of_an_exported_calibration_is_described():
    how = {"scheme": "fibonacci-24", "temperature": (10, 40), "vibration": (0, 1)}
    model = "bias-scale+thermal_bias(tau=60)+thermal_curve+vibration_rectification+warm_up"
    calibration = accelstudy.calibrate(accelstudy.simulate_campaign(**how), model=model)
    code = accelstudy.export(calibration, form="c").split("*/", 1)[1]
    (signature,) = re.findall(r"void (accel_calibrate\(.*\))", code)
    words = set(re.findall(r"\w+", signature)) - {"const", "3"}
    names = {word.removesuffix("_60") for word in words}
    lines = [
        line.split("\t")
        for line in accelstudy.export(calibration, form="px4").splitlines()
        if line[0] != "#"
    ]
    first = {re.sub(r"[YZ](?=OFF|SCALE)", "X", re.sub(r"_[12]$", "_0", line[2])) for line in lines}
    said = described("file-formats")
    assert set(said["calibration.h"]) == names
    assert set(said["calibration.params"]) == first


def test_the_reference_says_what_the_kinds_of_keywords_mean():
    path = ROOT / "accelstudy/verbs/calibrations.py"
    module = griffe.visit("accelstudy.verbs.calibrations", path, path.read_text(encoding="utf-8"))
    import_module("meanings").Meanings().on_object(obj=module["diagnose"])
    said = module["diagnose"].docstring.value
    assert "\nmodel : str\n    A model: one that `accelstudy catalogue models` lists" in said
    assert said == inspect.getdoc(accelstudy.diagnose)
