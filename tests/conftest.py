from __future__ import annotations

import os
import signal
from collections.abc import Iterator

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):  # tests share the cores: a thread each, and before NumPy comes
    os.environ.setdefault(name, "1")

from pathlib import Path

import hypothesis
import jaxtyping
import pytest

import paretoik.capability.actuator_kernels
import paretoik.capability.planar_maxima
import paretoik.closed_loop.open_loop_kernels
import paretoik.closed_loop.step_search_kernels
import paretoik.nlp.banded.interior_point  # before the hook: numba compiles functions, not wrappers
import paretoik.nlp.dense.dense_kernel
import paretoik.nlp.parametric_qp.predictor_corrector
import paretoik.resolution.horizon_newton
import paretoik.resolution.step_kernels
import paretoik.robot.components  # before the hook: sums and products, millions of them, without shapes
import paretoik.task.retraction_kernel
import paretoik.trajectory.motion_kernel  # noqa: F401  before the hook, as all that is compiled
import tests.shape_checks

# In production nobody looks at annotations; in tests calls and fields are held against them.
tests.shape_checks.install("paretoik")

hypothesis.settings.register_profile("local", deadline=None, max_examples=30)
hypothesis.settings.register_profile("ci", deadline=None, max_examples=30, derandomize=True, print_blob=True)
hypothesis.settings.load_profile("ci" if os.environ.get("CI") else "local")


def pytest_configure() -> None:
    """Let Ctrl-C raise as usual: a shell's background jobs begin with SIGINT ignored."""
    signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_runtest_setup() -> None:
    tests.shape_checks.restart()


SLOW_TESTS = frozenset((Path(__file__).parent / "slow_tests.txt").read_text(encoding="utf-8").splitlines())


@pytest.hookimpl(tryfirst=True)  # before pytest selects by markers
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark the cases, tests and files that the default run leaves out, because they take seconds each."""
    for item in items:
        if SLOW_TESTS & {item.nodeid, item.nodeid.partition("[")[0], item.nodeid.partition("::")[0]}:
            item.add_marker(pytest.mark.slow)


@pytest.fixture
def unchecked() -> Iterator[None]:
    """Leave shapes and types to the library's own checks, as in production."""
    before = jaxtyping.config.jaxtyping_disable
    jaxtyping.config.update("jaxtyping_disable", True)
    yield
    jaxtyping.config.update("jaxtyping_disable", before)
