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

DASK = str(Path(sys.executable).with_name("dask"))


@dataclass
class DaskCluster:
    """The address of a scheduler, and the processes that were started."""

    folder: Path
    scheduler: subprocess.Popen[bytes]
    address: str
    started: list[subprocess.Popen[bytes]] = field(default_factory=list)

    def restart_scheduler(self) -> None:
        """Kill the scheduler, and its workers with it, and start another one in its place."""
        self.scheduler.kill()
        self.scheduler.wait()
        for process in self.started:
            process.kill()
        self.scheduler = start_scheduler(self.address.rpartition(":")[2])

    def start_workers(self, count: int, *options: str) -> subprocess.Popen[bytes]:
        command = [DASK, "worker", self.address, "--nworkers", str(count), "--nthreads", "1", "--host", "127.0.0.1"]
        where = ["--no-dashboard", "--local-directory", str(self.folder)]
        self.started.append(subprocess.Popen([*command, *where, *options], stderr=subprocess.DEVNULL))
        return self.started[-1]


def start_scheduler(port: str, *options: str) -> subprocess.Popen[bytes]:
    loopback = ["--host", "127.0.0.1", "--port", port, "--dashboard-address", "127.0.0.1:0"]
    return subprocess.Popen([DASK, "scheduler", *loopback, *options], stderr=subprocess.DEVNULL)


@contextmanager
def dask_cluster(folder: Path, workers: int) -> Iterator[DaskCluster]:
    """Start a scheduler and so many workers, on the loopback alone; end them, frozen ones too, with the body."""
    file = folder / "scheduler.json"
    cluster = DaskCluster(folder, start_scheduler("0", "--scheduler-file", str(file)), "")
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
