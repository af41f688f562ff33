"""What `import` refuses: one line that says where and what to do, and nothing is written.

Each row is what a file holds, what the user typed after it, and a part of the line. Files are text,
or forces (n, 3) at 100 Hz; those of robots and of reference sensors have tests of their own.
"""

import gzip
import io
import os
import shlex
import zipfile

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from calling import refusal
from log_helpers import FORCES, RATE, TABLE, TIME, G, changed, lines, session, write
from scipy.io import savemat

BY_PLACE = "--columns fx=1,fy=2,fz=3 --time 0"
ABAC = lines(before=["a,b,a,c"])
NAMED = lines(before=["t,fx,fy,fz"])
HELD, EDGES = session()
BLOCKS = np.concatenate([HELD[start : start + 40] for start, _ in EDGES])
MEAN = {"n": 4, "fx": 1.0, "fy": 2.0, "fz": 3.0, "sx": 1.0, "sy": 1.0, "sz": 1.0}


def means(**changes):
    row = {**MEAN, **changes}
    return pd.DataFrame([row, row]).to_csv(index=False)


def dated(*texts):
    times = [texts[i % len(texts)].format(i) for i in range(len(FORCES))]
    return pd.DataFrame(FORCES, columns=["fx", "fy", "fz"]).assign(time=times).to_csv(index=False)


def packed(name):
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w") as archive:
        archive.writestr(name, "text")
    return content.getvalue()


def matlab(**arrays):
    content = io.BytesIO()
    savemat(content, arrays)
    return content.getvalue()


def parquet(names, *columns):
    content = io.BytesIO()
    pq.write_table(pa.Table.from_arrays([pa.array(column) for column in columns], names), content)
    return content.getvalue()


def wobbling(rng, size, cut, n=9000):
    """Smooth motion below a frequency, Hz."""
    frequency = np.fft.rfftfreq(n, 1 / RATE)
    spectrum = np.fft.rfft(rng.standard_normal((n, 3)), axis=0)
    spectrum[(frequency > cut) | (frequency == 0)] = 0
    motion = np.fft.irfft(spectrum, n, axis=0)
    return size * motion / motion.std()


def moved(turn, size=0.0, cut=1):
    """Forces of a sensor that turns about its y axis, rad/s, and is shaken."""
    rng, angle = np.random.default_rng(1), turn * np.arange(9000) / RATE
    turning = G * np.column_stack([np.sin(angle), 0 * angle, -np.cos(angle)])
    return turning + wobbling(rng, size, cut) + 0.02 * rng.standard_normal((9000, 3))


NEVER = "the sensor was never still: "
SOMETHING_ELSE = "no text, MATLAB file up to version 7, Parquet, bag or ULog; unpack an archive"
REFUSED = [
    # Text that is no log.
    ("", BY_PLACE, "the file is empty"),
    ("so,it,goes\nand,goes,on\n", BY_PLACE, "no line of numbers"),
    (changed(20, 0, "4.75"), BY_PLACE, "line 21, column 0 (time): time does not increase"),
    ("\n".join(f"{i},1,2,{i}" for i in range(9)), BY_PLACE, "column 1 (fx) is constant"),
    ("0,1,2,3\n", BY_PLACE, "too few samples (1)"),
    ("1.5," * 20_000, "--rate 1", "no end of a line in 65536 characters"),
    (NAMED.replace("\n0.5", "\nx").replace("\n1.0", "\nx").replace("\n1.5", "\nx"), "",
     "3 of 50 rows lack one, which are too many"),
    (lines(before=["t,\x1b[31mfx,\u202ef,fz"]), "", r"\x1b[31mfx"),
    ("incl x,incl y\n1,2\n2,1\n", "--rate 9", "which column is fx? The columns are incl x, incl y"),
    (dated("yesterday", "today"), "", "'yesterday', not a usable number; give the rate (--rate)"),
    (dated("1492-01-01 10:00:00.{:05d}"), "", "--rate"),
    # Files that are something else.
    (packed("[Content_Types].xml"), "", SOMETHING_ELSE),
    (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + bytes(500), "", SOMETHING_ELSE),
    (b'[{"ax": 1, "ay": 2}]', "", SOMETHING_ELSE),
    (b"BZh91AY" + bytes(50), "", SOMETHING_ELSE),
    (("log.csv.gz", gzip.compress(NAMED.encode())[:-20]), "", "not a whole gzip file"),
    (("log.parquet", b"PAR1" + bytes(99)), "", "not a whole Parquet file"),
    (("log.parquet", parquet(["t", "fx", "fy", "fz", "fx"], *TABLE.T, TIME)), "", "which column"),
    (("log.parquet", parquet(["t", "fx", "fy", "fz"], *TABLE.T[:3], ["a"] * 50)), "",
     "column fz is string, not numbers"),
    (("log.mat", matlab(log=TABLE)[:300]), "", "not a whole MATLAB file"),
    (("log.mat", matlab(log=TABLE, other=FORCES)), "--rate 4", "which array? There are log, other"),
    (("log.mat", matlab(log=TABLE, other=FORCES)), "--variable othr", "did you mean 'other'"),
    (("log.mat", matlab(log=1j * TABLE)), BY_PLACE, "array log has complex numbers"),
    # Columns, clock and units.
    (ABAC, "", "which column is fx? The columns are a, b, a, c, counted from 0; give --colum"),
    (ABAC, "--columns fx=q", "fx: no column 'q'; there are a, b, a, c"),
    (ABAC, "--columns fx=4", "fx: no column '4'; there are a, b, a, c, counted from 0"),
    (ABAC, "--columns fx=a", "fx: there are several columns 'a'"),
    (ABAC, "--columns fx=1,fy=1,fz=3", "two of fx, fy, fz name the same column"),
    (ABAC, "--columns gx=1", "unknown column 'gx'"),
    (ABAC, "--columns fx=1,fy=2,fz=3", "give the column of time (--time), or the rate (--rate)"),
    (ABAC, f"{BY_PLACE} --rate 9", "give the rate or the column of time, not both"),
    (ABAC, "--rate -5", "--rate: '-5': must be at least 1e-06 and at most 1e+09 Hz"),
    (ABAC, "--unit ft", "--unit: must be 'm/s^2', 'g', 'mg' or 'counts', not 'ft'"),
    (ABAC, f"{BY_PLACE} --unit counts", "0.00059855 where 1 g is 16384 counts"),
    (ABAC, "--frame fru", "is left-handed"),
    (ABAC, "--range '8 feet'", "--range: '8 feet': the unit must be one of mm/s^2, m/s^2, mg"),
    (ABAC, "--settings none.yaml", "none.yaml: no such file"),
    (HELD / G, "--rate 100", "look like g, not m/s^2; give --unit g"),
    (HELD, "--rate 100 --unit g", "look like m/s^2, not g; give --unit m/s^2"),
    (1e4 * HELD, "--rate 100", "look like counts, not m/s^2, and need a scale; give --unit counts"),
    (HELD, "--rate 100 --gravity 1.62", "does not fit a gravity of 1.62 m/s²; give --gravity"),
    # Holds.
    (HELD, "--rate 100 --threshold 1e-9", "no static hold"),
    (HELD, "--rate 100 --shortest 5", "8 rests of 4.0 s are no hold: it takes 6.4 s"),
    (HELD, "--rate 100 --window 0.02", "holds 2 samples, at 100 per second; is the rate (--rate)"),
    (HELD, "--rate 100 --window 1e3", "too few samples for a window of 100001"),
    (HELD, "--rate 100 --exclude 13:moved", "exclude: there is no hold 13; they are 1, 2, 3"),
    (HELD, "--rate 100 --exclude 13", "exclude: expected holds by their numbers in segmentation"),
    (HELD, "--rate 100 --join 4,5", "--join: no longer an option; holds in one attitude"),
    (HELD, "--rate 100 --exclude 1s-2s:x", "as 13:moved or 13,14:moved, not '1s-2s:x'"),
    (np.repeat(np.eye(4, 3) * G, 300, axis=0), "--rate 100 --window 0.5", "frozen"),
    (moved(0.5, 4.0, 3), "--rate 100", NEVER),  # waved about
    (moved(0.1, 0.4, 2), "--rate 100", NEVER),  # turned gently by hand
    (moved(0.02), "--rate 100", NEVER),  # on a turntable
    (moved(0.0, 2.0, 3), "--rate 100", NEVER),  # carried upright
    # Blocks.
    (BLOCKS, "--block 39", "320 samples are no multiple of the 39 of a block (--block): 312 or"),
    (BLOCKS, "--block 80", "blocks of 80 samples are no positions"),
    (BLOCKS, "--block 3", "--block: must be from 4 to"),
    (BLOCKS, "--block 40 --means", "(--means) has a row for each position, no block"),
    (BLOCKS, "none.csv --block 40", "a log of blocks (--block) is one file, not 2"),
    # Means.
    (means(n=0), "--means", "n_samples: must be positive"),
    (means(sy=-1), "--means", "must not be negative"),
    (means(fy=np.nan), "--means", "line 2, column fy (fy): nothing"),
    (HELD, "--rate 100 --robot-sigma 3mgon", "its angles go with a table of means"),
]  # fmt: skip


@pytest.mark.parametrize(("content", "words", "part"), REFUSED, ids=[row[2] for row in REFUSED])
def test_it_is_refused_in_one_line(content, words, part, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    name = "log.csv"
    if isinstance(content, np.ndarray):
        name = write(tmp_path, content).name
    else:
        name, content = content if isinstance(content, tuple) else (name, content)
        (tmp_path / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    line = refusal("import", name, *shlex.split(words), "--out", "out")
    assert part in line
    assert line[:-1].isprintable()
    assert "campaign.yaml" not in line
    assert os.listdir() == [name]


def test_what_is_no_file_is_refused(tmp_path):
    """What was read of a pipe to recognise it was lost, and the rest was leveled without a word."""
    os.mkfifo(tmp_path / "pipe")
    for name, part in (("none.csv", "no such file"), ("pipe", "pipe")):
        assert part in refusal("import", tmp_path / name, "--out", tmp_path / "out")
