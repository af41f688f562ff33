"""What an earlier run left in the folder of a study, looked at before a new one starts.

Snakemake goes by time stamps and by its own records. It sees no file that was damaged and kept its
time, and where its records are gone, no other configuration either.
"""

from __future__ import annotations

import os
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from accelstudy.errors import InputError
from accelstudy.parquet import read_row_groups
from accelstudy.study.tables import LIBRARIES, REMEDY, origin, read_origin
from accelstudy.wording import joined

READ_AT_START = 1_000_000_000
"""Bytes of estimates up to which all of them are read at the start, in seconds; of more, the ends
are, and the rest is checked when it is used."""
LISTED = 10
"""Files that a line names."""
LOCKS = Path(".snakemake/locks")

_ENDS = {".png": b"IEND\xaeB`\x82", ".svg": b"</svg>", ".html": b"</html>"}
_SOFTWARE = {"version": "accelstudy", "commit": "commit", **{name: name for name in LIBRARIES}}


def earlier_run(
    results: str, outputs: Sequence[str], setups: Mapping[str, str], seed: int
) -> Iterator[str]:
    """Give lines on what a person should know of an earlier run before the next one starts.

    Parameters
    ----------
    results : folder of the study
    outputs : paths of all that the study makes; they need not be there
    setups : digest of the set-up by path, of the estimates (`accelstudy.study.job.setup_digest`)
    seed : int

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
    origins = _origins([path for path in outputs if Path(path).is_file()], setups)
    for path in sorted(map(str, Path(results, "estimates").glob("*.parquet"))):
        with suppress(InputError):  # what has no origin is a user's
            origins.setdefault(path, read_origin(path))
    kept = "What this run does not make anew stays; `make anew`, or --forceall, makes all anew."
    other = [
        path
        for path, made in origins.items()
        if (made["seed"], made.get("setup")) != (seed, setups.get(path))
    ]
    if other:
        yield (
            f"{results}: {len(other)} of {len(origins)} tables are of another configuration: "
            f"{_named(other)}. {kept}"
        )
    if changed := _other_software(origins.values()):
        yield f"{results}: has tables made by {joined(changed)}. {kept}"


def _locked(results: str) -> bool:
    return any(
        line.startswith(f"{results}/")
        for path in LOCKS.glob("*.lock")
        for line in path.read_text(encoding="utf-8", errors="replace").splitlines()
    )


def _other_software(origins: Iterable[Mapping[str, Any]]) -> list[str]:
    """Return names and versions that are not those of now."""
    now = origin({})
    changed = []
    for key, name in _SOFTWARE.items():
        before = {_brief(made.get(key)) for made in origins} - {_brief(now[key])}
        if before:
            changed.append(f"{name} {joined(sorted(before))} (now {_brief(now[key])})")
    return changed


def _brief(value: object) -> str:
    """Version or beginning of a commit; `+` marks uncommitted changes."""
    text = "none" if value is None else str(value)
    return text[:7] + ("+" if text.endswith("+") else "") if len(text) >= 40 else text


def _origins(paths: Sequence[str], estimates: Container[str]) -> dict[str, dict[str, Any]]:
    """Check that files are as they were written; where the tables among them come from."""
    size = sum(Path(path).stat().st_size for path in paths if path in estimates)
    origins = {}
    damaged = {}
    for path in paths:
        try:
            if path.endswith(".parquet"):
                origins[path] = read_origin(path)
                if size <= READ_AT_START or path not in estimates:
                    for _ in read_row_groups(path, REMEDY):
                        pass
            else:
                _check_end(Path(path))
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


def _check_end(path: Path) -> None:
    """Check that a picture or a page does not end early."""
    with path.open("rb") as file:
        file.seek(max(0, file.seek(0, os.SEEK_END) - 100))
        if not file.read().rstrip().endswith(_ENDS[path.suffix]):
            raise InputError(f"{path}: is not whole; {REMEDY}")


def remove_foreign(
    folder: str | Path, setups: Mapping[str, str], to_make: Container[str]
) -> str | None:
    """Remove estimates that are not of the study as it is configured; a line if there were any.

    Who reads the whole folder would get them too. What has no origin is not ours and stays. So does
    a file of this study that is not in `to_make`, what the run makes: the job that reads it says
    what to do.
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
