"""Parquet files: written whole or not at all, with their origin, and refused if damaged."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pyarrow as pa
import pyarrow.parquet as pq

from accelstudy import __version__
from accelstudy.basics import plugins
from accelstudy.basics.errors import InputError
from accelstudy.files.outputs import whole_file
from accelstudy.files.reading import readable

if TYPE_CHECKING:
    import pandas as pd  # slow, and jobs that simulate do not need it

METADATA_KEY = b"accelstudy"

REMEDY = "delete it and run again"
"""What to do with a damaged file. Snakemake then makes it anew."""

LIBRARIES = ("numpy", "scipy", "llvmlite")
"""Libraries whose versions may change the last bits of the numbers."""


@cache
def git_commit() -> str:
    """Commit of the checkout that the package runs from; `+` marks uncommitted changes.

    An installed package may lie within a repository that has nothing to do with it, as in the
    environment of a project; it is of that repository only if its files are.
    """
    package = Path(__file__).parents[1]

    def git(*arguments: str) -> str:
        command = ["git", "-C", str(package), *arguments]
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()

    try:
        git("ls-files", "--error-unmatch", __file__)
        # A lock would stay behind if this process is killed, and stop every commit.
        changed = git("--no-optional-locks", "status", "--porcelain", "--untracked-files=no", ".")
        return git("rev-parse", "HEAD") + ("+" if changed else "")
    except (OSError, subprocess.CalledProcessError):
        return "unknown"


def origin(provenance: Mapping[str, Any]) -> dict[str, Any]:
    """Provenance that is written into each file.

    `provenance` holds `config_hash` and `seed`. Commit and versions of what numbers depend on are
    added, and digests of the plug-ins that there are.
    """
    return {
        **provenance,
        "version": __version__,
        "commit": git_commit(),
        **{name: _version(name) for name in LIBRARIES},
        **({"plugins": found} if (found := plugins.digests()) else {}),
    }


@cache
def _version(name: str) -> str | None:
    """Version of an installed library; None if it is not installed."""
    try:
        return version(name)
    except PackageNotFoundError:
        return None


def write_table(
    path: str | Path, table: pd.DataFrame | pa.Table, provenance: Mapping[str, Any] | None = None
) -> None:
    """Write a table without its index, with its `origin` where a provenance is given."""
    if not isinstance(table, pa.Table):
        table = pa.Table.from_pandas(table, preserve_index=False)
    with table_writer(path, table.schema, provenance) as write:
        write(table)


@contextmanager
def table_writer(
    path: str | Path, schema: pa.Schema, provenance: Mapping[str, Any] | None = None
) -> Iterator[Callable[[pa.Table], None]]:
    """Write tables of one schema into one file, a row group each, with checksums of the pages."""
    # Numbers that repeat are not looked for, nor packed as tightly as could be: that takes longer
    # than all else that is done to write them, and saves a seventh of the space. Nor are the least
    # and the largest of numbers by which nobody selects rows.
    words = [field.name for field in schema if not pa.types.is_primitive(field.type)]
    if provenance is not None:
        metadata = {METADATA_KEY: json.dumps(origin(provenance))}
        schema = schema.with_metadata({**(schema.metadata or {}), **metadata})
    keys = [field.name for field in schema if not pa.types.is_floating(field.type)]
    checked = {"write_page_checksum": True, "compression": "lz4", "use_dictionary": words}
    checked |= {"write_statistics": keys}
    with whole_file(path) as file, pq.ParquetWriter(file, schema, **checked) as writer:
        yield writer.write_table


@contextmanager
def open_parquet(path: str | Path, remedy: str = "") -> Iterator[pq.ParquetFile]:
    """Open a file whose pages are verified when they are read.

    Raises
    ------
    InputError
        If the file is missing, is no whole Parquet file, or a page is not what was written; the
        message ends with the remedy.
    """
    try:
        with readable(path):
            with Path(path).open("rb") as file:  # Arrow's errors do not say that it is the disk
                file.read(1)
            with pq.ParquetFile(path, page_checksum_verification=True) as file:
                yield file
    except InputError:
        raise
    except (pa.ArrowException, OSError, ValueError, LookupError, OverflowError) as error:
        reason = (str(error).splitlines() or [type(error).__name__])[0][:100]
        end = f"; {remedy}" if remedy else ""
        raise InputError(f"{path}: not a whole Parquet file ({reason}){end}") from None


def read_table(
    path: str | Path | Sequence[str | Path],
    columns: Sequence[str] | None = None,
) -> pd.DataFrame:
    """Read a table from a file, a folder of files, or several files.

    Parameters
    ----------
    path : path or several
    columns : names; by default all

    Raises
    ------
    InputError
        If a file is missing, or is not whole as it was written, or files were made with different
        seeds.
    """
    import pandas as pd

    if not isinstance(path, str | Path):
        _check_seeds(path)
        return pd.concat([read_table(each, columns) for each in path], ignore_index=True)
    path = Path(path)
    if path.is_dir():
        found = {each.relative_to(path): each for each in path.rglob("*.parquet")}
        names = [name for name in sorted(found) if not any(part[0] == "." for part in name.parts)]
        if not names:  # what is being written is in folders whose names begin with a dot
            raise InputError(f"{path}: holds no tables")
        return read_table([found[name] for name in names], columns)
    with open_parquet(path, REMEDY) as file:
        return file.read(columns).to_pandas()


def _check_seeds(paths: Iterable[str | Path]) -> None:
    """Check that files belong to one study: an earlier configuration may have left some."""
    seeds: dict[Any, str | Path] = {}
    for path in paths:
        seeds.setdefault(read_origin(path)["seed"], path)
    if len(seeds) > 1:
        (one, first), (other, second) = list(seeds.items())[:2]
        raise InputError(
            f"{first} is of seed {one}, and {second} of seed {other}; delete what is not of your "
            "study, and run it again"
        )


def read_origin(path: str | Path) -> dict[str, Any]:
    """Origin of a file: config hash, seed, and the software that made it; see `origin`.

    Raises
    ------
    InputError
        If the file is missing, is not whole, or was not written by this package.
    """
    with open_parquet(path, REMEDY) as file:
        origin_of_file = json.loads((file.schema_arrow.metadata or {}).get(METADATA_KEY, b"{}"))
    if not isinstance(origin_of_file, dict) or not {"config_hash", "seed"} <= origin_of_file.keys():
        raise InputError(f"{path}: does not say where it comes from; it is no table of a study")
    return origin_of_file
