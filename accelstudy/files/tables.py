"""Parquet files with their provenance in the metadata, written whole or not at all."""

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
from accelstudy.files.parquet import whole_parquet, write_parquet

if (
    TYPE_CHECKING
):  # otherwise imported where it is needed: it is slow, and jobs that simulate do not need it
    import pandas as pd

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
        **plugins.provenance(),
    }


@cache
def _version(name: str) -> str | None:
    """Version of an installed library; None if it is not installed."""
    try:
        return version(name)
    except PackageNotFoundError:
        return None


@contextmanager
def parquet_writer(
    path: str | Path,
    schema: pa.Schema,
    provenance: Mapping[str, Any],
    measured: Sequence[str] = (),
) -> Iterator[Callable[[pa.Table], None]]:
    """Write tables of one schema into one file, a row group each.

    `measured` names columns of floats that hardly repeat. They are packed byte by byte, which is
    smaller and faster than a search for repetitions. Of numbers that count up the steps are stored,
    and other floats stay as they are.
    """
    counting = [f.name for f in schema if pa.types.is_int64(f.type)]
    floats = [f.name for f in schema if pa.types.is_floating(f.type)]
    metadata = {METADATA_KEY: json.dumps(origin(provenance)).encode()}
    with (
        whole_file(path) as temporary,
        pq.ParquetWriter(
            temporary,
            schema.with_metadata(metadata),
            write_page_checksum=True,
            compression="lz4",
            use_dictionary=[name for name in schema.names if name not in (*counting, *floats)],
            column_encoding=dict.fromkeys(counting, "DELTA_BINARY_PACKED"),
            use_byte_stream_split=list(measured),
        ) as writer,
    ):
        yield writer.write_table


def write_table(path: str | Path, table: pd.DataFrame, provenance: Mapping[str, Any]) -> None:
    """Write a table with its origin."""
    content = pa.Table.from_pandas(table, preserve_index=False)
    metadata = {**(content.schema.metadata or {}), METADATA_KEY: json.dumps(origin(provenance))}
    with whole_file(path) as temporary:
        write_parquet(temporary, content.replace_schema_metadata(metadata), compression="zstd")


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
        paths = tables_in(path)
        if not paths:
            raise InputError(f"{path}: holds no tables")
        return read_table(paths, columns)
    with whole_parquet(path, REMEDY) as file:
        return file.read(columns).to_pandas()


def tables_in(folder: Path) -> list[Path]:
    """Tables in a folder and the folders below it, without those that are being written."""
    paths = {path.relative_to(folder): path for path in folder.rglob("*.parquet")}
    return [paths[name] for name in sorted(paths) if not any(p[0] == "." for p in name.parts)]


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
    with whole_parquet(path, REMEDY) as file:
        origin_of_file = json.loads((file.schema_arrow.metadata or {}).get(METADATA_KEY, b"{}"))
    if not isinstance(origin_of_file, dict) or not {"config_hash", "seed"} <= origin_of_file.keys():
        raise InputError(f"{path}: does not say where it comes from; it is no table of a study")
    return origin_of_file
