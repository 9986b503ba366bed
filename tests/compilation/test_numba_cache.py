"""Compiled functions: the same from Python and from each other, cached wherever possible, announced when slow."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from paretoik.compilation import numba_cache as compilation
from paretoik.compilation.numba_cache import c_function, carray, compiled
from paretoik.compilation_notices import (
    CompilationNotice,
    begin_compilation,
    end_compilation,
    observe_compilation,
    print_line,
)

ROOT = Path(__file__).parents[2]

KERNELS = """
from paretoik.compilation.numba_cache import compiled

@compiled
def inner(x, flag):
    return 2.0 * x if flag else x

@compiled(what="the outer function", seconds=7.0)
def outer(x):
    return inner(x, True) + inner(x, False)
"""


@compiled
def norm(vector):
    total = 0.0
    for value in vector:
        total += value * value
    return np.sqrt(total)


@compiled
def choose(x, flag):
    return x + 1.0 if flag else x - 1.0


@compiled
def both(vector):
    work = np.empty(2)
    work[0], work[1] = choose(norm(vector), True), choose(norm(vector), False)
    return work


def test_a_function_has_the_same_bits_from_python_and_from_compiled_code():
    vector = np.random.default_rng(0).normal(size=37)
    np.testing.assert_array_equal(both(vector), [norm(vector) + 1.0, norm(vector) - 1.0])


def test_an_exception_of_an_inner_function_reaches_python():
    with pytest.raises(ValueError, match="not positive"):
        outer_of_raising(-1.0)
    assert outer_of_raising(4.0) == 2.0


@compiled
def raising(x):
    if x <= 0:
        raise ValueError("not positive")
    return np.sqrt(x)


@compiled
def outer_of_raising(x):
    return raising(x)


@c_function("void(CPointer(float64), intp)")
def double(pointer, n):
    numbers = carray(pointer, (n,))
    for i in range(n):
        numbers[i] = 2.0 * numbers[i]


@compiled
def doubled(numbers):
    result = numbers.copy()
    double(result.ctypes, len(result))
    return result


def test_a_c_function_is_called_by_its_address():
    np.testing.assert_array_equal(doubled(np.arange(5.0)), 2.0 * np.arange(5.0))


def test_the_fingerprint_of_a_function_has_the_code_and_the_constants_of_what_it_calls():
    def fingerprint(source):
        names: dict[str, object] = {"__name__": __name__}
        path = ROOT / "tests" / "test_compilation.py"  # numba needs a file
        exec(compile(source, str(path), "exec"), names)
        return compilation._fingerprint(names["outer"].py_func)

    before = fingerprint(KERNELS)
    assert fingerprint(KERNELS) == before
    assert fingerprint(KERNELS.replace("2.0 * x", "3.0 * x")) != before
    assert fingerprint(KERNELS.replace("2.0 * x", "x * 2.0")) != before
    assert fingerprint(KERNELS + "\nunrelated = 5\n") == before


def in_a_new_process(folder, code, *, prefix=(), write=True, **variables):
    """Run code next to KERNELS in a new Python process; return (stdout, stderr)."""
    if write:
        (folder / "kernels.py").write_text(KERNELS)
    done = subprocess.run(
        [*prefix, sys.executable, "-B", "-c", code],
        env={**os.environ, "PYTHONPATH": f"{ROOT}{os.pathsep}{folder}", **variables},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout, done.stderr


def test_what_is_compiled_is_announced_once_on_a_machine(tmp_path):
    code, variables = "import kernels; print(kernels.outer(1.5))", {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    (tmp_path / "kernels.py").write_text(KERNELS)
    with ThreadPoolExecutor(2) as pool:  # two processes at once: one compiles, the other waits for it
        runs = [pool.submit(in_a_new_process, tmp_path, code, write=False, **variables) for _ in range(2)]
    announced = "compiling the outer function, once for this copy of paretoik: about 7 s\n"
    assert sorted(run.result() for run in runs) == [("4.5\n", ""), ("4.5\n", announced)]


PAIRED = """
from {module} import Pair
from paretoik.compilation.numba_cache import compiled

@compiled(what="the sum of a pair", seconds=7.0)
def total(pair):
    return pair.first + pair.second

def run():
    return total(Pair(1.0, 2.0))
"""


@pytest.mark.slow
def test_a_cache_with_classes_of_a_module_that_is_gone_is_compiled_anew(tmp_path):
    pair = "from typing import NamedTuple\nclass Pair(NamedTuple):\n    first: float\n    second: float\n"
    code, variables = "import paired; print(paired.run())", {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    expected = ("3.0\n", "compiling the sum of a pair, once for this copy of paretoik: about 7 s\n")
    for module in ("before", "after"):
        for old in tmp_path.glob("*.py"):
            old.unlink()
        (tmp_path / f"{module}.py").write_text(pair)
        (tmp_path / "paired.py").write_text(PAIRED.format(module=module))
        assert in_a_new_process(tmp_path, code, **variables) == expected
        assert in_a_new_process(tmp_path, code, **variables) == ("3.0\n", "")
    for index in (tmp_path / "cache").rglob("*.nbi"):
        index.write_bytes(index.read_bytes()[:-20])
    assert in_a_new_process(tmp_path, code, **variables) == expected


def test_observers_end_with_their_block(capsys):
    seen = []
    with observe_compilation(seen.append):
        begin_compilation(CompilationNotice(what="a", seconds=3.0))
    begin_compilation(CompilationNotice(what="b", seconds=2.0))
    end_compilation()
    assert [notice.what for notice in seen] == ["a"]
    assert capsys.readouterr().err == "compiling b, once for this copy of paretoik: about 2 s\n"
    print_line(CompilationNotice(what="c", seconds=12.4))
    assert capsys.readouterr().err == "compiling c, once for this copy of paretoik: about 12 s\n"


WITHOUT_PRIVILEGES = ["setpriv", "--bounding-set=-all", "--inh-caps=-all"]  # with privileges root may write everywhere


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="permissions of folders are POSIX's")
def test_where_no_cache_folder_can_be_written_a_temporary_one_is_used(tmp_path):
    if os.getuid() == 0 and shutil.which("setpriv") is None:
        pytest.skip("root can write everywhere")
    package, temporary = tmp_path / "package", tmp_path / "temporary"
    package.mkdir()
    temporary.mkdir()
    (package / "kernels.py").write_text(KERNELS)
    package.chmod(0o555)
    code = "import kernels; print(kernels.outer(1.5), kernels.outer._cache.cache_path)"
    variables = {"HOME": str(package), "XDG_CACHE_HOME": str(package), "TMPDIR": str(temporary)}
    prefix = WITHOUT_PRIVILEGES if os.getuid() == 0 else []
    first, second = (in_a_new_process(package, code, prefix=prefix, write=False, **variables) for _ in range(2))
    assert first[0].startswith(f"4.5 {temporary}")
    assert first[1] == "compiling the outer function, once for this copy of paretoik: about 7 s\n"
    assert second == (first[0], "")


def test_a_temporary_folder_of_somebody_else_is_not_trusted(tmp_path, monkeypatch):
    monkeypatch.setattr(compilation.tempfile, "tempdir", str(tmp_path))
    compilation._temporary_folder.cache_clear()
    try:
        own = compilation._temporary_folder()
        assert own.parent == tmp_path
        assert own.stat().st_mode & 0o077 == 0
        own.chmod(0o777)
        compilation._temporary_folder.cache_clear()
        assert compilation._temporary_folder() not in (own, tmp_path)
    finally:
        compilation._temporary_folder.cache_clear()
