"""Output of commands and jobs: written whole or not at all, and never over files of the user.

Everything is written to a temporary folder on the same disk first, and moved when it is complete.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from errno import ENOTDIR
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from accelstudy.basics.errors import InputError, reason_of

_PREFIX = ".accelstudy-"


@dataclass(frozen=True)
class OutputKind:
    """What a command writes to a folder.

    Attributes
    ----------
    name : str, for messages
    marker : str, the file by which such a folder is known; it is moved there last
    files : tuple of str, other files that it may contain
    folders : tuple of str, subfolders whose files are the command's own
    replaced : bool, whether the command may replace its own earlier result without `force`
    """

    name: str
    marker: str
    files: tuple[str, ...] = ()
    folders: tuple[str, ...] = ()
    replaced: bool = True

    def of_earlier_run(self, folder: Path) -> set[Path]:
        """Files in a folder of this kind that belong to the command, relative to it."""
        files = {Path(name) for name in (self.marker, *self.files) if (folder / name).is_file()}
        for name in self.folders:
            files |= {p.relative_to(folder) for p in (folder / name).rglob("*") if p.is_file()}
        return files

    @contextmanager
    def place(
        self, out: str | Path, inputs: Iterable[str | Path] = (), force: bool = False
    ) -> Iterator[Path]:
        """Yield a new folder to write to; its files are moved to `out` together if all went well.

        Enter it before anything is computed, so that a folder that cannot be written is found at
        once.

        Parameters
        ----------
        out : path of the folder of results, made if it is not there
        inputs : files and folders that are read; `out` must be apart from them
        force : bool
            Whether to write into a folder with other files. Files that have the name of one that is
            written are replaced, the others stay.

        Raises
        ------
        InputError
            If `out` is, holds or lies in an input, holds what must not be overwritten, or cannot be
            written. `out` is then unchanged.
        """
        out = Path(out)
        with _disk_errors_named(out):
            _check_apart(out, inputs)
            _check_folder(out, self, force)
            with _staging(out, out, "new") as new:
                new.mkdir()
                yield new
                # Somebody else may have written there in the meantime.
                _publish(new, Path(os.path.realpath(out)), self, _check_folder(out, self, force))


DIAGNOSIS = OutputKind(
    "diagnosis",
    "diagnosis.json",
    # loop.parquet is of folders of 0.3.
    ("calibration.json", "loop.parquet", "model.yaml", "positions.parquet", "report.html"),
    ("figures",),
)
CALIBRATION = OutputKind(
    "calibration", "calibration.json", ("positions.parquet", "report.html"), ("figures",)
)
# segmentation.svg is of folders of 0.3.
CAMPAIGN = OutputKind(
    "campaign",
    "campaign.yaml",
    ("positions.csv", "segmentation.svg", "segmentation.png"),
    replaced=False,
)
BATCH = OutputKind("batch", "campaigns.parquet", ("parameters.parquet", "report.html"), ("each",))
# comparison.json and history.parquet are of folders of 0.3.
HISTORY = OutputKind(
    "history",
    "history.json",
    ("comparison.json", "history.parquet", "report.html"),
    ("figures",),
)
LOT = OutputKind("lot", "lot.json", ("type.yaml", "report.html"), ("figures", "each"))
# plan.parquet and study.yaml are of folders of 0.3.
_PLAN_FILES = ("plan.parquet", "positions.yaml", "study.yaml", "plan.svg", "plan.png")
PLAN = OutputKind("plan", "plan.json", _PLAN_FILES)
_TABLES = ("cells", "summary", "correlations", "leveling", "quantiles")
SIMULATION = OutputKind(
    "simulation", "simulation.json", tuple(f"{name}.parquet" for name in _TABLES)
)
ADVICE = OutputKind("advice", "advice.json")
STUDY = OutputKind(
    "study",
    "Snakefile",
    ("README.md", "config/config.yaml", "sensor.yaml"),
    ("profiles",),
    replaced=False,
)
_WITH_MARKERS = (
    *(BATCH, DIAGNOSIS, CALIBRATION, CAMPAIGN, HISTORY, LOT, PLAN, SIMULATION),
    ADVICE,
)
"""Kinds that a folder is recognised as; one that holds the files of another comes first."""


@contextmanager
def new_file(
    path: str | Path, inputs: Iterable[str | Path] = (), force: bool = False
) -> Iterator[Path]:
    """Yield a temporary file, which is moved to `path` if all went well; see `OutputKind.place`.

    Raises
    ------
    InputError
        If `path` is an input, lies in a folder that is one, is there already and `force` is not
        given, or cannot be written.
    """
    path = Path(path)
    with _disk_errors_named(path):
        _check_apart(path, inputs)
        if path.is_dir() or (path.exists() and not path.is_file()):
            raise InputError(f"{path}: is no file; give the name of a file to write")
        if os.path.lexists(path) and not force:
            raise InputError(f"{path}: is there already; `force` replaces it")
        with whole_file(path) as temporary:
            yield temporary


@contextmanager
def whole_file(path: str | Path) -> Iterator[Path]:
    """Yield a temporary file of the same name, and move it to `path` only if all went well."""
    path = Path(path)
    with _staging(path.parent, path, path.name) as part:
        yield part
        path.parent.mkdir(parents=True, exist_ok=True)
        part.replace(path)


def write_text(path: str | Path, text: str) -> None:
    """Write a text in UTF-8, whole or not at all."""
    with whole_file(path) as part:
        part.write_text(text, encoding="utf-8")


def write_yaml(path: str | Path, content: Mapping[str, Any], width: int = 80) -> None:
    """Write YAML in the order of the keys, whole or not at all."""
    import yaml  # a help text goes without

    write_text(path, yaml.safe_dump(content, sort_keys=False, allow_unicode=True, width=width))


def check_writable(folder: str | Path) -> None:
    """Check that a folder and those in it can be written to, or that it can be made.

    Raises
    ------
    InputError
        If it, a folder in it, or the nearest folder above it that exists, is not writable, or is no
        folder.
    """
    folder = Path(folder)
    nearest = next(path for path in (folder, *folder.absolute().parents) if path.exists())
    if not nearest.is_dir():
        raise InputError(f"{folder}: cannot hold results: {nearest} is not a folder")
    inside = (Path(path) for path, _, _ in os.walk(folder))  # of the folder itself, if it is there
    for path in (nearest, *inside):
        if not os.access(path, os.W_OK | os.X_OK):
            raise InputError(f"{folder}: cannot hold results: {path} is not writable")


def cannot_write(error: OSError, out: Path) -> str:
    """Say that `out` cannot be written and why; name the place of the error if it is another."""
    where = Path(str(error.filename)) if error.filename is not None else out
    inside = where.is_relative_to(out) or is_temporary(where)
    place = "" if inside else f"{where}: "
    return f"{out}: cannot be written: {place}{reason_of(error)}"


def is_temporary(path: Path) -> bool:
    """Whether a file belongs to a run that has not finished."""
    return any(part.startswith(_PREFIX) for part in path.parts)


@contextmanager
def _staging(near: Path, out: Path, name: str) -> Iterator[Path]:
    """A path in a private folder in `near` or, if that is not there, in the nearest folder above.

    The name of the folder cannot be predicted, so nobody can place a link there. Errors name `out`
    instead of the path.
    """
    near = Path(os.path.realpath(near))
    folder = next(path for path in (near, *near.parents) if os.path.lexists(path))
    if not folder.is_dir():  # a file, or a link to itself
        raise NotADirectoryError(ENOTDIR, f"{folder} is not a folder")
    with TemporaryDirectory(
        prefix=_PREFIX, suffix=".part", dir=folder, ignore_cleanup_errors=True
    ) as stage:
        part = Path(stage) / name
        try:
            yield part
        except InputError as error:
            if str(part) not in str(error):
                raise
            raise InputError(str(error).replace(str(part), str(out))) from None


@contextmanager
def _disk_errors_named(out: Path) -> Iterator[None]:
    """Turn errors of the disk into one line that names `out`."""
    try:
        yield
    except BrokenPipeError:  # of the terminal
        raise
    except OSError as error:
        raise InputError(cannot_write(error, out)) from None


def _check_apart(out: Path, inputs: Iterable[str | Path]) -> None:
    place = Path(os.path.realpath(out))
    for source in map(Path, inputs):
        if not (source.is_file() or source.is_dir()):
            continue  # the reader reports what is not there, and a pipe is nowhere on the disk
        read = source.resolve()
        if place == read or (place.exists() and place.samefile(read)):
            raise InputError(f"{out}: is the input; give another name for the results")
        if read in place.parents and source.is_dir():
            raise InputError(f"{out}: lies in the input {source}; give another place")
        if place in read.parents and out.is_dir():
            raise InputError(f"{out}: holds the input {source}; give another folder")


def _check_folder(out: Path, kind: OutputKind, force: bool) -> bool:
    """Check that a folder may be written to; tell whether it is an earlier result of this kind."""
    if not out.is_dir():
        if out.exists():
            raise InputError(f"{out}: is not a folder")
        return False
    there = sorted(path.name for path in out.iterdir() if not is_temporary(Path(path.name)))
    if not there:
        return False
    _check_free(out, map(Path, (kind.marker, *kind.files)), map(Path, kind.folders))
    earlier = next((one for one in _WITH_MARKERS if (out / one.marker).is_file()), None)
    if earlier not in (None, kind):
        raise InputError(f"{out}: is the folder of a {earlier.name}; give another folder")
    if not force and (earlier is None or not kind.replaced):
        shown = ", ".join(there[:3]) + (", …" if len(there) > 3 else "")
        raise InputError(
            f"{out}: is not empty ({shown}); give another folder, or `force` to replace the files "
            f"of a {kind.name} in it"
        )
    return earlier is kind


def _publish(new: Path, out: Path, kind: OutputKind, is_earlier_result: bool) -> None:
    """Move new files to `out`, in place of those of an earlier run."""
    if not out.is_dir():
        out.parent.mkdir(parents=True, exist_ok=True)
        new.rename(out)
        return
    files = {path.relative_to(new) for path in new.rglob("*") if not path.is_dir()}
    folders = {parent for file in files for parent in file.parents} - {Path()}
    _check_free(out, files, folders)
    stale = kind.of_earlier_run(out) if is_earlier_result else set()
    # The marker goes first and comes last: with it, the results are complete.
    for file in (Path(kind.marker), *(stale - files)):
        (out / file).unlink(missing_ok=True)
    for file in sorted(files, key=lambda file: file == Path(kind.marker)):
        (out / file).parent.mkdir(parents=True, exist_ok=True)
        (new / file).replace(out / file)
    for file in stale - files:
        with suppress(OSError):  # other files are in it
            (out / file).parent.rmdir()


def _check_free(out: Path, files: Iterable[Path], folders: Iterable[Path]) -> None:
    """Check that the places of files and folders hold no links and nothing of another sort."""
    for paths, fits in ((files, Path.is_file), (folders, Path.is_dir)):
        for path in (out / path for path in paths):
            if path.is_symlink() or (path.exists() and not fits(path)):
                raise InputError(f"{path}: is in the way; move it elsewhere")
