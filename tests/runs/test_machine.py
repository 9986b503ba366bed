""""""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from paretoik.api.session import open_verb
from paretoik.runs.machine import single_blas_thread


def blas_threads() -> set[int]:
    """Return the threads of NumPy's and SciPy's BLAS; a library that other tests loaded may have only one."""
    libraries = [library for library in threadpool_info() if library["prefix"] == "libscipy_openblas"]
    assert len(libraries) == 2
    return {library["num_threads"] for library in libraries}


@pytest.fixture(autouse=True)
def three_threads():
    with threadpool_limits(limits=3, user_api="blas"):
        yield


def test_a_context_in_another_thread_leaves_the_number_to_the_first():
    def compute() -> None:
        with single_blas_thread():
            assert blas_threads() == {1}

    with single_blas_thread(), ThreadPoolExecutor() as pool:
        pool.submit(compute).result()
        assert blas_threads() == {1}
    assert blas_threads() == {3}


def test_a_verb_computes_with_one_thread():
    with open_verb(False):
        assert blas_threads() == {1}
    assert blas_threads() == {3}
