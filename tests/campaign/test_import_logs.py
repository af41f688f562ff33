"""Readers of raw logs: every layout gives the same numbers, and bad input one clear line."""

import gzip
from contextlib import contextmanager

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from log_helpers import open_log
from scipy.io import loadmat, savemat

from accelstudy.basics.errors import InputError
from accelstudy.basics.units import STANDARD_GRAVITY
from accelstudy.campaign.importing import sources
from accelstudy.campaign.importing.detection import find_holds
from accelstudy.campaign.importing.settings import ImportSettings

N = 50
TIME = 0.25 * np.arange(N)
FORCES = np.round(np.random.default_rng(1).normal(0, 5, (N, 3)), 3)
TABLE = np.column_stack([TIME, FORCES])


def everything(log):
    return log.time, log.forces


def lines(separator=",", decimal=".", before=()):
    rows = [separator.join(f"{value:.3f}".replace(".", decimal) for value in row) for row in TABLE]
    return "\n".join([*before, *rows]) + "\n"


def written(folder, text, name="log.csv"):
    path = folder / name
    path.write_text(text)
    return path


BY_PLACE = {"columns": {"fx": 1, "fy": "2", "fz": 3}, "time": 0}


@pytest.mark.parametrize(("text", "options"), [
    (lines(before=["t,fx,fy,fz"]), {}),
    (lines(before=["Fs,100", "Waiting time,3", '"Time_s","Acc X","Acc Y","Acc Z"']), {}),
    (lines(before=["# made by hand", "# time,ax,ay,az"]), {}),
    (lines(before=["% a comment", "", "%another"]), BY_PLACE),
    (lines("\t", before=["time\tfx\tfy\tfz"]), {}),
    (lines(";", ",", ["time;fx;fy;fz"]), {}),
    (lines("   "), BY_PLACE),
    (lines("   ", ","), BY_PLACE),
    (lines(" , "), BY_PLACE),
    (lines().replace("\n", ",x_a\n"), BY_PLACE),
    (lines().replace("\n", "\r\n"), BY_PLACE),
    (lines().rstrip("\n"), BY_PLACE),
    ("\ufeff" + lines(before=["t,fx,fy,fz"]), {}),
    (lines().replace("\n", "\n\n"), BY_PLACE),
    (lines().replace("\n", "\n# why not\n", 3), BY_PLACE),
])  # fmt: skip
def test_text(tmp_path, text, options):
    path = written(tmp_path, text)
    time, forces = everything(open_log(path, **options))
    np.testing.assert_array_equal(time, TIME)
    np.testing.assert_array_equal(forces, FORCES)


@pytest.mark.parametrize("array", [TABLE, TABLE.T])
def test_matlab(tmp_path, array):
    savemat(tmp_path / "log.mat", {"log": array, "name": "x"})
    time, forces = everything(open_log(tmp_path / "log.mat", **BY_PLACE))
    np.testing.assert_array_equal(time, TIME)
    np.testing.assert_array_equal(forces, FORCES)


def test_matlab_4_and_a_chosen_array(tmp_path):
    savemat(tmp_path / "log.mat", {"log": TABLE, "other": FORCES}, format="4")
    with pytest.raises(InputError, match=r"which array\? There are log, other"):
        open_log(tmp_path / "log.mat", rate_hz=4)
    _, forces = everything(open_log(tmp_path / "log.mat", rate_hz=4, variable="other"))
    np.testing.assert_array_equal(forces, FORCES)
    with pytest.raises(InputError, match="did you mean 'other'"):
        open_log(tmp_path / "log.mat", rate_hz=4, variable="othr")


def test_parquet(tmp_path):
    frame = pd.DataFrame(TABLE, columns=["time", "accX", "accY", "accZ"]).assign(label="a")
    frame.to_parquet(tmp_path / "log.parquet")
    columns = {"fx": "accX", "fy": "accY", "fz": "accZ"}
    log = open_log(tmp_path / "log.parquet", columns=columns)
    time, forces = everything(log)
    np.testing.assert_array_equal(time, TIME)
    np.testing.assert_array_equal(forces, FORCES)
    assert log.step == 0.25


def test_units(tmp_path):
    path = written(tmp_path, lines())
    _, forces = everything(open_log(path, unit="g", **BY_PLACE))
    np.testing.assert_allclose(forces, FORCES * STANDARD_GRAVITY)
    log = open_log(path, unit="counts", scale=(0.1, 0.2, -0.3), offset=7, **BY_PLACE)
    np.testing.assert_allclose(everything(log)[1], (FORCES - 7) * (0.1, 0.2, -0.3))
    time, _ = everything(open_log(path, time_unit="ms", **BY_PLACE))
    np.testing.assert_allclose(time, TIME * 1e-3)
    time, _ = everything(open_log(path, columns=BY_PLACE["columns"], rate_hz=50))
    np.testing.assert_allclose(time, np.arange(N) / 50)


def test_three_columns_need_no_names(tmp_path):
    np.savetxt(tmp_path / "log.txt", FORCES, "%.3f")
    np.testing.assert_array_equal(everything(open_log(tmp_path / "log.txt", rate_hz=1))[1], FORCES)


def changed(row, place, value):
    rows = lines().splitlines()
    cells = rows[row].split(",")
    cells[place] = value
    rows[row] = ",".join(cells)
    return "\n".join(rows) + "\n"


@pytest.mark.parametrize(("text", "message"), [
    ("", "the file is empty"),
    ("\n\n", "no line of numbers"),
    ("so,it,goes\nand,goes,on\n", "no line of numbers"),
    (changed(20, 0, "0.1"), r"line 21, column 0 \(time\): time does not increase \('0.1'\)"),
    (changed(20, 0, "4.75"), "line 21, .*time does not increase"),
    ("\n".join(f"{i},1,2,{i}" for i in range(9)), r"column 1 \(fx\) is constant"),
    ("0,1,2,3\n", r"too few samples \(1\)"),
])  # fmt: skip
def test_bad_text(tmp_path, text, message):
    path = written(tmp_path, text)
    with pytest.raises(InputError, match=message) as caught:
        everything(open_log(path, **BY_PLACE))
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(("text", "row", "says"), [
    (changed(20, 2, "nan"), 20, "line 21, column 2 (fy): 'nan'"),
    (changed(20, 3, "-inf"), 20, "line 21, column 3 (fz): '-inf'"),
    (changed(20, 1, "1.2.3"), 20, "line 21, column 1 (fx): '1.2.3'"),
    (changed(20, 1, ""), 20, "line 21, column 1 (fx): nothing"),
    (changed(20, 0, ""), 20, "line 21, column 0 (time): nothing"),
    (changed(0, 0, ""), 0, "line 1, column 0 (time): nothing"),
    (changed(20, 1, "True"), 20, "line 21, column 1 (fx): 'True'"),
    (changed(20, 1, "1e300"), 20, "line 21, column 1 (fx): '1e300'"),
    (changed(20, 1, "1e8"), 20, "line 21, column 1 (fx): '1e8'"),
    (changed(20, 1, "2147483647"), 20, "line 21, column 1 (fx): '2147483647'"),
    (changed(20, 3, "1,5"), 20, "line 21, column 1 (fx): 5 columns instead of 4"),
    (changed(20, 3, "1,5,6"), 20, "line 21, column 1 (fx): 6 columns instead of 4"),
    (lines()[:-12], 49, "line 50, column 3 (fz): the line ends before it"),
    (changed(20, 2, "x").replace("\n", "\n\n"), 20, "line 41, column 2 (fy): 'x'"),
    ("# one\n\n" + changed(20, 2, "x"), 20, "line 23, column 2 (fy): 'x'"),
])  # fmt: skip
def test_a_row_that_lacks_a_reading_is_left_out_and_said(tmp_path, text, row, says):
    log = open_log(written(tmp_path, text), **BY_PLACE)
    time, forces = everything(log)
    np.testing.assert_array_equal(forces, np.delete(FORCES, row, axis=0))
    kept = np.delete(TIME, row)
    np.testing.assert_array_equal(time, kept - kept[0])
    (warning,) = log.warnings()
    assert warning == f"1 of 50 rows left out, as a reading is missing or absurd: {says}"


def test_many_rows_that_lack_a_reading_are_refused(tmp_path):
    rows = lines(before=["t,fx,fy,fz"]).splitlines()
    for i in (4, 9, 30):
        rows[i] = rows[i].replace(",", ",x", 1)
    with pytest.raises(InputError) as caught:
        everything(open_log(written(tmp_path, "\n".join(rows))))
    assert "line 5, column fx (fx): 'x" in str(caught.value)
    assert "3 of 50 rows lack one, which are too many" in str(caught.value)


@pytest.mark.parametrize(("options", "message"), [
    ({}, r"which column is fx\? The columns are a, b, a, c, counted from 0"),
    ({"columns": {"fx": "q"}}, "fx: no column 'q'; there are a, b, a, c"),
    ({"columns": {"fx": 4}}, "fx: no column 4; there are 4, counted from 0"),
    ({"columns": {"fx": -1}}, "columns.fx: must be at least 0"),
    ({"columns": {"fx": "a"}}, "there are several columns 'a'"),
    ({"columns": {"fx": 1, "fy": 1, "fz": 3}}, "name the same column"),
    ({"columns": {"gx": 1}}, "unknown column 'gx'"),
    ({"columns": {"fx": 1, "fy": 2, "fz": 3}}, "give the column of time"),
    ({**BY_PLACE, "rate_hz": 100}, "not both"),
    ({"columns": BY_PLACE["columns"], "rate_hz": 0}, "rate_hz: must be from"),
    ({**BY_PLACE, "unit": "counts"}, "needs a nominal scale"),
    ({**BY_PLACE, "unit": "counts", "scale": 0}, "must not be 0"),
    ({**BY_PLACE, "unit": "counts", "scale": (1, 2)}, "one number or three"),
    ({**BY_PLACE, "unit": "counts", "scale": 1, "offset": np.inf}, "must be a finite number"),
    ({**BY_PLACE, "scale": 2}, "goes with unit counts"),
    ({**BY_PLACE, "unit": "ft"}, "unit: must be .* not 'ft'"),
    ({**BY_PLACE, "time_unit": "h"}, "time_unit: must be .* not 'h'"),
])  # fmt: skip
def test_bad_options(tmp_path, options, message):
    path = written(tmp_path, lines(before=["a,b,a,c"]))
    with pytest.raises(InputError, match=message):
        open_log(path, **options)


def test_bad_files(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        open_log(tmp_path / "none.csv")
    with pytest.raises(InputError, match="a folder"):
        open_log(tmp_path)
    frame = pd.DataFrame(TABLE, columns=["time", "fx", "fy", "fz"])
    whole = tmp_path / "whole.parquet"
    frame.to_parquet(whole)
    (tmp_path / "cut.parquet").write_bytes(whole.read_bytes()[:-40])
    with pytest.raises(InputError, match="not a whole Parquet file"):
        open_log(tmp_path / "cut.parquet")
    frame.assign(fy=frame.fy.mask(frame.index == 20)).to_parquet(whole)
    log = open_log(whole)
    assert len(everything(log)[0]) == N - 1
    assert "row 21, column fy (fy): nan" in log.warnings()[0]
    frame.assign(fy="a").to_parquet(whole)
    with pytest.raises(InputError, match=r"column fy is .*string, not numbers"):
        everything(open_log(whole))
    frame.rename(columns={"fx": "q\nx"}).to_parquet(whole)
    with pytest.raises(InputError, match=r"which column is fx.*time, q x, fy, fz"):
        open_log(whole)
    pq.write_table(pa.table({"time": pa.array([], pa.float64())}), whole)
    with pytest.raises(InputError, match="which column is fx"):
        open_log(whole)
    savemat(tmp_path / "whole.mat", {"log": TABLE})
    (tmp_path / "cut.mat").write_bytes((tmp_path / "whole.mat").read_bytes()[:300])
    with pytest.raises(InputError, match="not a whole MATLAB file"):
        open_log(tmp_path / "cut.mat")
    (tmp_path / "new.mat").write_bytes(b"\x89HDF\r\n")
    with pytest.raises(InputError, match="save it with -v7"):
        open_log(tmp_path / "new.mat")


def test_only_the_chosen_array_is_read(tmp_path, monkeypatch):
    savemat(tmp_path / "log.mat", {"log": TABLE, "other": 1j * FORCES, "name": "x", "none": []})
    with pytest.raises(InputError, match="which array"):
        open_log(tmp_path / "log.mat", **BY_PLACE)
    with pytest.raises(InputError, match="array other has complex numbers"):
        open_log(tmp_path / "log.mat", variable="other", **BY_PLACE)
    read = []

    def load(path, variable_names):
        read.extend(variable_names)
        return loadmat(path, variable_names=variable_names)

    monkeypatch.setattr("scipy.io.loadmat", load)
    _, forces = everything(open_log(tmp_path / "log.mat", variable="log", **BY_PLACE))
    np.testing.assert_array_equal(forces, FORCES)
    assert read == ["log"]


def test_a_line_without_end_is_not_read(tmp_path):
    path = written(tmp_path, "1.5," * 20000)
    with pytest.raises(InputError, match="no end of a line in 65536 characters"):
        open_log(path, rate_hz=1)


@pytest.mark.parametrize("text", [
    "\n".join(" ".join(["word"] * (i % 200)) for i in range(400)),
    "\n".join(f"{i},{'a,' * (i % 300)}" for i in range(500)), '"1"\n' * 5000,
    ",".join(['"1.5"'] * 5000),
])  # fmt: skip
def test_what_is_no_table_is_no_more_work_than_its_size(tmp_path, monkeypatch, text):
    looked_at, split = [], sources.split_line

    def counting(line, delimiter):
        looked_at.append(len(line))
        return split(line, delimiter)

    monkeypatch.setattr(sources, "split_line", counting)
    with pytest.raises(InputError):
        open_log(written(tmp_path, text), rate_hz=1)
    assert sum(looked_at) < 20 * len(text)


def test_quoted_numbers(tmp_path):
    text = lines(before=["t,fx,fy,fz"]).replace(",", '","').replace("\n", '"\n"')
    moments, forces = everything(open_log(written(tmp_path, f'"{text[:-1]}')))
    np.testing.assert_array_equal(moments, TIME)
    np.testing.assert_array_equal(forces, FORCES)


@pytest.mark.parametrize("note", ['a "start', 'so-called "x" and "y', '5",1,"'])
def test_a_quotation_mark_that_does_not_close_swallows_no_rows(tmp_path, note):
    """The rows up to the next mark were one cell of the unused column."""
    rows = lines(before=["t,fx,fy,fz,note"]).replace("\n", ",\n").splitlines()
    rows[0], rows[9], rows[20] = rows[0][:-1], rows[9] + f'"{note}', rows[20] + '"as it should"'
    moments, forces = everything(log := open_log(written(tmp_path, "\n".join(rows))))
    whole = np.ones(N, dtype=bool)
    whole[8] = "," not in note  # which column is it then?
    np.testing.assert_array_equal(moments, TIME[whole])
    np.testing.assert_array_equal(forces, FORCES[whole])
    assert len(log.warnings()) == (not whole.all())


def test_gzip(tmp_path):
    packed = gzip.compress(lines(before=["t,fx,fy,fz"]).encode())
    path = tmp_path / "log.csv.gz"
    path.write_bytes(packed)
    np.testing.assert_array_equal(everything(open_log(path))[1], FORCES)
    path.write_bytes(packed[:-20])
    with pytest.raises(InputError, match="not a whole gzip file"):
        everything(open_log(path))
    path = tmp_path / "log.parquet.gz"
    path.write_bytes(packed)
    with pytest.raises(InputError, match="unpack it first"):
        open_log(path)


def test_two_parquet_columns_of_one_name(tmp_path):
    arrays = [pa.array(column) for column in (*TABLE.T, FORCES[:, 0])]
    path = tmp_path / "log.parquet"
    pq.write_table(pa.Table.from_arrays(arrays, ["t", "fx", "fy", "fz", "fx"]), path)
    with pytest.raises(InputError, match="which column is fx"):
        everything(open_log(path))
    np.testing.assert_array_equal(everything(open_log(path, **BY_PLACE))[1], FORCES)


def test_a_header_does_not_steer_the_terminal(tmp_path):
    path = written(tmp_path, lines(before=["t,\x1b[2J\x1b[31mfx,\u202ef,fz"]))
    with pytest.raises(InputError) as caught:
        open_log(path)
    assert str(caught.value).isprintable()
    assert r"\x1b[31mfx" in str(caught.value)


@contextmanager
def one_line_at_most():
    """Let nothing pass but an `InputError` of one line."""
    message = ""
    try:
        yield
    except InputError as error:
        message = str(error)
    assert len(message.splitlines()) <= 1


cells = st.one_of(
    st.floats(-20, 20).map(str),
    st.sampled_from(["nan", "", "1e400", "-", '"', "1_0", "a", "0x1", "1,5", "True", "1e15"]),
    st.text("01.,;# \t%\"'\r\x00eE-+a\u2028é", max_size=6),
)


@settings(max_examples=80, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.lists(st.lists(cells, max_size=6), max_size=40),
    st.sampled_from([",", ";", " ", "\t", ", "]),
    st.sampled_from([{"rate_hz": 100.0}, {"rate_hz": 3.0}, {"time": 0}, {}]),
    st.sampled_from([None, {"fx": 0, "fy": 1, "fz": 2}, {"fx": 3, "fy": 1, "fz": 2}]),
)
@example([["1", "2", "3"], ["1", "2", "3", "4"], ["2", "3", "4"]], ",", {"rate_hz": 9.0}, None)
@example([['"'], ["0.0", "0.0", '"']], ",", {"rate_hz": 100.0}, None)
@example([["1_0", "\u2028", "1", "1", "\u2028"], ["1e400"]], " ", {"rate_hz": 100.0}, None)
@example([["1", "", "2", '"\n,1,nan\n"', "\t", "#"]], ",", {"rate_hz": 100.0}, None)
def test_whatever_the_text(tmp_path, rows, separator, timing, columns):
    path = tmp_path / "log.csv"
    path.write_text("\n".join(separator.join(row) for row in rows), encoding="utf-8")
    with one_line_at_most():
        log = open_log(path, columns=columns, **timing)
        time, forces = everything(log)
        assert len(time) == len(forces)
        assert np.isfinite(forces).all()
        find_holds([log], ImportSettings(shortest_s=0.1, window_s=0.5))
