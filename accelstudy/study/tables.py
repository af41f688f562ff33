"""Parquet files with their origin in the metadata, written whole or not at all."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from accelstudy import __version__
from accelstudy.errors import InputError
from accelstudy.outputs import whole_file

METADATA_KEY = b"accelstudy"

TABLES = ("cells", "summary", "correlations", "leveling")
"""Tables that each batch of cells contributes to."""


@cache
def git_commit() -> str:
    """Commit of the checkout that the package runs from; `+` marks uncommitted changes."""
    folder = Path(__file__).parent

    def git(*arguments: str) -> str:
        command = ["git", "-C", str(folder), *arguments]
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()

    try:
        changed = git("status", "--porcelain", "--untracked-files=no", ".")
        return git("rev-parse", "HEAD") + ("+" if changed else "")
    except (OSError, subprocess.CalledProcessError):
        return "unknown"


def origin(provenance: Mapping[str, Any]) -> dict[str, Any]:
    """What is written into each file: where its numbers come from.

    `provenance` holds `config_hash` and `seed`; version and commit are added.
    """
    return {
        "config_hash": provenance["config_hash"],
        "seed": provenance["seed"],
        "version": __version__,
        "commit": git_commit(),
    }


@contextmanager
def parquet_writer(
    path: str | Path,
    schema: pa.Schema,
    provenance: Mapping[str, Any],
    measured: Sequence[str] = (),
) -> Iterator[Callable[[pa.Table], None]]:
    """Write tables of one schema into one file, a row group each.

    `measured` names columns of floats that hardly repeat; they are packed byte by byte, which is
    smaller and faster than looking for repetition.
    """
    metadata = {METADATA_KEY: json.dumps(origin(provenance)).encode()}
    with (
        whole_file(path) as temporary,
        pq.ParquetWriter(
            temporary,
            schema.with_metadata(metadata),
            compression="zstd",
            use_dictionary=[name for name in schema.names if name not in measured],
            use_byte_stream_split=list(measured),
        ) as writer,
    ):
        yield writer.write_table


def write_table(path: str | Path, table: pd.DataFrame, provenance: Mapping[str, Any]) -> None:
    """Write a table with its origin."""
    content = pa.Table.from_pandas(table, preserve_index=False)
    metadata = {**(content.schema.metadata or {}), METADATA_KEY: json.dumps(origin(provenance))}
    with whole_file(path) as temporary:
        pq.write_table(content.replace_schema_metadata(metadata), temporary, compression="zstd")


def read_table(path: str | Path | Sequence[str | Path], **options: Any) -> pd.DataFrame:
    """Read a table from a file, a folder of files, or several files.

    Raises
    ------
    InputError
        If the file is missing, or is no whole Parquet file.
    """
    if not isinstance(path, str | Path):
        return pd.concat([read_table(each, **options) for each in path], ignore_index=True)
    path = Path(path)
    if path.is_dir():
        return read_table(sorted(path.glob("*.parquet")), **options)
    try:
        return pq.read_table(path, partitioning=None, **options).to_pandas()
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except (pa.ArrowInvalid, OSError) as error:
        reason = str(error).splitlines()[0]
        raise InputError(
            f"{path}: not a whole Parquet file ({reason}); delete it and run again"
        ) from None


def collect(parts: Sequence[str | Path], output: str | Path, provenance: Mapping[str, Any]) -> None:
    """Join the parts of a table into one."""
    write_table(output, pd.concat(map(read_table, parts), ignore_index=True), provenance)


def read_origin(path: str | Path) -> dict[str, Any]:
    """Origin of a file: config hash, seed, package version and commit."""
    return json.loads(pq.read_schema(path).metadata[METADATA_KEY])


def read_estimates(
    path: str | Path | Sequence[str | Path], cells: str | Sequence[str] | None = None
) -> pd.DataFrame:
    """Estimates, with what follows from the stored columns.

    Parameters
    ----------
    path : file, folder of files, or several files
    cells : str or several, optional
        Only these cells.

    Returns
    -------
    DataFrame
        The stored columns, and error, sigma0_squared and sigma_posteriori (NaN without
        redundancy), all in SI.
    """
    names = [cells] if isinstance(cells, str) else cells
    table = read_table(path, filters=None if names is None else [("cell", "in", list(names))])
    table["error"] = table["estimate"] - table["truth"]
    table["sigma0_squared"] = table["omega"] / table["redundancy"].where(table["redundancy"] > 0)
    table["sigma_posteriori"] = table["sigma0_squared"] ** 0.5 * table["sigma_priori"]
    return table
