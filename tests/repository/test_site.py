"""What the documentation says of files is what studies, calibrations and batches write.

`make docs` checks links and anchors, test_pages.py the names that pages use.
"""

import inspect
import json
import re
from importlib import import_module
from types import SimpleNamespace
from unittest.mock import ANY

import griffe
import pandas as pd
from jsonschema import Draft202012Validator
from places import ROOT
from study_helpers import grid, make_study, run_study

import accelstudy
from accelstudy.campaign.batch import COLUMNS, PARAMETERS
from accelstudy.campaign.calibration.file_format import CalibrationDocument
from accelstudy.epochs.file_format import HistoryDocument
from accelstudy.files.documents import json_text
from accelstudy.lots.calibration import LotCalibration
from accelstudy.lots.evidence import SensorEvidence
from accelstudy.lots.file_format import LotDocument
from accelstudy.lots.lot import LotDiagnosis
from accelstudy.lots.output import Lot
from accelstudy.lots.passes import Pass
from accelstudy.planning.plan import PlanDocument
from accelstudy.sensors.models import get_model
from accelstudy.sequential.advice import AdviceDocument
from accelstudy.study.result import SimulationDocument
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


def strict(schema):
    """Let a schema take all keys that it describes, and no others."""
    if isinstance(schema, list):
        return [strict(each) for each in schema]
    if not isinstance(schema, dict):
        return schema
    content = {key: strict(value) for key, value in schema.items()}
    if "properties" in schema and "type" in schema:
        content |= {"required": [*schema["properties"]]}
        content |= {"additionalProperties": False}
    return content


def test_each_key_and_column_of_a_calibration_is_described(tmp_path):
    campaigns = [accelstudy.simulate_campaign(seed=n, scheme="fibonacci-12") for n in range(3)]
    each = [accelstudy.calibrate(c, model="bias-scale", approach="robot") for c in campaigns]
    dates = [f"2025-0{month}-01" for month in (1, 2, 3)]
    one, three = each[0], accelstudy.history(each, dates=dates)
    one.save(tmp_path / "one")
    three.save(tmp_path / "three")
    lot = {**_lot(), "files": []}
    two = accelstudy.compare(*each[:2]).content
    advice = accelstudy.advise(campaigns[0], tilt_accuracy="1gon", model="bias-scale")
    simulation = accelstudy.simulate("bias", ["faces-6", "mclaren-24"], "robot", sigma=1e-3)
    asked = {"sigma": 2e-3, "equipment": "gravity", "max_positions": 24, "replicates": 50}
    plan = accelstudy.plan(tilt_accuracy="50mgon", **asked)
    for document, content in (
        (CalibrationDocument, one.content), (HistoryDocument, two),
        (HistoryDocument, three.content), (LotDocument, lot), (AdviceDocument, advice.content),
        (SimulationDocument, simulation.content), (PlanDocument, plan.content),
    ):  # fmt: skip
        content = json.loads(json_text(content))
        schema = Draft202012Validator(strict(document.model_json_schema()))
        assert [error.message for error in schema.iter_errors(content)] == []
        assert document.check(content).model_dump(exclude_unset=True, by_alias=True) == content
    assert described("file-formats") == {
        "positions.parquet": list(pd.read_parquet(tmp_path / "one/positions.parquet")),
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


def _lot():
    """Content of lot.json, of sensors that lack the same."""
    name = "thermal_bias"
    each = [SensorEvidence(c, 1e-9, {name: 20.0}, classes=((name,),)) for c in "abc"]
    sensors = (SimpleNamespace(noise=None),) * len(each)
    one, model = Pass(sensors, tuple(each)), get_model("bias-scale")
    assert one.found is not None
    lot = LotDiagnosis((one, one), model, (one.found,))
    return Lot(LotCalibration(lot, {}, {}), {}).content


def test_the_reference_says_what_the_kinds_of_keywords_mean():
    path = ROOT / "accelstudy/verbs/calibrations.py"
    module = griffe.visit("accelstudy.verbs.calibrations", path, path.read_text(encoding="utf-8"))
    import_module("meanings").Meanings().on_object(obj=module["diagnose"])
    said = module["diagnose"].docstring.value
    assert "\nmodel : str\n    A model: one that `accelstudy catalogue models` lists" in said
    assert said == inspect.getdoc(accelstudy.diagnose)
