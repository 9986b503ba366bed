"""Room for a result: held before anything is computed, there when the disk is full, refused where there is none."""

import errno
import os
import subprocess
import sys
from pathlib import Path

import pytest

from paretoik.errors import InvalidInput
from paretoik.runs import folder as reserved_space
from paretoik.runs.folder import OPTIONS, ReservedSpace
from studies.benchmarks.reliability.full_disk import namespaces_can_mount

ROOT = Path(__file__).parents[2]


def test_room_is_on_the_disk_until_it_is_left(tmp_path):
    file = tmp_path / "checkpoint" / "reserve"
    room = ReservedSpace(file)
    assert file.stat().st_size == OPTIONS.bytes
    assert file.stat().st_blocks * 512 >= OPTIONS.bytes
    room.release()
    room.release()
    assert not file.exists()
    room.take()
    assert file.stat().st_size == OPTIONS.bytes


def test_a_link_in_its_place_is_not_followed_and_nothing_is_held(tmp_path):
    (tmp_path / "precious").write_bytes(b"mine")
    (tmp_path / "reserve").symlink_to(tmp_path / "precious")
    ReservedSpace(tmp_path / "reserve").release()
    assert (tmp_path / "precious").read_bytes() == b"mine"
    assert not (tmp_path / "reserve").is_symlink()


def test_a_disk_without_room_is_refused_and_nothing_stays_on_it(tmp_path, monkeypatch):
    def fail(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "posix_fallocate", fail)
    words = r"8 MB of free disk wanted, so that its result has room, got [\d.e+]+ MB"
    with pytest.raises(InvalidInput, match=words):
        ReservedSpace(tmp_path / "checkpoint" / "reserve")
    assert list(tmp_path.iterdir()) == []


def test_where_files_may_not_be_as_large_nothing_is_held(tmp_path, monkeypatch):
    def fail(*_):
        raise OSError(errno.EFBIG, "File too large")

    monkeypatch.setattr(reserved_space.os, "posix_fallocate", fail)
    ReservedSpace(tmp_path / "reserve")
    assert list(tmp_path.iterdir()) == []


FILLED = """
import os
import sys
from pathlib import Path
import paretoik as pk
from tests.search.problems import Parabolas

disk = Path(sys.argv[1])

def fill(progress):
    if progress.stage == "generation" and progress.done == 2:
        try:
            with (disk / "else").open("wb", buffering=0) as file:
                while True:
                    file.write(bytes(4096))
        except OSError:
            print(os.statvfs(disk).f_bavail)

pk.solve(Parabolas(), population=12, generations=6, seed=1, out=disk / "run", observe=fill)
front = pk.load_front(disk / "run")
print(front.provenance["status"], front.provenance["counts"]["generations"], len(front) > 0)
"""


@pytest.mark.skipif(not namespaces_can_mount(), reason="a system whose users may mount file systems in a namespace")
def test_the_result_is_saved_although_the_disk_was_filled_from_elsewhere(tmp_path):
    mount = 'mount -t tmpfs -o size=20M tmpfs "$0" && exec "$@" "$0"'
    command = ["unshare", "--map-root-user", "--mount", "sh", "-c", mount, str(tmp_path), sys.executable, "-c", FILLED]
    ended = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=60, check=False)
    assert (ended.returncode, ended.stdout) == (0, "0\ngenerations 6 True\n"), ended.stderr
