"""What an earlier run left: damaged, of another configuration, of other software, or a lock."""

import os

import numpy as np
import pandas as pd
import pyarrow as pa
import pytest

from accelstudy.basics.errors import InputError
from accelstudy.files import tables
from accelstudy.files.outputs import DIAGNOSIS
from accelstudy.files.parquet import write_parquet
from accelstudy.files.tables import write_table
from accelstudy.jobs import earlier
from accelstudy.jobs.earlier import earlier_run, remove_foreign
from accelstudy.study.tables import read_estimates

RESULTS = "results/tiny"
NAMES = [f"{RESULTS}/estimates/{number:04d}.parquet" for number in range(3)]
OUTPUTS = [
    *NAMES, f"{RESULTS}/summary.parquet", f"{RESULTS}/figures/a.png", f"{RESULTS}/claims.html",
]  # fmt: skip
SETUPS = {name: f"setup {name}" for name in NAMES}


def write(name, seed=1, **provenance):
    table = pd.DataFrame({"cell": "a", "estimate": np.arange(1000.0), "omega": 1.0})
    table[["truth", "sigma_priori", "redundancy"]] = 1.0
    if name in SETUPS:
        provenance.setdefault("setup", SETUPS[name])
    write_table(name, table, {"config_hash": "", "seed": seed, **provenance})


@pytest.fixture
def finished(tmp_path, monkeypatch):
    """A study as a run has left it; the place is where Snakemake runs."""
    monkeypatch.chdir(tmp_path)
    for name in OUTPUTS[:4]:
        write(name)
    (tmp_path / RESULTS / "figures").mkdir()
    (tmp_path / OUTPUTS[4]).write_bytes(b"\x89PNG" + bytes(2000) + b"IEND\xaeB`\x82")
    (tmp_path / OUTPUTS[5]).write_text("<html></html>\n")
    return tmp_path


def lines(seed=1, setups=SETUPS):
    return list(earlier_run(RESULTS, OUTPUTS, setups, seed))


def damage(path, change):
    """Change a file, but not its time stamp."""
    before = path.stat()
    path.write_bytes(change(path.read_bytes()))
    os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))


def flipped(content):
    middle = len(content) // 3
    return content[:middle] + bytes([content[middle] ^ 1]) + content[middle + 1 :]


def test_nothing_to_say(finished):
    assert lines() == []
    for name in OUTPUTS[::2]:
        (finished / name).unlink()
    assert lines() == []  # what is not there is for Snakemake to make


@pytest.mark.parametrize("name", OUTPUTS)
def test_a_truncated_output_is_refused(name, finished):
    damage(finished / name, lambda content: content[: len(content) // 2])
    with pytest.raises(InputError, match=rf"^{name}: [^\n]*; delete it and run again$"):
        lines()
    (finished / name).unlink()
    assert lines() == []


def test_a_flipped_bit_is_refused(finished):
    damage(finished / NAMES[1], flipped)
    with pytest.raises(InputError, match=rf"^{NAMES[1]}: not a whole .*; delete it and run again$"):
        lines()
    damage(finished / OUTPUTS[3], flipped)
    with pytest.raises(InputError) as error:
        lines()
    assert str(error.value) == (
        f"2 files are damaged; delete them and run again: {NAMES[1]} {OUTPUTS[3]}"
    )


def test_of_many_estimates_the_ends_are_read(finished, monkeypatch):
    """What is in between is checked when it is used."""
    monkeypatch.setattr(earlier, "READ_AT_START", 1000)
    damage(finished / NAMES[1], flipped)
    assert lines() == []
    damage(finished / NAMES[2], lambda content: content[:-1])
    with pytest.raises(InputError, match=NAMES[2]):
        lines()


def test_another_configuration_is_said(finished):
    (line,) = lines(seed=2)
    assert line.startswith(f"{RESULTS}: 4 of 4 tables are of another configuration: {NAMES[0]} ")
    assert "`make anew`" in line
    (line,) = lines(setups={**SETUPS, NAMES[0]: "another"})
    assert f"1 of 4 tables are of another configuration: {NAMES[0]}. " in line
    (line,) = earlier_run(RESULTS, OUTPUTS[1:], {name: SETUPS[name] for name in NAMES[1:]}, 1)
    assert f"1 of 4 tables are of another configuration: {NAMES[0]}. " in line


@pytest.mark.parametrize(("name", "change", "words"), [
    ("calibration.json", lambda content: content[:-1], "calibration.json is damaged"),
    ("figures/a.svg", lambda content: content[:-2], "figures/a.svg is damaged"),
    ("positions.parquet", flipped, "positions.parquet is damaged"),
    ("diagnosis.json", None, "diagnosis.json is missing"),
])  # fmt: skip
def test_a_folder_is_whole_or_refused(name, change, words, tmp_path, monkeypatch):
    """Of all that a job wrote together, Snakemake misses nothing but the folder."""
    monkeypatch.chdir(tmp_path)
    folders = {"results/tiny/diagnosis": DIAGNOSIS, "results/tiny/none": DIAGNOSIS}
    folder = tmp_path / "results/tiny/diagnosis"
    (folder / "figures").mkdir(parents=True)
    for document in ("diagnosis.json", "calibration.json"):
        (folder / document).write_text("{}")
    (folder / "figures/a.svg").write_text("<svg></svg>\n")
    (folder / "mine.svg").write_text("")
    write_parquet(folder / "positions.parquet", pa.table({"force": np.arange(1000.0)}))
    assert list(earlier_run(RESULTS, [], {}, None, folders)) == []
    if change is None:
        (folder / name).unlink()
    else:
        damage(folder / name, change)
    with pytest.raises(InputError) as error:
        list(earlier_run(RESULTS, [], {}, None, folders))
    assert str(error.value) == f"results/tiny/diagnosis: {words}; delete it and run again"


def test_other_software_is_said(finished, monkeypatch):
    monkeypatch.setattr(tables, "_version", {"numpy": "9.9.9", "llvmlite": "0.0.1"}.get)
    monkeypatch.setattr(tables, "git_commit", lambda: "0123456" + 33 * "0" + "+")
    write(NAMES[0])
    monkeypatch.undo()
    monkeypatch.chdir(finished)
    (line,) = lines()
    now = tables.origin({})
    commit = now["commit"][:7] + ("+" if now["commit"].endswith("+") else "")
    assert line.startswith(
        f"{RESULTS}: has tables made by commit 0123456+ (now {commit}), numpy 9.9.9 (now "
        f"{now['numpy']}), scipy none (now {now['scipy']}) and llvmlite 0.0.1 (now "
        f"{now['llvmlite'] or 'none'}). What this run does not make anew "
    )
    assert "`make anew`" in line


def test_a_lock_is_said(finished):
    locks = finished / ".snakemake" / "locks"
    locks.mkdir(parents=True)
    (locks / "0.output.lock").write_text("results/other/summary.parquet\n")
    assert lines() == []
    (locks / "1.output.lock").write_text(f"{OUTPUTS[3]}\n{OUTPUTS[4]}\n")
    (line,) = lines()
    assert line.startswith(f"{RESULTS} is locked, by a run that is going on or by one that was kil")
    assert "`make unlock`" in line


def test_estimates_of_different_runs_are_not_mixed(finished):
    """Fewer cells and another seed: the new run writes the first file and leaves the others."""
    folder = finished / RESULTS / "estimates"
    assert len(read_estimates(folder)) == 3000
    write(NAMES[0], seed=2, setup="of seed 2")
    with pytest.raises(
        InputError, match=r"estimates: holds files of different studies, 0000\.parquet "
    ):
        read_estimates(folder)
    now = {NAMES[0]: "of seed 2", NAMES[1]: "is to come"}
    estimates = folder.relative_to(finished)
    assert remove_foreign(estimates, {**now, NAMES[2]: "is kept"}, set(NAMES[:2])) == (
        f"{RESULTS}/estimates: removed estimates of another configuration, in 1 file(s)"
    )
    write(NAMES[1])
    assert remove_foreign(estimates, now, set(NAMES[:2])) == (
        f"{RESULTS}/estimates: removed estimates of another configuration, in 2 file(s)"
    )
    assert len(read_estimates(folder)) == 1000
    assert remove_foreign(estimates, now, set(NAMES[:2])) is None


def test_files_of_a_user_stay_among_the_estimates(finished):
    folder = finished / RESULTS / "estimates"
    pd.DataFrame({"a": [1]}).to_parquet(folder / "mine.parquet")
    (folder / "notes.txt").touch()
    assert lines() == []
    assert remove_foreign(folder, {}, set()) is not None
    assert sorted(path.name for path in folder.iterdir()) == ["mine.parquet", "notes.txt"]
    with pytest.raises(InputError, match=r"mine\.parquet: does not say where it comes from"):
        read_estimates(folder)
    (folder / "mine.parquet").unlink()
    with pytest.raises(InputError, match="estimates: holds no tables"):
        read_estimates(folder)
