"""Readers of raw logs: every layout gives the same numbers, and bad input one clear line."""

import gzip
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from log_helpers import FORCES, TABLE, TIME, N, changed, lines, open_log
from scipy.io import savemat

import accelstudy as acs


def written(folder, text, name="log.csv"):
    path = folder / name
    path.write_text(text)
    return path


BY_PLACE = {"columns": {"fx": 1, "fy": "2", "fz": 3}, "time": 0}


HEADS = {
    "": ((), BY_PLACE),
    "names": (("time", "fx", "fy", "fz"), {}),
    "units": (("Time_s", "Acc X [m/s²]", "Acc Y [m/s²]", "Acc Z [m/s²]"), {}),
    "comment": (("# time", "ax", "ay", "az"), {}),
}
"""Names of columns in the first row, and what a reader needs besides."""
CALIBRATED = [f"f{axis}_calibrated_mps2" for axis in "xyz"]


@st.composite
def layouts(draw):
    """Content of a log that has TABLE, its suffix, and what a reader needs to know."""

    def one(*values):
        return draw(st.sampled_from(values))

    delimiter = one(",", ";", "\t", "|", "   ", " , ")
    names, options = HEADS[one("", "names", "comment", *(["units"] if delimiter.strip() else []))]
    decimal = one(".", "." if "," in delimiter else ",")
    mark = one("", '"' if delimiter in ",;\t" else "")
    behind = one("", delimiter, f"{delimiter}x_a") if delimiter.strip() == "," else ""
    rows = [[f"{value:.3f}".replace(".", decimal) for value in row] for row in TABLE]
    lines = [delimiter.join(f"{mark}{cell}{mark}" for cell in row) + behind for row in rows]
    if names:
        lines.insert(0, delimiter.join(names) + behind.replace("x_a", "note"))
    for place in draw(st.lists(st.integers(0, N), max_size=3)):
        lines.insert(place, one("# why not", "% a comment", "// 2 axes, 3 g", ""))
    end = one("\n", "\r\n", "\n\n")
    text = end.join(lines) + one("", end)
    content = text.encode(one("utf-8", "utf-8-sig", "utf-16", "utf-16-be"))
    return (gzip.compress(content), ".csv.gz", options) if one(0, 1) else (content, ".csv", options)


@pytest.fixture(scope="module")
def calibration():
    """A calibration, and the forces that it makes of FORCES."""
    made = acs.calibrate(acs.simulate_campaign(scheme="fibonacci-24"))
    return made, made.apply(pd.DataFrame(FORCES, columns=["fx", "fy", "fz"]))[CALIBRATED]


@settings(max_examples=60)
@given(layouts())
def test_text_in_any_layout_gives_the_same_numbers(calibration, layout):
    content, suffix, options = layout
    made, expected = calibration
    with TemporaryDirectory() as folder:
        path = Path(folder, f"log{suffix}")
        path.write_bytes(content)
        log = open_log(path, **options)
        np.testing.assert_array_equal(log.time, TIME)
        np.testing.assert_array_equal(log.forces, FORCES)
        leveled = made.apply(acs.read_log(path, **options))
    pd.testing.assert_frame_equal(leveled[CALIBRATED], expected)


@pytest.mark.parametrize(("name", "variable"), [("log", None), ("log.T", None), ("other", "log")])
def test_matlab(tmp_path, name, variable):
    arrays = {"log": TABLE.T if name == "log.T" else TABLE, "name": "x", "t": TABLE[:, :1]}
    arrays |= {"other": 1j * FORCES, "none": []} if variable else {}
    savemat(tmp_path / "log.mat", arrays, format="5" if variable else "4")
    log = open_log(tmp_path / "log.mat", variable=variable, **BY_PLACE)
    np.testing.assert_array_equal(log.time, TIME)
    np.testing.assert_array_equal(log.forces, FORCES)


def test_parquet(tmp_path):
    frame = pd.DataFrame(TABLE, columns=["time", "accX", "accY", "accZ"]).assign(label="a")
    frame.to_parquet(tmp_path / "log.parquet")
    columns = {"fx": "accX", "fy": "accY", "fz": "accZ"}
    log = open_log(tmp_path / "log.parquet", columns=columns)
    np.testing.assert_array_equal(log.time, TIME)
    np.testing.assert_array_equal(log.forces, FORCES)
    assert log.step == 0.25
    frame.assign(accY=frame.accY.mask(frame.index == 20)).to_parquet(tmp_path / "log.parquet")
    log = open_log(tmp_path / "log.parquet", columns=columns)
    assert len(log.time) == N - 1
    assert "row 21, column accY (fy): nan" in log.warnings()[0]


def test_three_columns_need_no_names(tmp_path):
    np.savetxt(tmp_path / "log.txt", FORCES, "%.3f")
    np.testing.assert_array_equal(open_log(tmp_path / "log.txt", rate=1).forces, FORCES)


@pytest.mark.parametrize(("text", "row", "says"), [
    (changed(20, 2, "nan"), 20, "line 21, column 2 (fy): 'nan'"),
    (changed(20, 1, "1.2.3"), 20, "line 21, column 1 (fx): '1.2.3'"),
    (changed(20, 1, ""), 20, "line 21, column 1 (fx): nothing"),
    (changed(0, 0, ""), 0, "line 1, column 0 (time): nothing"),
    (changed(20, 1, "2147483647"), 20, "line 21, column 1 (fx): '2147483647'"),
    (changed(20, 3, "1,5,6"), 20, "line 21, column 1 (fx): 6 columns instead of 4"),
    (lines()[:-12], 49, "line 50, column 3 (fz): the line ends before it"),
    (changed(20, 2, "x").replace("\n", "\n\n"), 20, "line 41, column 2 (fy): 'x'"),
])  # fmt: skip
def test_a_row_that_lacks_a_reading_is_left_out_and_said(tmp_path, text, row, says):
    log = open_log(written(tmp_path, text), **BY_PLACE)
    np.testing.assert_array_equal(log.forces, np.delete(FORCES, row, axis=0))
    kept = np.delete(TIME, row)
    np.testing.assert_array_equal(log.time, kept - kept[0])
    (warning,) = log.warnings()
    assert warning == f"1 of 50 rows left out, as a reading is missing or absurd: {says}"


@pytest.mark.parametrize("note", ['a "start', 'so-called "x" and "y', '5",1,"'])
def test_a_quotation_mark_that_does_not_close_swallows_no_rows(tmp_path, note):
    """The rows up to the next mark were one cell of the unused column."""
    rows = lines(before=["t,fx,fy,fz,note"]).replace("\n", ",\n").splitlines()
    rows[0], rows[9], rows[20] = rows[0][:-1], rows[9] + f'"{note}', rows[20] + '"as it should"'
    log = open_log(written(tmp_path, "\n".join(rows)))
    whole = np.ones(N, dtype=bool)
    whole[8] = "," not in note  # which column is it then?
    np.testing.assert_array_equal(log.time, TIME[whole])
    np.testing.assert_array_equal(log.forces, FORCES[whole])
    assert len(log.warnings()) == (not whole.all())
