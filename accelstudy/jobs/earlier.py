"""Checks of the results of an earlier run, before a new one starts.

Snakemake goes by time stamps and by its own records. It does not notice a damaged file that kept
its time stamp. Without its records it does not notice a changed configuration either.
"""

from __future__ import annotations

import json
import os
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from types import MappingProxyType
from typing import Any

from accelstudy.basics.errors import InputError
from accelstudy.basics.wording import comma_list
from accelstudy.files.outputs import Kind
from accelstudy.files.parquet import read_row_groups
from accelstudy.files.tables import LIBRARIES, REMEDY, origin, read_origin

READ_AT_START = 1_000_000_000
"""Up to so many bytes of estimates are read in full at the start, in seconds. Of more, only the
ends are read, and the rest is checked when it is used."""
LISTED = 10
"""Number of files that a line names."""
LOCKS = Path(".snakemake/locks")

_ENDS = {".png": b"IEND\xaeB`\x82", ".svg": b"</svg>", ".html": b"</html>"}
_SOFTWARE = {"version": "accelstudy", "commit": "commit", **{name: name for name in LIBRARIES}}


def earlier_run(
    results: str,
    outputs: Sequence[str],
    setups: Mapping[str, str],
    seed: int | None,
    folders: Mapping[str, Kind] = MappingProxyType({}),
) -> Iterator[str]:
    """Return lines that tell a person what to know of an earlier run before the next one starts.

    Parameters
    ----------
    results : folder of the results
    outputs : paths of all files that a run makes; they need not be there
    setups : digest by path, of tables that have one: their `setup` (`accelstudy.jobs.job.job`)
    seed : int; None where nothing is drawn
    folders : kind of each folder that a run makes as a whole; they need not be there

    Raises
    ------
    InputError
        If an output is there and damaged; one line names it, or all of them.
    """
    if _locked(results):
        yield (
            f"{results} is locked, by a run that is going on or by one that was killed. If none is "
            "going on: `make unlock`, or the same command with --unlock."
        )
    there = [path for path in outputs if Path(path).is_file()]
    origins = _origins(there, setups, {f: k for f, k in folders.items() if Path(f).is_dir()})
    for path in sorted(map(str, Path(results, "estimates").glob("*.parquet"))):
        with suppress(InputError):  # a file without provenance belongs to the user
            origins.setdefault(path, read_origin(path))
    kept = (
        "What this run does not make anew stays; --forceall, which for a study is `make anew`, "
        "makes all anew."
    )
    other = [
        path
        for path, made in origins.items()
        if made["seed"] != seed or made.get("setup") != setups.get(path)
    ]
    if other:
        yield (
            f"{results}: {len(other)} of {len(origins)} tables are of another configuration: "
            f"{_named(other)}. {kept}"
        )
    if changed := _other_software(origins.values()):
        yield f"{results}: has tables made by {comma_list(changed)}. {kept}"


def _locked(results: str) -> bool:
    return any(
        line.startswith(f"{results}/")
        for path in LOCKS.glob("*.lock")
        for line in path.read_text(encoding="utf-8", errors="replace").splitlines()
    )


def _other_software(origins: Iterable[Mapping[str, Any]]) -> list[str]:
    """Return names and versions that differ from the present ones."""
    now = origin({})
    changed = []
    for key, name in _SOFTWARE.items():
        before = {_brief(made.get(key)) for made in origins} - {_brief(now[key])}
        if before:
            changed.append(f"{name} {comma_list(sorted(before))} (now {_brief(now[key])})")
    return changed


def _brief(value: object) -> str:
    """Version or beginning of a commit; `+` marks uncommitted changes."""
    text = "none" if value is None else str(value)
    return text[:7] + ("+" if text.endswith("+") else "") if len(text) >= 40 else text


def _origins(
    paths: Sequence[str], estimates: Container[str], folders: Mapping[str, Kind]
) -> dict[str, dict[str, Any]]:
    """Check that files are as they were written; return the provenance of the tables."""
    size = sum(Path(path).stat().st_size for path in paths if path in estimates)
    origins = {}
    damaged = {}
    for path in (*paths, *folders):
        try:
            if path in folders:
                _check_folder(Path(path), folders[path])
                continue
            if path.endswith(".parquet"):
                origins[path] = read_origin(path)
            if size <= READ_AT_START or path not in estimates:
                _check_file(Path(path))
        except InputError as error:
            damaged[path] = error
    if len(damaged) == 1:
        raise next(iter(damaged.values()))
    if damaged:
        raise InputError(
            f"{len(damaged)} files are damaged; delete them and run again: {_named([*damaged])}"
        )
    return origins


def _named(paths: Sequence[str]) -> str:
    return " ".join(paths[:LISTED]) + (" …" if len(paths) > LISTED else "")


def _check_folder(folder: Path, kind: Kind) -> None:
    """Check that files of one job are all there; Snakemake does not miss a single one."""
    for name in sorted(kind.of_earlier_run(folder)):
        try:
            _check_file(folder / name)
        except InputError:
            raise InputError(f"{folder}: {name} is damaged; {REMEDY}") from None
    needed = [kind.marker]
    if kind.marker.endswith(".json") and (folder / kind.marker).is_file():
        needed += json.loads((folder / kind.marker).read_bytes()).get("files", [])
    for file in needed:
        if not (folder / file).is_file():
            raise InputError(f"{folder}: {file} is missing; {REMEDY}")


def _check_file(path: Path) -> None:
    """Check a table page by page, and that a picture, a page or a document does not end early."""
    if path.suffix == ".parquet":
        for _ in read_row_groups(path, REMEDY):
            pass
        return
    whole = True
    if path.suffix == ".json":
        try:
            json.loads(path.read_bytes())
        except ValueError:
            whole = False
    elif path.suffix in _ENDS:
        with path.open("rb") as file:
            file.seek(max(0, file.seek(0, os.SEEK_END) - 100))
            whole = file.read().rstrip().endswith(_ENDS[path.suffix])
    if not whole:
        raise InputError(f"{path}: is not whole; {REMEDY}")


def remove_foreign(
    folder: str | Path, setups: Mapping[str, str], to_make: Container[str]
) -> str | None:
    """Remove estimates that do not belong to the configured study; a line if there were any.

    Readers of the whole folder would get them too. Files without provenance stay: they belong to
    the user. Files of this study stay too unless they are in `to_make`, the outputs of the run: the
    job that reads them says what to do.
    """
    removed = 0
    for path in Path(folder).glob("*.parquet"):
        if str(path) in setups and str(path) not in to_make:
            continue
        try:
            setup = read_origin(path).get("setup")
        except InputError:
            continue
        if setup != setups.get(str(path), ""):
            path.unlink()
            removed += 1
    if not removed:
        return None
    return f"{folder}: removed estimates of another configuration, in {removed} file(s)"
