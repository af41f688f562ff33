"""What is written is whole or not there, and nothing of a user's is lost."""

import errno
import os
import resource
from pathlib import Path

import pytest
from calling import refusal, succeed
from campaign_helpers import simulated_campaign

from accelstudy.basics.errors import InputError
from accelstudy.campaign.format import write_campaign
from accelstudy.files.outputs import CALIBRATION, CAMPAIGN, DIAGNOSIS, new_file, whole_file


def content(folder):
    """All files below a folder, and its empty folders, with what they hold."""
    return {
        path.relative_to(folder).as_posix(): None if path.is_dir() else path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file() or not list(path.iterdir())
    }


def write(folder, **files):
    for name, text in files.items():
        path = folder / name.replace("__", "/").replace("_", ".")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")


def refused(out, kind, inputs=(), force=False):
    with pytest.raises(InputError) as error, kind.place(out, inputs, force):
        raise AssertionError("not refused")
    assert "\n" not in str(error.value)
    return str(error.value)


# --- what is written -----------------------------------------------------------------------------


def test_a_new_folder_has_usual_permissions(tmp_path):
    with CALIBRATION.place(tmp_path / "a/b") as folder:
        write(folder, calibration_json="1", figures__residuals_png="2")
        assert not (tmp_path / "a").exists()
    assert content(tmp_path / "a/b") == {"calibration.json": b"1", "figures/residuals.png": b"2"}
    (tmp_path / "usual").mkdir()
    assert (tmp_path / "a/b").stat().st_mode == (tmp_path / "usual").stat().st_mode
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a", "usual"]


def test_an_earlier_result_is_replaced_whole(tmp_path):
    """Also what the new run does not write; the folder itself stays, it may be one's own place."""
    out = tmp_path / "out"
    write(out, diagnosis_json="old", loop_parquet="old", figures__loop_png="old", notes_txt="mine",
          figures__one__gap_png="old")  # fmt: skip
    number = out.stat().st_ino
    with DIAGNOSIS.place(out) as folder:
        write(folder, diagnosis_json="new", figures__gap_png="new")
    expected = {"diagnosis.json": b"new", "figures/gap.png": b"new", "notes.txt": b"mine"}
    assert content(out) == expected
    assert not (out / "figures/one").exists()
    assert out.stat().st_ino == number


@pytest.mark.parametrize(("error", "line"), [
    (ValueError("no"), "^no$"),
    (OSError(errno.ENOSPC, "No space left"), "out: cannot be written: No space left$"),
])  # fmt: skip
def test_a_failed_run_leaves_the_earlier_result(tmp_path, error, line):
    out = tmp_path / "out"
    write(out, calibration_json="old", report_html="old")

    def run():
        with CALIBRATION.place(out) as folder:
            write(folder, calibration_json="new")
            raise error

    with pytest.raises(ValueError, match=line):  # InputError is one
        run()
    assert content(tmp_path) == {"out/calibration.json": b"old", "out/report.html": b"old"}


def test_a_result_whose_files_are_moved_in_part_is_not_taken_for_whole(tmp_path, monkeypatch):
    """As by a power cut between two moves: the file by which a result is known is missing."""
    out = tmp_path / "out"
    write(out, calibration_json="old", report_html="old")
    replace = Path.replace

    def failing(self, target):
        if target.name == "report.html":
            raise OSError(errno.EIO, "Input/output error", str(self))
        return replace(self, target)

    def run():
        with CALIBRATION.place(out) as folder:
            write(folder, calibration_json="new", report_html="new")
            monkeypatch.setattr(Path, "replace", failing)

    with pytest.raises(InputError, match=r"out: cannot be written: Input/output error$"):
        run()
    assert content(tmp_path) == {"out/report.html": b"old"}


# --- what is refused -----------------------------------------------------------------------------


@pytest.mark.parametrize("force", [False, True])
def test_output_never_goes_into_input(tmp_path, force):
    campaign = tmp_path / "data/campaign"
    write(campaign, campaign_yaml="x")
    (tmp_path / "link").symlink_to(campaign)
    for out in (campaign, tmp_path / "link"):
        assert "is the input" in refused(out, CALIBRATION, [campaign], force)
    for out in (campaign / "out", tmp_path / "link/a/b", tmp_path / "data/../link/out"):
        assert "lies in the input" in refused(out, CALIBRATION, [campaign], force)
    assert "holds the input" in refused(tmp_path, CALIBRATION, [tmp_path / "link"], force)
    assert "holds the input" in refused(campaign, CAMPAIGN, [campaign / "campaign.yaml"], force)
    assert content(tmp_path / "data") == {"campaign/campaign.yaml": b"x"}


def test_what_is_there_is_replaced_only_if_asked(tmp_path):
    write(tmp_path, positions_csv="mine", notes_txt="mine", figures__mine_png="mine")
    text = refused(tmp_path, CAMPAIGN)
    assert "not empty (figures, notes.txt, positions.csv)" in text
    assert "`force`" in text
    with CAMPAIGN.place(tmp_path, force=True) as folder:
        write(folder, positions_csv="new", campaign_yaml="new")
    kept = {"notes.txt": b"mine", "figures/mine.png": b"mine"}
    assert content(tmp_path) == {"positions.csv": b"new", "campaign.yaml": b"new", **kept}
    assert "not empty" in refused(tmp_path, CAMPAIGN)  # its header may have been edited by hand
    with pytest.raises(InputError, match="not empty"), CAMPAIGN.place(tmp_path / "late"):
        write(tmp_path, late__campaign_yaml="of a second run")


def test_what_is_in_the_way(tmp_path):
    write(tmp_path, file="x", out__figures="x")
    assert "is not a folder" in refused(tmp_path / "file", CALIBRATION)
    (tmp_path / "loop").symlink_to("loop")
    for out, what in (("file/a/b", "file"), ("loop", "loop"), ("loop/a", "loop")):
        assert f"{what} is not a folder" in refused(tmp_path / out, CALIBRATION)
    assert "figures: is in the way" in refused(tmp_path / "out", CALIBRATION, force=True)
    (tmp_path / "linked").mkdir()
    (tmp_path / "linked/report.html").symlink_to(tmp_path / "file")
    assert "report.html: is in the way" in refused(tmp_path / "linked", CALIBRATION, force=True)


def test_a_folder_that_cannot_be_written(tmp_path, monkeypatch):
    """It is found before anything is computed; permissions do not bind root."""

    def closed(suffix, prefix, dir):
        raise PermissionError(errno.EACCES, "Permission denied", f"{dir}/{prefix}x{suffix}")

    monkeypatch.setattr("tempfile.mkdtemp", closed)
    expected = f"{tmp_path}/a/b: cannot be written: Permission denied"
    assert refused(tmp_path / "a/b", CALIBRATION) == expected


# --- single files --------------------------------------------------------------------------------


def test_a_file_is_not_replaced_unasked(tmp_path):
    write(tmp_path, log_csv="log", old_csv="old")
    for out in ("old.csv", "log.csv"):
        with pytest.raises(InputError), new_file(tmp_path / out, [tmp_path / "log.csv"]):
            pass
    same = tmp_path / "same.csv"
    os.link(tmp_path / "log.csv", same)
    with (
        pytest.raises(InputError, match="is the input"),
        new_file(same, [tmp_path / "log.csv"], True),
    ):
        pass
    with new_file(tmp_path / "old.csv", [tmp_path / "log.csv"], force=True) as path:
        path.write_text("new")
    assert content(tmp_path) == {"log.csv": b"log", "same.csv": b"log", "old.csv": b"new"}


def test_a_planted_link_is_not_followed(tmp_path):
    write(tmp_path, victim="precious")
    (tmp_path / "out.csv").symlink_to(tmp_path / "victim")
    with whole_file(tmp_path / "out.csv") as path:
        assert path.parent.stat().st_mode & 0o077 == 0  # nobody else can plant anything here
        path.write_text("new")
    assert (tmp_path / "victim").read_text() == "precious"
    assert (tmp_path / "out.csv").read_text() == "new"
    assert not (tmp_path / "out.csv").is_symlink()


def test_two_runs_that_write_one_file_do_not_meet(tmp_path):
    """As a job of a killed run and the same job of the next one."""
    target = tmp_path / "table"
    with whole_file(target) as late:
        late.write_text("a long beginning")
        with whole_file(target) as early:
            early.write_text("whole")
        assert target.read_text() == "whole"
        with late.open("a") as file:
            file.write(", and its end")
    assert content(tmp_path) == {"table": b"a long beginning, and its end"}


# --- the commands --------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def measured(tmp_path_factory):
    """A campaign, its calibration, and a log."""
    folder = tmp_path_factory.mktemp("measured")
    write_campaign(simulated_campaign({"b_x": 0.05}), folder / "campaign")
    succeed("calibrate", folder / "campaign", "--out", folder / "calibrated")
    write(
        folder,
        log_csv="fx,fy,fz\n0.1,0.2,-9.8\n",
        means_csv="fx,fy,fz\n1,2,-9.5\n2,1,9.5\n9.7,1,1\n",
    )
    return folder


def commands(folder, out):
    campaign, calibration = folder / "campaign", folder / "calibrated/calibration.json"
    return {
        "calibrate": ("calibrate", campaign, "--out", out),
        "apply": ("apply", calibration, folder / "log.csv", "--out", out),
        "import": ("import", folder / "means.csv", "--means", "--out", out),
        "truth": ("simulate-campaign", "--out", f"{out}-campaign", "--truth", out),
    }


@pytest.mark.usefixtures("drawn")  # figures are what does not fit
@pytest.mark.parametrize(("name", "room"), [
    *((name, 0) for name in ("apply", "import", "truth")),
    ("calibrate", 7000),
    ("calibrate", 20_000),
])  # fmt: skip
def test_a_full_disk_is_one_line(measured, tmp_path, name, room):
    """Room for files of so many bytes; beyond it writing fails as it does on a full disk."""
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (room, limits[1]))
    try:
        line = refusal(*commands(measured, tmp_path / "a/out")[name])
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert "cannot be written: File too large" in line
    assert ".part" not in line
    assert content(tmp_path) == {}
