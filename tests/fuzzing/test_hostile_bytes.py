"""URDF files, run folders and command lines of any bytes: a result, or one line with name, wish and fact."""

from __future__ import annotations

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from studies.benchmarks.reliability.fuzzing.targets import CORPUS, TARGETS, inputs

SEEDS = {name: dict(inputs(name)) for name in TARGETS}
POOL = [b"", b"0", b"-1", b"nan", b"1e309", b"[]", b"{}", b"null", b"\xff", b"\xe2\x82\xac", b"x" * 300, b"../x", b"=x"]
quickly = settings(max_examples=10, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
a_place, a_change = st.floats(0, 1), st.sampled_from(["cut", "flip", "insert", "drop", "replace"])


def changed(data: bytes, place: float, change: str, value: bytes) -> bytes:
    """Return bytes cut, flipped, lengthened or shortened at a place."""
    at = int(place * len(data))
    match change:
        case "cut":
            return data[:at]
        case "flip":
            return data[:at] + bytes(byte ^ 1 for byte in data[at : at + 1]) + data[at + 1 :]
        case "insert":
            return data[:at] + value + data[at:]
        case "drop":
            return data[:at] + data[at + 1 + len(value) :]
        case _:
            return data[:at] + value + data[at + len(value) :]


@pytest.fixture(scope="module")
def targets(tmp_path_factory):
    return {name: make(tmp_path_factory.mktemp(name)) for name, make in TARGETS.items()}


@pytest.mark.parametrize("target", TARGETS)
def test_every_input_of_the_corpus_is_taken_or_refused_in_a_good_line(targets, target):
    for data in SEEDS[target].values():
        targets[target](data)


@pytest.mark.parametrize("target", TARGETS)
@given(data=st.data())
@quickly
def test_inputs_that_are_cut_flipped_or_edited_are_taken_or_refused_in_a_good_line(targets, target, data):
    content = data.draw(st.sampled_from(list(SEEDS[target].values())))
    first = content[:1] if target == "folders" else b""  # says which file it is
    edited = changed(content[len(first) :], data.draw(a_place), data.draw(a_change), data.draw(st.sampled_from(POOL)))
    targets[target](first + edited)


def test_the_corpus_is_small():
    assert sum(len(data) for seeds in SEEDS.values() for data in seeds.values()) < 50_000
    assert CORPUS.is_dir()
