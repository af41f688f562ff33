"""Tables of a study: a file that is not as it was written is refused, and never read in part."""

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from calling import refused
from study_helpers import PROVENANCE

from accelstudy.files.tables import read_origin, read_table, table_writer, write_table

TABLE = pd.DataFrame(
    {"cell": ["a", "b"] * 500, "value": np.random.default_rng(1).normal(size=1000)}
)


def write_at_once(path):
    write_table(path, TABLE, PROVENANCE)


def write_in_groups(path):
    content = pa.Table.from_pandas(TABLE, preserve_index=False)
    with table_writer(path, content.schema, PROVENANCE) as write:
        write(content[:300])
        write(content[300:])


@pytest.mark.parametrize("write", [write_at_once, write_in_groups])
@pytest.mark.parametrize("size", [None, 0, 3, 4000, -1])
def test_a_file_that_is_cut_or_has_a_flipped_bit_is_refused(write, tmp_path, size):
    path = tmp_path / "table.parquet"
    write(path)
    pd.testing.assert_frame_equal(read_table(path), TABLE)
    damaged, readers = bytearray(path.read_bytes()[:size]), [read_table, read_origin]
    if size is None:
        column = pq.read_metadata(path).row_group(0).column(1)
        start = column.dictionary_page_offset or column.data_page_offset
        damaged[start + column.total_compressed_size // 2] ^= 1
    path.write_bytes(damaged)
    if size is None:
        assert readers.pop()(path)["seed"] == 1  # the end of the file, with what it is, is whole
    for read in readers:
        with refused("; delete it and run again", start=f"{path}: not a whole Parquet file "):
            read(path)


@pytest.mark.parametrize("said", [b"[", b"[]", b"\xff", b'{"seed": 1}'])
def test_a_table_with_another_origin_is_no_table_of_a_study(tmp_path, said):
    """Such as one of another program."""
    path = tmp_path / "table.parquet"
    content = pa.Table.from_pandas(TABLE).replace_schema_metadata({b"accelstudy": said})
    pq.write_table(content, path)
    with refused(start=f"{path}: "):
        read_origin(path)
