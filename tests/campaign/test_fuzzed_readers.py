"""Whatever stands in a file that a command reads: one line and exit status 2, never a traceback.

`test_campaign_format.py` does the same for campaigns and `test_import_logs.py` for logs that
`import` reads.
"""

import json
import re
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pandas as pd
import pytest
import yaml
from calling import call, succeed
from campaign_helpers import GRAVITY, NINE, simulated_campaign
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.io import savemat
from test_campaign_apply import TRUTH
from test_campaign_format import damages, edits

from accelstudy.basics.errors import InputError
from accelstudy.campaign.calibration.applying import read_calibration
from accelstudy.campaign.calibration.document import calibration_document
from accelstudy.campaign.calibration.fit import fit_campaign
from accelstudy.campaign.format import read_campaign, write_campaign

LOG = pd.DataFrame(np.random.default_rng(1).normal(0, 5, (30, 3)), columns=["fx", "fy", "fz"])
SETTINGS = {
    "name": "log",
    "columns": {"fx": 0, "fy": "fy", "fz": 2},
    "rate_hz": 10.0,
    "unit": "counts",
    "scale": [0.1, 0.2, 0.3],
    "offset": 1.0,
    "gravity": {"value_mps2": 9.81, "sigma_mps2": 0.0},
    "frame": "flu",
    "range_mps2": 1000.0,
    "exclude": [],
    "join": [],
    "window_s": 1.0,
    "threshold_mps2": 10.0,
    "trim_s": 0.0,
    "shortest_s": 1.0,
}


@pytest.fixture(scope="module")
def calibration():
    """Content of a calibration.json."""
    return calibration_document(fit_campaign(simulated_campaign(TRUTH), NINE, GRAVITY))


def one_line_at_most(folder, *arguments):
    """Run a command; it works, or says in one line what is wrong and writes nothing."""
    before = {path.name for path in Path(folder).iterdir()}
    result = call(*arguments)
    assert result.exit_code in (0, 2), repr(result.exception)
    assert result.exception is None or isinstance(result.exception, SystemExit)
    if result.exit_code:
        assert result.stderr.startswith("error: ")
        assert result.stderr.count("\n") == 1
        assert {path.name for path in Path(folder).iterdir()} == before
    return result


anything = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5) | st.sampled_from(
        ["counts", "g", "bias", "scale", "\ud800", 10**400, 1e308, 1e200, -1, 0, 3, "*/", "\n"],
    ),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=3), inner),
    max_leaves=4,
)  # fmt: skip


def replaced(content, path, value, remove):
    """Content with what stands at a path, an index at each level, replaced or removed."""
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


paths = st.lists(st.floats(0, 1, exclude_max=True), min_size=1, max_size=4)
changes = st.lists(st.tuples(paths, anything, st.booleans()), min_size=1, max_size=3)


def use(content, folder, form, other=None):
    """Apply a calibration and export it; compare it with another one."""
    (folder / "calibration.json").write_bytes(content)
    if other is not None:
        (folder / "other.json").write_text(json.dumps(other), encoding="utf-8")
        files = folder / "other.json", folder / "calibration.json"
        one_line_at_most(folder, "compare", *files, "--out", folder / "compared")
    LOG.to_csv(folder / "log.csv", index=False)
    file, log = folder / "calibration.json", folder / "log.csv"
    one_line_at_most(folder, "apply", file, log, "--out", folder / "out.csv")
    one_line_at_most(folder, "export", file, "--form", form)


def of(what, value):
    """Change of one key of a calibration; of the covariance by a factor."""

    def change(content):
        if what == "covariance":
            return {what: (value * np.array(content[what], dtype=float)).tolist()}
        if what == "value":
            first, *others = content["parameters"]
            return {"parameters": [{**first, what: value}, *others]}
        return {what: value}

    return change


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (of("redundancy", 0), "redundancy: must be 1 or more"),
        (of("redundancy", -3), "redundancy: must be from 0"),
        (of("redundancy", 10**400), "redundancy: must be from 0 to 1000000000, not a huge number"),
        (of("covariance", -1), "covariance: expected variances above 0"),
        (of("covariance", 0), "covariance: expected variances above 0"),
        (of("covariance", 1e250), "covariance.0.0: must be from"),
        (of("covariance", np.tri(9)), "covariance: must be symmetric"),
        (of("covariance", 1 - 2 * np.eye(9)[::-1]), "covariance: "),
        (of("value", 1e200), "parameters.0.value: must be from"),
        (of("gravity_mps2", 1e200), "gravity_mps2: must be from 0.001 to 1000 m/s²"),
        (of("ranges", {"fx_mps2": [2, 1]}), "ranges.fx_mps2: must be the smallest and the largest"),
    ],
)
def test_what_no_calibration_can_hold_is_said_when_it_is_read(calibration, change, said):
    content = {**calibration, "sigma_source": "a posteriori", **change(calibration)}
    with TemporaryDirectory() as name:
        file = Path(name) / "calibration.json"
        file.write_text(json.dumps(content), encoding="utf-8")
        with pytest.raises(InputError, match=re.escape(said)):
            read_calibration(file)


INJECTED = "x\n1\t1\tCAL_ACC0_XOFF\t9\t9\x1b[31m\u2028*/"


@pytest.mark.parametrize("form", ["px4", "c", "yaml"])
def test_a_name_is_no_line_of_an_export(calibration, form):
    content = {**calibration, "sensor": INJECTED, "campaign": INJECTED}
    with TemporaryDirectory() as name:
        file = Path(name) / "calibration.json"
        file.write_text(json.dumps(content), encoding="utf-8")
        text = succeed("export", file, "--form", form).stdout
    assert not any(line.startswith("1\t1\tCAL_ACC0_XOFF\t9") for line in text.splitlines())
    assert "\x1b" not in text
    assert "\u2028" not in text


forms = st.sampled_from(["json", "yaml", "c", "matrix", "px4"])


@settings(max_examples=50)
@given(changes=changes, form=forms)
@example(changes=[([0.0], "x", True)], form="json")
def test_calibration_of_another_shape(calibration, changes, form):
    content = calibration
    for path, value, remove in changes:
        content = replaced(content, path, value, remove)
    with TemporaryDirectory() as folder:
        use(json.dumps(content).encode(), Path(folder), form, calibration)


@settings(max_examples=50)
@given(damage=damages(), form=forms)
@example(damage=lambda content: b"[" * 100000, form="json")
def test_damaged_calibration(calibration, damage, form):
    with TemporaryDirectory() as folder:
        use(damage(json.dumps(calibration).encode()), Path(folder), form)


@settings(max_examples=30)
@given(changes=changes, damage=damages() | edits() | st.none())
def test_fuzzed_settings_of_an_import(changes, damage):
    content = SETTINGS
    for path, value, remove in changes:
        content = replaced(content, path, value, remove)
    text = yaml.safe_dump(content if damage is None else SETTINGS).encode()
    with TemporaryDirectory() as name:
        folder = Path(name)
        LOG.to_csv(folder / "log.csv", index=False)
        (folder / "settings.yaml").write_bytes(text if damage is None else damage(text))
        one_line_at_most(
            folder,
            *("import", folder / "log.csv", "--out", folder / "out", "--no-figure"),
            *("--settings", folder / "settings.yaml"),
        )


def written(folder, name):
    path = folder / name
    if path.suffix == ".mat":
        savemat(path, {"log": LOG.to_numpy()}, do_compression=name.startswith("packed"))
    elif path.suffix == ".parquet":
        LOG.to_parquet(path)
    else:
        LOG.to_csv(path, index=False, sep="\t" if path.suffix == ".txt" else ",")
    return path


@pytest.mark.parametrize("name", ["log.csv", "log.txt", "log.mat", "packed.mat", "log.parquet"])
@settings(max_examples=20)
@given(
    damage=damages() | edits(), means=st.booleans(), wanted=st.sampled_from(["a.csv", "a.parquet"])
)
def test_damaged_log(calibration, name, damage, means, wanted):
    with TemporaryDirectory() as temporary:
        folder = Path(temporary)
        (folder / "calibration.json").write_text(json.dumps(calibration), encoding="utf-8")
        path = written(folder, name)
        content = path.read_bytes()
        try:
            path.write_bytes(damage(content))
        except UnicodeDecodeError:  # words of a binary file
            return
        one_line_at_most(
            folder,
            *("import", path, "--out", folder / "out", "--no-figure"),
            *("--columns", "fx=0,fy=1,fz=2"),
            *(["--means"] if means else ["--rate", 10, "--threshold", 10]),
        )
        one_line_at_most(
            folder, *("apply", folder / "calibration.json", path, "--out", folder / wanted)
        )


HOSTILE = [
    *("0", "-1", "1", "nan", "inf", "1e300", "-1e300", "1e-300", "1e10", "1e-12", "9" * 400, "x"),
    *("", "\x1b[31m", "../x", "{x}", "'", "x" * 300, "20:40", "1e300:1", "nan:0", "fibonacci-9"),
    *("warm_up(tau=1e300)", "bias: 1e300, 0, 0", "heavy_tails(nu=2.000001)", "unit_error"),
]
OPTIONS = [
    *("--name", "--seed", "--scheme", "--repeats", "--repeat-first", "--order", "--approach"),
    *("--model", "--effect", "--size", "--noise-effect", "--gross-error", "--sigma", "--interval"),
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


KEYS = [
    *(("gravity", "value_mps2"), ("gravity", "sigma_mps2"), ("sensor_noise", "sigma_mps2")),
    *(("robot", "angle_sigma_mgon"), "fx", "fz", "roll_robot_gon", "pitch_robot_gon"),
]
NUMBERS = [0, 1e-300, 1e-12, 1e-9, 1, -1, 100, 400, 500, 1e3, 1e10, 1e12, 1e160, 1e300]


@settings(max_examples=20)
@given(
    st.lists(st.tuples(st.sampled_from(KEYS), st.sampled_from(NUMBERS)), min_size=1, max_size=2),
    st.sampled_from(["gravity", "robot"]),
    st.sampled_from(["bias-scale-nonorthogonality", "bias-scale-nonorthogonality-cubic"]),
)
@example([("pitch_robot_gon", 500)], "robot", "bias-scale-nonorthogonality-cubic")
@example([("fx", 1e300)], "gravity", "bias-scale-nonorthogonality")
@example(
    [(KEYS[2], 1000), (KEYS[1], 1)], "robot", "bias-scale-nonorthogonality"
)  # a sensor that knows nothing, and a gravity that knows little more
def test_hostile_numbers(changes, approach, model):
    with TemporaryDirectory() as name:
        folder = Path(name) / "campaign"
        write_campaign(simulated_campaign(TRUTH), folder)
        header = yaml.safe_load((folder / "campaign.yaml").read_text(encoding="utf-8"))
        table = pd.read_csv(folder / "positions.csv")
        for key, value in changes:
            if isinstance(key, tuple):
                header.setdefault(key[0], {})[key[1]] = value
            else:
                table.loc[3, key] = float(value)
        (folder / "campaign.yaml").write_text(yaml.safe_dump(header), encoding="utf-8")
        table.to_csv(folder / "positions.csv", index=False)
        one_line_at_most(
            name, "check-sigmas", folder, "--model", model, "--approach", approach,
            "--replicates", 5,
        )  # fmt: skip
