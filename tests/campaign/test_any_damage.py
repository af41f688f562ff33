"""Whatever stands in a file that a command reads: one line and exit status 2, and nothing written.

Never a traceback. Files are damaged as disks, editors and other programs do it: bytes are replaced
or missing, words stand where others should, and a value is of another kind. Options are hostile.
"""

import json
import shutil
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pandas as pd
import pytest
import yaml
from calling import call
from campaign_helpers import simulated_campaign
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.io import savemat
from study_helpers import content as study_content

import accelstudy as acs
from accelstudy.basics.errors import InputError
from accelstudy.campaign.format import read_campaign, write_campaign
from accelstudy.data_sheets import get_data_sheet
from accelstudy.schemes import get_scheme

TRUTH = {"b_x": 0.05, "s_z": 2e-4, "alpha_zx": 7e-4}
AT_REST = np.random.default_rng(1).normal([0.5, -0.3, -9.7], 0.3, (30, 3))
LOG = pd.DataFrame(AT_REST, columns=["fx", "fy", "fz"])
SETTINGS = {
    "name": "log", "columns": {"fx": 0, "fy": "fy", "fz": 2}, "rate": 10.0, "unit": "counts",
    "scale": [1.0, 1.1, 1.0], "offset": 0.1, "gravity": 9.81, "gravity_sigma": 0.0,
    "frame": "flu", "range": 1000.0, "exclude": [], "window": 1.0,
    "threshold": 10.0, "trim": 0.0, "shortest": 1.0,
}  # fmt: skip
CONTENTS = {
    "settings.yaml": SETTINGS, "study.yaml": study_content(),
    "model.yaml": {"models": {"mine": ["bias", "scale", "nonorthogonality"]}},
    "scheme.yaml": {"scheme": "mine", "directions": get_scheme("fibonacci-12").directions.tolist()},
    "box.yaml": {"title": "box", "scale": "3000 ppm", "velocity_random_walk": "1 mm/s^2/sqrt(Hz)"},
}  # fmt: skip
COUNTS = {"scale": [0.01, -0.01, 0.02], "offset": [10.0, 20.0, 0.0]}

# --- damages -------------------------------------------------------------------------------------

PLACE = st.floats(0, 1, exclude_max=True)
WORDS = (
    *("1", "-1", "0", "500", "1e-300", "1e308", ".inf", "nan", "", "true", "null"),
    *("[]", "{}", "&a [*a]", "a: b"),
    *("!!int ''", "!!bool x", "!!map [a]", "!!timestamp x", "2001-99-99", "'", '"', "#", "\t"),
    *("counts", "g", "fx", "position", ",", "\r", "\x85", "\0", "\ud7ff", "?", "<<", "- "),
)
ANYTHING = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5) | st.sampled_from(
        ["counts", "g", "bias", "\ud800", 10**400, 1e308, 1e200, 1e-12, 500, -1, 0, 3, "*/", "\n"],
    ),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=3), inner),
    max_leaves=4,
)  # fmt: skip


@st.composite
def bytes_damaged(draw):
    """Some bytes are replaced, removed or inserted, or the end is missing."""
    step = st.tuples(PLACE, st.integers(0, 8), st.binary(max_size=4))
    steps, end = draw(st.lists(step, min_size=1, max_size=4)), draw(st.just(1.0) | st.floats(0, 1))

    def damage(content):
        for place, removed, new in steps:
            i = int(place * len(content))
            content = content[:i] + new + content[i + removed :]
        return content[: int(end * len(content))]

    return damage


@st.composite
def words_replaced(draw):
    """Words of YAML or CSV are replaced by others that mean something there."""
    changes = draw(st.lists(st.tuples(PLACE, st.sampled_from(WORDS)), min_size=1))

    def damage(content):
        words = content.decode("latin-1").replace(",", " , ").split(" ")
        for place, new in changes:
            words[int(place * len(words))] = new
        return " ".join(words).encode()

    return damage


def replaced(content, path, value, remove):
    """Content with what stands at a path, a place at each level, replaced or removed."""
    if not path or not isinstance(content, dict | list) or not content:
        return value
    keys = list(content) if isinstance(content, dict) else range(len(content))
    key = keys[int(path[0] * len(keys))]
    copy = content.copy()
    if remove and len(path) == 1:
        del copy[key]
    else:
        copy[key] = replaced(content[key], path[1:], value, remove)
    return copy


@st.composite
def values_replaced(draw):
    """Values of YAML or JSON are of another kind, or missing."""
    path = st.lists(PLACE, min_size=1, max_size=4)
    changes = draw(st.lists(st.tuples(path, ANYTHING, st.booleans()), min_size=1, max_size=3))

    def damage(content):
        content = yaml.safe_load(content)
        for path, value, remove in changes:
            content = replaced(content, path, value, remove)
        return json.dumps(content).encode()

    return damage


# --- files ---------------------------------------------------------------------------------------

IMPORT = "import FILE --out OUT --no-figure --columns fx=0,fy=1,fz=2"
OF_LOG = [f"{IMPORT} --rate 10 --threshold 10", f"{IMPORT} --means",
          "apply WHOLE/calibration.json FILE --out OUT.csv"]  # fmt: skip
OF_CAMPAIGN = ["calibrate FOLDER --out OUT",
               "check-sigmas FOLDER --replicates 5 --model bias-scale+cubic_scale"]  # fmt: skip
READ_BY = {
    "campaign/campaign.yaml": OF_CAMPAIGN, "campaign/positions.csv": OF_CAMPAIGN,
    "counts/campaign.yaml": ["effects --campaign FOLDER"],
    "calibration.json": [
        "apply FILE WHOLE/log.csv --out OUT.csv", "compare WHOLE/calibration.json FILE --out OUT",
        *(f"export FILE --form {form}" for form in ("c", "px4")),
    ],
    "settings.yaml": ["import WHOLE/log.csv --out OUT --no-figure --settings FILE"],
    "log.csv": OF_LOG, "log.mat": OF_LOG, "log.parquet": OF_LOG,
    "study.yaml": ["cells FILE"],
    "model.yaml": ["effects --scheme mclaren-24 --model FILE"],
    "scheme.yaml": ["schemes FILE"],
}  # fmt: skip
"""Files, and commands that read them."""


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A folder with all files, undamaged."""
    folder = tmp_path_factory.mktemp("whole")
    robot = acs.simulate_campaign(n_samples=5, temperature=(10, 40), yaw="random")
    write_campaign(robot, folder / "campaign")
    write_campaign(robot.with_header(unit="counts", nominal=COUNTS), folder / "counts")
    document = acs.calibrate(simulated_campaign(TRUTH), approach="gravity").content
    (folder / "calibration.json").write_text(json.dumps(document), encoding="utf-8")
    LOG.to_csv(folder / "log.csv", index=False)
    LOG.to_parquet(folder / "log.parquet")
    savemat(folder / "log.mat", {"log": LOG.to_numpy()}, do_compression=True)
    for name, content in CONTENTS.items():
        (folder / name).write_text(yaml.safe_dump(content))
    for name, commands in READ_BY.items():
        assert not any(read(folder, name, command) for command in commands)
    return folder


def one_line_at_most(folder, words):
    """Run a command; it works, or says in one line what is wrong and writes nothing."""
    before = {path.name for path in folder.iterdir()}
    result = call(*words)
    assert result.exit_code in (0, 2), repr(result.exception)
    assert result.exception is None or isinstance(result.exception, SystemExit)
    if result.exit_code:
        assert result.stderr.startswith("error: ")
        assert result.stderr.count("\n") == 1
        assert {path.name for path in folder.iterdir()} == before
    return result.exit_code


def read(whole, name, command, damage=None):
    """Exit status of a command that reads a damaged file."""
    with TemporaryDirectory() as place:
        here = Path(place)
        path = here / name
        if path.parent != here:
            shutil.copytree(whole / path.parent.name, path.parent)
        content = (whole / name).read_bytes()
        path.write_bytes(damage(content) if damage else content)
        for word, stands_for in (("FILE", path), ("FOLDER", path.parent), ("WHOLE", whole),
                                 ("OUT", here / "out")):  # fmt: skip
            command = command.replace(word, str(stands_for))
        status = one_line_at_most(here, command.split())
        if path.parent != here and not status:  # what was taken for a campaign is one
            write_campaign(read_campaign(path.parent), here / "again")
            read_campaign(here / "again")
        return status


@pytest.mark.parametrize("name", READ_BY)
@settings(max_examples=25)
@given(data=st.data(), which=st.integers(0, 59))
def test_any_damage_of_a_file_is_one_line(whole, name, data, which):
    kinds = [bytes_damaged(), words_replaced()]
    if name.endswith((".yaml", ".json")):
        kinds += [values_replaced()]
    read(whole, name, READ_BY[name][which % len(READ_BY[name])], data.draw(st.one_of(kinds)))


@settings(max_examples=25)
@given(st.one_of(bytes_damaged(), words_replaced(), values_replaced()))
def test_any_damage_of_a_data_sheet_is_one_line(whole, damage):
    with TemporaryDirectory() as folder:
        path = Path(folder, "box.yaml")
        path.write_bytes(damage((whole / "box.yaml").read_bytes()))
        said = ""
        try:
            get_data_sheet(path)
        except InputError as error:
            said = str(error)
        assert "\n" not in said


# --- options ------------------------------------------------------------------------------------

HOSTILE = [
    *("0", "-1", "1", "nan", "inf", "1e300", "-1e300", "1e-300", "1e10", "1e-12", "9" * 400, "x"),
    *("", "\x1b[31m", "../x", "{x}", "'", "x" * 300, "20:40", "1e300:1", "nan:0", "fibonacci-9"),
    *("warm_up(tau=1e300)", "bias: 1e300, 0, 0", "heavy_tails(nu=2.000001)"),
]
OPTIONS = [
    *("--name", "--seed", "--scheme", "--repeats", "--repeat-first", "--order", "--approach"),
    *("--model", "--effect", "--size", "--noise-effect", "--sigma", "--interval"),
    *("--robot-sigma", "--temperature", "--vibration", "--yaw", "--n-samples"),
]


@settings(max_examples=30)
@given(st.lists(st.tuples(st.sampled_from(OPTIONS), st.sampled_from(HOSTILE)), max_size=2))
def test_hostile_options(pairs):
    """What can be simulated can be read; click says in its own way what is no number."""
    with TemporaryDirectory() as folder:
        out = Path(folder) / "out"
        options = [word for pair in pairs for word in pair]
        result = call("simulate-campaign", "--out", out, *options)
        assert result.exit_code in (0, 2), repr(result.exception)
        assert result.exception is None or isinstance(result.exception, SystemExit)
        if result.exit_code == 0:
            read_campaign(out, plausible=False)
        else:
            assert "error: " in result.stderr.lower()
            assert len(result.stderr) < 2500
            assert not list(Path(folder).iterdir())
