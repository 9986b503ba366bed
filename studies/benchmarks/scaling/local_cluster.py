"""A Dask scheduler and workers on this machine, started as users start them."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from studies.processes import children_of

DASK = str(Path(sys.executable).with_name("dask"))


@dataclass
class LocalCluster:
    """The address of a scheduler, and the processes that were started."""

    folder: Path
    scheduler: subprocess.Popen[bytes]
    address: str
    started: list[subprocess.Popen[bytes]] = field(default_factory=list)

    def processor_seconds(self) -> tuple[float, float]:
        """Return the seconds that the scheduler and all workers have computed so far."""
        return processor_seconds(self.scheduler.pid), sum(processor_seconds(each.pid) for each in self.started)

    def restart_scheduler(self) -> None:
        """Kill the scheduler, and its workers with it, and start another one in its place."""
        self.scheduler.kill()
        self.scheduler.wait()
        for process in self.started:
            process.kill()
        self.scheduler = start_scheduler(self.address.rpartition(":")[2])

    def start_workers(self, count: int, *options: str) -> subprocess.Popen[bytes]:
        """Start a number of workers with one thread each."""
        command = [DASK, "worker", self.address, "--nworkers", str(count), "--nthreads", "1", "--host", "127.0.0.1"]
        where = ["--no-dashboard", "--local-directory", str(self.folder)]
        self.started.append(subprocess.Popen([*command, *where, *options], stderr=subprocess.DEVNULL))
        return self.started[-1]


def processor_seconds(process: int) -> float:
    """Return the seconds that a process and its children, alive or ended, have computed so far."""
    try:
        fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    except FileNotFoundError:  # it has ended meanwhile
        return 0.0
    ticks = sum(map(int, fields[11:15]))  # user and system, own and of ended children
    return ticks / os.sysconf("SC_CLK_TCK") + sum(map(processor_seconds, children_of(process)))


def start_scheduler(port: str, *options: str) -> subprocess.Popen[bytes]:
    """Start a scheduler that listens only on the loopback."""
    loopback = ["--host", "127.0.0.1", "--port", port, "--dashboard-address", "127.0.0.1:0"]
    return subprocess.Popen([DASK, "scheduler", *loopback, *options], stderr=subprocess.DEVNULL)


@contextmanager
def local_cluster(folder: Path, workers: int) -> Iterator[LocalCluster]:
    """Start a scheduler and workers, only on the loopback; end them, frozen ones too, with the body."""
    file = folder / "scheduler.json"
    cluster = LocalCluster(folder, start_scheduler("0", "--scheduler-file", str(file)), "")
    try:
        while not file.exists() or not file.read_text():
            assert cluster.scheduler.poll() is None
            time.sleep(0.05)
        cluster.address = json.loads(file.read_text())["address"]
        if workers:
            cluster.start_workers(workers)
        yield cluster
    finally:
        for process in (*cluster.started, cluster.scheduler):
            if process.poll() is None:
                os.kill(process.pid, signal.SIGCONT)
                process.terminate()
        for process in (*cluster.started, cluster.scheduler):
            try:
                process.wait(10.0)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
