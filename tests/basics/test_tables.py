"""Tables of a study: a file that is not as it was written is refused, and never read in part."""

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from study_helpers import PROVENANCE

from accelstudy.basics.errors import InputError
from accelstudy.files.tables import parquet_writer, read_origin, read_table, write_table

TABLE = pd.DataFrame(
    {"cell": ["a", "b"] * 500, "value": np.random.default_rng(1).normal(size=1000)}
)


def write_at_once(path):
    write_table(path, TABLE, PROVENANCE)


def write_in_groups(path):
    content = pa.Table.from_pandas(TABLE, preserve_index=False)
    with parquet_writer(path, content.schema, PROVENANCE, measured=["value"]) as write:
        write(content[:300])
        write(content[300:])


@pytest.mark.parametrize("write", [write_at_once, write_in_groups])
def test_a_flipped_bit_is_refused(write, tmp_path):
    path = tmp_path / "table.parquet"
    write(path)
    pd.testing.assert_frame_equal(read_table(path), TABLE)
    whole = path.read_bytes()
    column = pq.read_metadata(path).row_group(0).column(1)
    start = column.dictionary_page_offset or column.data_page_offset
    damaged = bytearray(whole)
    damaged[start + column.total_compressed_size // 2] ^= 1
    path.write_bytes(damaged)
    assert read_origin(path)["seed"] == 1  # the end of the file, with what it is, is whole
    with pytest.raises(InputError, match=r"^[^\n]*table.parquet: not a whole Parquet file ") as e:
        read_table(path)
    assert str(e.value).endswith("; delete it and run again")


@pytest.mark.parametrize("size", [0, 3, 4000, -1])
def test_a_truncated_file_is_refused(size, tmp_path):
    path = tmp_path / "table.parquet"
    write_at_once(path)
    path.write_bytes(path.read_bytes()[:size])
    for read in (read_table, read_origin):
        with pytest.raises(
            InputError, match=r"table.parquet: not a whole Parquet file [^\n]*again$"
        ):
            read(path)


@pytest.mark.parametrize("said", [b"[", b"[]", b"\xff", b'{"seed": 1}'])
def test_a_table_with_another_origin_is_no_table_of_a_study(tmp_path, said):
    """Such as one of another program."""
    path = tmp_path / "table.parquet"
    content = pa.Table.from_pandas(TABLE).replace_schema_metadata({b"accelstudy": said})
    pq.write_table(content, path)
    with pytest.raises(InputError, match=r"^[^\n]*table.parquet: [^\n]*$"):
        read_origin(path)
