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

    def start_workers(self, count: int, *options: str) -> subprocess.Popen[bytes]:
        command = [DASK, "worker", self.address, "--nworkers", str(count), "--nthreads", "1", "--host", "127.0.0.1"]
        where = ["--no-dashboard", "--local-directory", str(self.folder)]
        self.started.append(subprocess.Popen([*command, *where, *options], stderr=subprocess.DEVNULL))
        return self.started[-1]


@contextmanager
def dask_cluster(folder: Path, workers: int) -> Iterator[DaskCluster]:
    """Start a scheduler and so many workers, on the loopback alone; end them, frozen ones too, with the body."""
    file = folder / "scheduler.json"
    loopback = ["--host", "127.0.0.1", "--port", "0", "--dashboard-address", "127.0.0.1:0"]
    command = [DASK, "scheduler", *loopback, "--scheduler-file", str(file)]
    scheduler = subprocess.Popen(command, stderr=subprocess.DEVNULL)
    cluster = DaskCluster(folder, scheduler, "")
    try:
        while not file.exists() or not file.read_text():
            assert scheduler.poll() is None
            time.sleep(0.05)
        cluster.address = json.loads(file.read_text())["address"]
        if workers:
            cluster.start_workers(workers)
        yield cluster
    finally:
        for process in (*cluster.started, scheduler):
            os.kill(process.pid, signal.SIGCONT)
            process.terminate()
        for process in (*cluster.started, scheduler):
            try:
                process.wait(10.0)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
