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
from log_helpers import FORCES, RATE, TABLE, TIME, G, lines, session, write
from scipy.io import savemat

BY_PLACE = "--columns fx=1,fy=2,fz=3 --time 0"
NAMED = lines(before=["t,fx,fy,fz"])
HELD, EDGES = session()
BLOCKS = np.concatenate([HELD[start : start + 40] for start, _ in EDGES])


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
    ("0,1,2,3\n", BY_PLACE, "too few samples (1)"),
    ("1.5," * 20_000, "--rate 1", "no end of a line in 65536 characters"),
    (NAMED.replace("\n0.5", "\nx").replace("\n1.0", "\nx").replace("\n1.5", "\nx"), "",
     "3 of 50 rows lack one, which are too many"),
    (dated("yesterday", "today"), "", "'yesterday', not a usable number; give the rate (--rate)"),
    (dated("1492-01-01 10:00:00.{:05d}"), "", "--rate"),
    # Files that are something else.
    (packed("[Content_Types].xml"), "", SOMETHING_ELSE),
    (("log.csv.gz", gzip.compress(NAMED.encode())[:-20]), "", "not a whole gzip file"),
    (("log.parquet", b"PAR1" + bytes(99)), "", "not a whole Parquet file"),
    (("log.parquet", parquet(["t", "fx", "fy", "fz", "fx"], *TABLE.T, TIME)), "", "which column"),
    (("log.parquet", parquet(["t", "fx", "fy", "fz"], *TABLE.T[:3], ["a"] * 50)), "",
     "column fz (fz): 'a', not a usable number"),
    (("log.mat", matlab(log=TABLE)[:300]), "", "not a whole MATLAB file"),
    (("log.mat", matlab(log=TABLE, other=FORCES)), "--rate 4", "which array? There are log, other"),
    (("log.mat", matlab(log=TABLE, other=FORCES)), "--variable othr", "did you mean 'other'"),
    (("log.mat", matlab(log=1j * TABLE)), BY_PLACE, "array log has complex numbers"),
    (1e4 * HELD, "--rate 100", "look like counts, not m/s^2; give their nominal scale (--scale), "
     "about 0.0001 m/s² per count"),
    # Holds.
    (np.repeat(np.eye(4, 3) * G, 300, axis=0), "--rate 100 --window 0.5", "frozen"),
    (moved(0.5, 4.0, 3), "--rate 100", NEVER),  # waved about
    (moved(0.1, 0.4, 2), "--rate 100", NEVER),  # turned gently by hand
    (moved(0.02), "--rate 100", NEVER),  # on a turntable
    (moved(0.0, 2.0, 3), "--rate 100", NEVER),  # carried upright
    # Blocks.
    (BLOCKS, "--block 39", "320 samples are no multiple of the 39 of a block (--block): 312 or"),
    (BLOCKS, "--block 80", "blocks of 80 samples are no positions"),
    (BLOCKS, "none.csv --block 40", "a log of blocks (--block) is one file, not 2"),
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
