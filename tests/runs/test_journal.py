"""A journal has all intact frames, wherever its file was cut or damaged; nothing in it is executed."""

from __future__ import annotations

import os

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from paretoik.errors import InvalidInput, InvalidRun
from paretoik.runs.journal import (
    HEAD,
    MARK,
    Journal,
    is_journalled,
    journalled,
    key_of,
    recalled,
    remembered,
)
from paretoik.stop_flag import STOP

ENTRIES = {
    key_of("generation", 1): {"F": np.arange(6.0).reshape(3, 2), "causes": np.array(["", "division by zero", "ü"])},
    key_of("generation", 2): {"F": np.full((0, 2), np.nan), "status": np.array(3), "rows": np.array([1, 2])},
    key_of("minimum", "x"): {},
}


STEP = 7  # bytes, fewer than in any field of a frame: each is cut and damaged


def same(a: dict[str, np.ndarray], b: dict[str, np.ndarray]) -> bool:
    return a.keys() == b.keys() and all(
        a[name].dtype == np.asarray(b[name]).dtype
        and a[name].shape == np.shape(b[name])
        and np.array_equal(a[name], b[name], equal_nan=a[name].dtype.kind == "f")
        for name in a
    )


@pytest.fixture
def file(tmp_path):
    """A journal with all entries."""
    journal = Journal(tmp_path / "checkpoint" / "journal")
    for key, values in ENTRIES.items():
        journal.append(key, values)
    journal.close()
    return tmp_path / "checkpoint" / "journal"


def ends(content: bytes) -> list[int]:
    """Return where frames end, first 0."""
    places = [0]
    while places[-1] < len(content):
        places.append(places[-1] + HEAD.size + HEAD.unpack_from(content, places[-1])[2])
    return places


def test_what_was_appended_is_there_again_type_and_shape_and_bits(file):
    journal = Journal(file)
    assert all(same(journal.get(key), values) for key, values in ENTRIES.items())
    assert journal.get(key_of("generation", 3)) is None
    journal.close()


def test_a_journal_that_is_cut_anywhere_keeps_its_whole_frames_and_continues(file, tmp_path, monkeypatch):
    monkeypatch.setattr(os, "fsync", lambda _: None)
    content, keys = file.read_bytes(), list(ENTRIES)
    places = ends(content)
    for length in {*range(0, len(content) + 1, STEP), *places, *(place - 1 for place in places[1:])}:
        cut = tmp_path / "cut"
        cut.write_bytes(content[:length])
        journal = Journal(cut)
        whole = sum(length >= place for place in places[1:])
        assert [key for key in keys if journal.get(key) is not None] == keys[:whole]
        assert all(same(journal.get(key), ENTRIES[key]) for key in keys[:whole])
        for key in keys[whole:]:
            journal.append(key, ENTRIES[key])
        journal.close()
        assert cut.read_bytes() == content


@pytest.mark.filterwarnings("ignore:.*are damaged")
def test_a_flipped_bit_costs_its_own_frame_and_no_other(file, tmp_path, monkeypatch):
    monkeypatch.setattr(os, "fsync", lambda _: None)
    content, keys, rng = file.read_bytes(), list(ENTRIES), np.random.default_rng(0)
    places = ends(content)
    for byte in range(0, len(content), STEP):
        damaged = bytearray(content)
        damaged[byte] ^= 1 << int(rng.integers(8))
        (tmp_path / "damaged").write_bytes(damaged)
        hit = sum(byte >= place for place in places) - 1
        journal = Journal(tmp_path / "damaged")
        for i, key in enumerate(keys):
            assert journal.get(key) is None if i == hit else same(journal.get(key), ENTRIES[key])
        journal.append(keys[hit], ENTRIES[keys[hit]])
        journal.close()
        journal = Journal(tmp_path / "damaged")
        assert all(same(journal.get(key), values) for key, values in ENTRIES.items())
        journal.close()


@given(
    arrays(st.sampled_from([np.float64, np.int64, np.bool_, np.uint8]), array_shapes(min_dims=0, min_side=0)),
    st.text(st.characters(exclude_characters="\0", exclude_categories=["Cs"])),
)
def test_any_plain_array_comes_back(tmp_path_factory, array, text):
    journal = Journal(tmp_path_factory.mktemp("journal") / "journal")
    values = {"array": array, "text": np.array(text, dtype=np.str_)}
    journal.append(key_of("any"), values)
    stored = journal.get(key_of("any"))
    assert stored["array"].tobytes() == array.tobytes()
    assert (stored["array"].shape, stored["array"].dtype) == (array.shape, array.dtype)
    assert stored["text"].item() == text
    journal.close()


def test_a_frame_that_claims_more_than_there_is_takes_no_memory(file):
    with file.open("ab") as sink:
        sink.write(HEAD.pack(MARK, bytes(32), 2**62, bytes(32)) + b"short")
    journal = Journal(file)
    assert all(same(journal.get(key), values) for key, values in ENTRIES.items())
    journal.close()


def test_another_file_is_refused(tmp_path):
    (tmp_path / "other").write_bytes(b"something else altogether")
    with pytest.raises(InvalidRun, match="must be the journal of a run, got something else"):
        Journal(tmp_path / "other")
    (tmp_path / "folder").mkdir()
    with pytest.raises(InvalidInput, match="must be writable"):
        Journal(tmp_path / "folder")


def test_what_is_remembered_is_computed_once_and_without_a_journal_every_time(tmp_path):
    calls = []

    def compute():
        calls.append(len(calls))
        return {"n": np.array(len(calls))}

    key = key_of("number", 1)
    assert not is_journalled()
    assert [remembered(key, compute)["n"].item() for _ in range(2)] == [1, 2]
    for _ in range(2):
        with journalled(tmp_path / "journal"):
            assert is_journalled()
            assert [remembered(key, compute)["n"].item() for _ in range(2)] == [3, 3]
            assert recalled(key_of("number", 2)) is None
            with journalled(tmp_path / "other") as inner:
                assert inner is None
    assert not (tmp_path / "other").exists()
    assert remembered(None, compute)["n"].item() == 4


def test_what_a_signal_may_have_cut_short_is_not_remembered(tmp_path):
    def compute():
        STOP[0] = 2
        return {"n": np.array(1)}

    try:
        with journalled(tmp_path / "journal"):
            remembered(key_of("number"), compute)
            STOP[0] = 0
            assert recalled(key_of("number")) is None
    finally:
        STOP[0] = 0


def test_on_a_full_disk_a_warning_says_so_once_and_what_was_whole_stays(file, monkeypatch):
    content, journal = file.read_bytes(), Journal(file)
    write = os.pwrite

    def full(descriptor, data, offset):
        write(descriptor, data[:10], offset)
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "pwrite", full)
    with pytest.warns(RuntimeWarning, match="cannot be resumed from here on: No space left on device"):
        journal.append(key_of("more"), {"n": np.array(1)})
    monkeypatch.setattr(os, "pwrite", write)
    journal.append(key_of("more"), {"n": np.array(1)})
    journal.close()
    assert file.read_bytes() == content


def test_keys_differ_with_kind_type_shape_bits_and_text():
    x = np.arange(4.0)
    keys = [
        key_of("a", x),
        key_of("b", x),
        key_of("a", x.reshape(2, 2)),
        key_of("a", x.astype(int)),
        key_of("a", -0.0 * x),
        key_of("a", 0.0 * x),
        key_of("a", "x"),
        key_of("a", "x", "y"),
        key_of("a", ("x", "y")),
        key_of("a"),
    ]
    assert len(set(keys)) == len(keys)
    assert key_of("a", np.asfortranarray(np.ones((2, 3)))) == key_of("a", np.ones((2, 3)))
