"""The side effects of commands, as the system sees them: they write where they say, and talk to nobody.

They write into the run folder, into named outputs, into the temporary folder, /dev and /proc. There are also caches,
all of them outside of the user's work: compiled functions and Python's own byte code in the ``__pycache__`` folders of
the installation (``paretoik.compilation``) and Matplotlib's list of fonts in the user's cache folder, made once on a
machine.
"""

from __future__ import annotations

import json
import os
import shutil
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

import paretoik
from paretoik.runs.files import RUN, run_bytes
from studies.benchmarks.scaling.local_cluster import local_cluster
from tests.cli.commands import MINE, SMALL
from tests.traces import Trace, trace

pytestmark = pytest.mark.slow
SYSTEM = (Path("/dev"), Path("/proc"))
PROGRAMS = {Path(sys.executable).name, "fc-list"}  # Matplotlib asks the latter for fonts, once on a machine
BAIT = "import os; os.mkdir({place!r})\n"  # this folder appears if the code runs
MODULES = ("sitecustomize", "usercustomize", "numpy", "rerun", "matplotlib", "paretoik", "users_own", "pickle", "json")
CODE = (".py", ".pyc", ".pkl", ".pickle", ".pth", ".so", ".nbi", ".nbc")
LATEX = "text.usetex: True\n"
NAMED = "--problem", "users_own.py:good"
FRONT = "import sys, paretoik as pk; front = pk.load_front(sys.argv[1]); print(front.ids, front.motions)"


@dataclass(frozen=True)
class Desk:
    """A user's folders: a project, with a problem and runs, a home, and one for temporary files."""

    top: Path

    def __post_init__(self) -> None:
        for folder in (self.project, self.home, self.temporary):
            folder.mkdir()
        (self.project / "users_own.py").write_text(MINE)

    @property
    def project(self) -> Path:
        return self.top / "project"

    @property
    def home(self) -> Path:
        return self.top / "home"

    @property
    def temporary(self) -> Path:
        return self.top / "temporary"

    @property
    def allowed(self) -> tuple[Path, ...]:
        """Folders that any program may write: for the system, temporary files and caches."""
        installed = [folder / "__pycache__" for folder in Path(paretoik.__file__).parent.rglob("*") if folder.is_dir()]
        fonts = (self.home / ".cache" / "matplotlib", self.home / ".config" / "matplotlib")
        return (*SYSTEM, self.temporary, *installed, *fonts, self.project / "__pycache__")

    def run(self, *command: str | Path, folder: Path | None = None) -> Trace:
        """Return what Python does with arguments, as a user starts it who has no screen."""
        names = ("PATH", "LANG", "LC_ALL", "VIRTUAL_ENV")
        environment = {name: os.environ[name] for name in names if name in os.environ}
        environment |= {"HOME": str(self.home), "TMPDIR": str(self.temporary), "PYTHONDONTWRITEBYTECODE": "1"}
        words = (sys.executable, "-P", *command)
        return trace(self.top / "calls", *words, folder=folder or self.project, environment=environment)

    def paretoik(self, *words: str | Path, folder: Path | None = None) -> Trace:
        return self.run("-m", "paretoik", *words, folder=folder)

    def solve(self, out: str, *options: str) -> Trace:
        return self.paretoik("solve", "users_own.py:good", "--out", out, *SMALL, *options)

    def strays(self, seen: Trace, *outputs: Path) -> set[Path]:
        """Return what was written elsewhere: neither an output, nor the part of one that is renamed to it when whole.

        The folders around the caches of a home are made if they are missing.
        """
        above = {self.home / ".cache", self.home / ".config"}
        strays = seen.outside(*self.allowed, *outputs) - above
        parts = {(output.parent, f".{output.name}") for output in outputs}
        return {path for path in strays if (path.parent, path.name.rpartition(".")[0]) not in parts}


def check(seen: Trace, desk: Desk, *outputs: Path, code: int = 0, also: str = "") -> None:
    """Compare a trace with what a command may do that has ``outputs``; it may also execute one more program."""
    assert seen.ended.returncode == code, seen.ended.stderr
    assert not desk.strays(seen, *outputs)
    assert seen.executed <= PROGRAMS | {also}
    assert not seen.beyond_loopback()
    assert not seen.look_ups()


def solved(desk: Desk, name: str = "run") -> Path:
    check(desk.solve(name), desk, desk.project / name)
    return desk.project / name


@pytest.fixture
def desk(tmp_path) -> Desk:
    return Desk(tmp_path)


def test_a_breach_of_each_kind_is_seen(desk):
    """192.0.2.1 is nobody's (RFC 5737), and connecting a datagram's socket sends nothing."""
    elsewhere = desk.top / "elsewhere"
    script = f"""
import os, socket, subprocess
os.mkdir({str(elsewhere)!r})
os.chdir(".")
for name in ("made", "moved"):
    open({str(elsewhere)!r} + "/" + name, "w").close()
os.rename({str(elsewhere / "moved")!r}, {str(elsewhere / "there")!r})
os.symlink("/nowhere", {str(elsewhere / "link")!r})
os.link({str(elsewhere / "made")!r}, "hard")
os.unlink("hard")
subprocess.run(["true"])
socket.socket().listen()
for port in 53, 7:
    with socket.socket(type=socket.SOCK_DGRAM) as name_server:
        name_server.connect(("192.0.2.1", port))
open("/etc/hosts").close()
"""
    seen = desk.run("-c", script)
    assert not seen.ended.returncode, seen.ended.stderr
    names = ("", "made", "moved", "there", "link")
    assert seen.outside(desk.project) == {elsewhere / name for name in names}
    assert seen.outside(elsewhere) == {desk.project / "hard"}
    assert {"true"} == seen.executed - PROGRAMS
    assert {("192.0.2.1", 53), ("192.0.2.1", 7)} < seen.beyond_loopback()
    assert any(address in ("0.0.0.0", "::") for address, _ in seen.beyond_loopback())
    assert seen.look_ups() == {Path("/etc/hosts"), ("192.0.2.1", 53)}


def test_a_search_with_workers_writes_into_its_folder_and_talks_to_nobody(desk):
    check(desk.solve("run", "--workers", "2"), desk, desk.project / "run")


def test_a_watched_run_writes_into_its_folder_and_talks_to_nobody(desk):
    """Without a screen it serves its recording, on the loopback only."""
    seen = desk.solve("run", "--live")
    check(seen, desk, desk.project / "run")
    assert "live, without a screen" in seen.ended.stderr
    assert seen.listening()


def test_the_client_of_a_cluster_writes_into_its_folder_and_does_not_listen(desk, tmp_path_factory):
    """Scheduler and workers do what Dask does, and the user who starts them says where they listen."""
    pytest.importorskip("distributed", reason="Dask is not installed: pip install paretoik[cluster]")
    with local_cluster(tmp_path_factory.mktemp("dask"), 1) as cluster:
        seen = desk.solve("run", "--cluster", cluster.address)
    check(seen, desk, desk.project / "run", also="uname")  # Dask asks what processor this is
    assert not seen.listening()


def test_a_run_that_is_stopped_and_resumed_writes_into_its_folder_and_talks_to_nobody(desk):
    run = desk.project / "run"
    endless = "--population", "40", "--generations", "100000", "--time-limit", "2"
    seen = desk.paretoik("solve", "users_own.py:good", "--out", "run", *endless)
    check(seen, desk, run, code=5)
    check(desk.paretoik("resume", "run", "--time-limit", "4", *NAMED), desk, run, code=5)


def test_commands_that_work_on_a_run_write_only_their_outputs_and_talk_to_nobody(desk):
    search, run, other = solved(desk, "found"), desk.project / "run", desk.project / "other"
    check(desk.paretoik("refine", "found", "--out", "run", *NAMED), desk, run)
    shutil.copytree(search, other)
    point = str(first_point(run))
    check(
        desk.paretoik("select", "run", "--knee", "--picture", "chosen.png", *NAMED),
        desk,
        run,
        desk.project / "chosen.png",
    )
    moved = "navigate", "run", "--point", point, "--improve", "kinetic_energy", "--allow", "torque_norm"
    check(desk.paretoik(*moved, "--out", "moved", *NAMED), desk, desk.project / "moved", run)
    check(desk.paretoik("verify", "run", *NAMED), desk)
    check(desk.paretoik("report", "run", *NAMED), desk, run)
    exported = "export", "run", "--point", point, "--out", "motion.csv"
    check(desk.paretoik(*exported, *NAMED), desk, desk.project / "motion.csv")
    compared = "compare", "run", "other", "--picture", "both.png", "--merge", "merged"
    check(desk.paretoik(*compared), desk, desk.project / "both.png", desk.project / "merged")


def first_point(run: Path) -> int:
    import pyarrow.parquet as pq

    return int(pq.read_table(run / "front.parquet")["id"][0].as_py())


@pytest.fixture
def hostile(desk) -> Path:
    """A run from elsewhere: code in its folder, by all names that may be loaded, with its problem."""
    run = desk.top / "from_elsewhere"
    shutil.move(solved(desk), run)
    bait = BAIT.format(place=str(desk.top / "executed"))
    for name in MODULES:
        (run / f"{name}.py").write_text(bait)
    (run / "bait.pkl").write_bytes(b"cposix\nmkdir\n(S'executed'\ntR.")
    (run / "bait.pth").write_text(bait)
    (run / "matplotlibrc").write_text(LATEX)
    (run / ".numba_config.yaml").write_text(f"cache_dir: {run}/compiled\n")  # numba would load code from there
    entries = json.loads((run / RUN).read_text())
    del entries["digest"]
    (run / RUN).write_bytes(run_bytes(entries))
    return run


READERS: dict[str, tuple[int, tuple[str, ...]]] = {  # exit code and words of each
    "verify": (0, ("-m", "paretoik", "verify", ".")),
    "select": (0, ("-m", "paretoik", "select", ".", "--knee", "--picture", "../knee.png")),
    "report": (0, ("-m", "paretoik", "report", ".")),
    "export": (2, ("-m", "paretoik", "export", ".", "--out", "../motion.csv")),  # which needs the arm
    "compare": (0, ("-m", "paretoik", "compare", ".", ".", "--picture", "../both.png")),
    "own": (0, ("-m", "paretoik", "select", ".", "--knee", "--problem", "../project/users_own.py:good")),
    "load_front": (0, ("-c", FRONT, ".")),
}


def test_reading_a_run_from_elsewhere_executes_nothing_of_it(desk, hostile):
    for name, (code, words) in READERS.items():
        seen = desk.run(*words, folder=hostile)
        check_reading(seen, desk, hostile, name)
        check(seen, desk, hostile, desk.top / "knee.png", desk.top / "both.png", code=code)
    check_show(desk, hostile)


def check_show(desk: Desk, run: Path) -> None:
    """Open the viewer, which ends because there is no screen."""
    seen = desk.paretoik("show", ".", folder=run)
    assert "must open in the Rerun viewer" in seen.ended.stderr
    check_reading(seen, desk, run, "show")
    check(seen, desk, code=2, also="rerun")


def check_reading(seen: Trace, desk: Desk, run: Path, name: str) -> None:
    code = {path for path in seen.opened if path.suffix in CODE and path.is_relative_to(desk.top)}
    theirs = {path for path in code if not path.is_relative_to(desk.project)}
    assert not theirs, name
    assert not (desk.top / "executed").exists(), name
