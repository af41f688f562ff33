"""The section `pole` of the workflow's configuration."""

import json

import pytest
from places import ROOT

from accelstudy.basics.errors import InputError
from accelstudy.basics.units import MGON
from accelstudy.files.reading import read_layer
from accelstudy.files.tables import read_origin
from accelstudy.plan.batch.example import parse_example, parse_section
from accelstudy.pole import output
from accelstudy.pole.config import PoleConfig


def cases(content):
    example = parse_example({"study": "x", "pole": {"cases": {"mine": content}}}, "file")
    return parse_section(example, "pole", PoleConfig, "file").cases


def test_the_example_is_worked_out(tmp_path, monkeypatch):
    monkeypatch.setattr(output, "save", lambda *_: "")
    example = parse_example(read_layer(ROOT / "config/plan-example.yaml"))
    case = parse_section(example, "pole", PoleConfig).cases["total-station"]
    case = case.model_copy(update={"replicates": 10})
    case.write(3, tmp_path, {"config_hash": "abc", "seed": 3})
    assert read_origin(tmp_path / "budget.parquet")["config_hash"] == "abc"
    content = json.loads((tmp_path / "pole.json").read_text(encoding="utf-8"))
    assert content["setup_si"]["length"] == 1.5
    assert content["seed"] == 3
    assert case.files == []


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ({"sensr": "paper"}, "file: pole.cases.mine.sensr: unknown key"),
        ({"sensor": "papr"}, "file: pole.cases.mine: sensor: unknown sensor 'papr'; did you mean"),
        ({"setup": {"length": "2"}}, "mine: setup: length: expected a number with its unit"),
        ({"setup": {"long": "2m"}}, "mine: setup: unknown quantity of a pole 'long'"),
        ({"hold": "2m"}, "mine: hold: '2m': the unit must be one of"),
        ({"calibration": "c.json", "hold": "2s"}, "calibration and hold exclude each other"),
        ({"tilt_sigma": "10"}, "mine: tilt_sigma: expected a number with its unit"),
    ],
)
def test_what_cannot_be_used_is_said_in_a_line(content, message):
    with pytest.raises(InputError) as error:
        cases(content)
    assert message in str(error.value)
    assert "\n" not in str(error.value)


def test_sigmas_of_roll_and_pitch_alone_will_do():
    sensor = cases({"tilt_sigma": "10mgon"})["mine"].calibrated_sensor()
    assert sensor.tilt_sigma == pytest.approx(10 * MGON)


def test_files_of_ones_own_are_inputs():
    assert cases({"calibration": "c.json"})["mine"].files == ["c.json"]
