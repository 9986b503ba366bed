"""Files of little that declare much are refused before anything is unpacked."""

from __future__ import annotations

import io
import zipfile

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from paretoik.runs.files import ARRAY_OPTIONS as OPTIONS
from paretoik.runs.files import read_arrays, read_table


def archive(entries, compression=zipfile.ZIP_STORED):
    sink = io.BytesIO()
    with zipfile.ZipFile(sink, "w", compression) as file:
        for name, content in entries.items():
            file.writestr(name, content)
    return sink.getvalue()


def header(shape, kind="<f8"):
    sink = io.BytesIO()
    np.lib.format.write_array_header_1_0(sink, {"descr": kind, "fortran_order": False, "shape": shape})
    return sink.getvalue()


@pytest.mark.parametrize("dtype", [float, np.int64, "U7"])
def test_arrays_come_back_as_they_were(dtype):
    arrays = {"a": np.zeros((3, 0), dtype), "b": np.ones((2, 3), dtype)}
    sink = io.BytesIO()
    np.savez(sink, **arrays)
    read = read_arrays(sink.getvalue())
    assert read.keys() == arrays.keys()
    assert all(np.array_equal(read[name], arrays[name]) and read[name].dtype == arrays[name].dtype for name in arrays)


@pytest.mark.parametrize(
    "content",
    [
        archive({"q.npy": header((10**7,)) + bytes(8 * 10**7)}, zipfile.ZIP_DEFLATED),
        archive({"q.npy": header((2**40,))}),
        archive({"q.npy": header((2**60,), "<U1000")}),
        archive({"q.npy": header((3,)) + bytes(8)}),
    ],
)
def test_an_archive_that_declares_more_than_it_has_is_refused(content):
    assert len(content) < 10**6
    with pytest.raises(ValueError, match=r"q\.npy that declares \d+ bytes"):
        read_arrays(content)


def test_a_table_that_declares_more_than_any_run_has_is_refused():
    sink = io.BytesIO()
    zeros = pa.chunked_array([pa.array(np.zeros(1000, dtype=np.int8))] * (OPTIONS.most_rows // 1000 + 1))
    pq.write_table(pa.table({"id": zeros}), sink)
    assert len(sink.getvalue()) < 10**6
    with pytest.raises(ValueError, match=r"a table that declares \d+ rows"):
        read_table(sink.getvalue())
    sink = io.BytesIO()
    pq.write_table(pa.table({"id": [1, 2]}), sink)
    assert read_table(sink.getvalue())["id"].to_pylist() == [1, 2]
