"""What processes ask of the system, as strace saw it: files that they write and open, programs, and the network."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from ipaddress import ip_address
from pathlib import Path

import pytest

CALL = re.compile(r"(?P<name>\w+)\((?P<arguments>.*)\)\s+= (?P<result>.*)")
TEXT = re.compile(r'(?:(?:AT_FDCWD|\d+)<(?P<folder>[^>]*)>, )?"(?P<text>(?:[^"\\]|\\.)*)"')
DESCRIPTOR = re.compile(r"\d+<(?P<path>[^>]*)>")
ADDRESS = re.compile(r'_port=htons\((?P<port>\d+)\).*?(?:inet_addr\(|inet_pton\(AF_INET6, )"(?P<address>[^"]+)"')
LISTENING = re.compile(r"\d+<(?:TCP|UDP)(?:v6)?:(?P<socket>.*?)>")
OPENING = ("open", "openat", "openat2", "creat")
CHANGES = (  # how the calls begin that change a file by its name
    *(
        "mkdir",
        "mknod",
        "rename",
        "link",
        "symlink",
        "unlink",
        "rmdir",
        "truncate",
        "chmod",
        "fchmodat",
        "chown",
        "lchown",
    ),
    *("fchownat", "utime", "futimesat", "setxattr", "lsetxattr", "removexattr", "lremovexattr", "mount", "umount"),
)
NETWORK = ("connect", "bind", "listen", "sendto", "sendmsg", "sendmmsg")
NAME_SERVICE = tuple(Path("/etc", name) for name in ("resolv.conf", "hosts", "host.conf"))


@dataclass(frozen=True)
class Call:
    """A system call as strace writes it, made by a process whose folder is ``folder``."""

    name: str
    arguments: str
    result: str
    folder: Path

    @property
    def succeeded(self) -> bool:
        return not self.result.startswith(("-1 ", "? "))

    @property
    def paths(self) -> list[Path]:
        """The paths of its arguments, absolute, links in their folders followed."""
        paths = list[Path]()
        for match in TEXT.finditer(self.arguments):
            path = self.folder / (match["folder"] or "") / match["text"]
            paths.append(Path(os.path.realpath(path.parent), path.name))
        return paths

    @property
    def written(self) -> list[Path]:
        """The paths that it made, changed, moved or removed, or opened in order to write."""
        if not self.succeeded:
            return []
        if self.name in OPENING:
            writes = self.name == "creat" or re.search(r"O_(WRONLY|RDWR|CREAT|TRUNC)", self.arguments)
            opened = DESCRIPTOR.search(self.result)
            return [Path(opened["path"])] if writes and opened and opened["path"].startswith("/") else []  # no pipe
        if not self.name.startswith(CHANGES):
            return []
        if self.name.startswith(("rename", "link")):
            return self.paths
        if self.name.startswith("symlink"):
            return self.paths[-1:]  # what it leads to is not touched
        changed = DESCRIPTOR.search(self.arguments)
        return self.paths[:1] or ([Path(changed["path"])] if changed else [])

    @property
    def addresses(self) -> list[tuple[str, int]]:
        """The Internet addresses and ports that it names, those of a socket that listens among them."""
        if self.name == "listen":
            socket = LISTENING.match(self.arguments)
            if socket is None:  # a Unix socket
                return []
            address, _, port = socket["socket"].strip("[]").rpartition(":")
            return [(address.strip("[]") or "0.0.0.0", int(port))]  # bound to nothing it listens to all
        if self.name not in NETWORK:
            return []
        return [(match["address"], int(match["port"])) for match in ADDRESS.finditer(self.arguments)]


@dataclass(frozen=True)
class Trace:
    """All calls of a command and of the processes that it started, and how it ended."""

    calls: Sequence[Call]
    ended: subprocess.CompletedProcess[str]

    @property
    def written(self) -> set[Path]:
        """All paths that were made, changed, moved or removed, or opened in order to write."""
        return {path for call in self.calls for path in call.written}

    @property
    def opened(self) -> set[Path]:
        """All paths that somebody tried to open."""
        return {path for call in self.calls if call.name in OPENING for path in call.paths[:1]}

    @property
    def executed(self) -> set[str]:
        """The names of the programs that were started."""
        return {call.paths[0].name for call in self.calls if call.name.startswith("execve") and call.succeeded}

    @property
    def addresses(self) -> set[tuple[str, int]]:
        """All Internet addresses and ports that anything was sent to or listened at, or tried to."""
        return {address for call in self.calls for address in call.addresses}

    def outside(self, *folders: Path) -> set[Path]:
        """Return what was written elsewhere than in folders, or as the files, that are given."""
        places = [Path(os.path.realpath(folder)) for folder in folders]
        return {path for path in self.written if not any(path.is_relative_to(place) for place in places)}

    def beyond_loopback(self) -> set[tuple[str, int]]:
        """Return the addresses that are of other machines, or at which other machines are listened to."""
        return {(address, port) for address, port in self.addresses if not ip_address(address).is_loopback}

    def listening(self) -> set[tuple[str, int]]:
        """Return the Internet addresses and ports that were listened to."""
        return {address for call in self.calls if call.name == "listen" for address in call.addresses}

    def look_ups(self) -> set[object]:
        """Return what looking a name up asks: name servers, and the files that say where they are."""
        return {path for path in self.opened if path in NAME_SERVICE} | {
            each for each in self.addresses if each[1] == 53
        }


def trace(log: Path, *command: str | Path, folder: Path, environment: Mapping[str, str] | None = None) -> Trace:
    """Run a command in a folder under strace, which writes into ``log``; skip the test where there is no strace."""
    strace = shutil.which("strace")
    if strace is None:
        pytest.skip("strace is not installed")
    options = ("-f", "--seccomp-bpf", "-yy", "-s", "4096", "-e", "trace=%file,%network,execve", "-e", "signal=none")
    ended = subprocess.run(
        [strace, *options, "-o", str(log), "--", *map(str, command)],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    calls = list(_calls(log.read_text(errors="replace"), folder))
    assert calls, ended.stderr
    moved = [call for call in calls if call.name == "chdir" and call.succeeded and call.paths != [folder]]
    assert not moved, "paths are taken to be relative to one folder"
    return Trace(calls, ended)


def _calls(log: str, folder: Path) -> Iterator[Call]:
    """Yield the calls of a log; those that others interrupt are put together again."""
    unfinished = dict[str, str]()
    for line in log.splitlines():
        process, _, text = line.partition(" ")
        text = text.strip()
        if text.endswith("<unfinished ...>"):
            unfinished[process] = text.removesuffix("<unfinished ...>")
            continue
        if resumed := re.match(r"<\.\.\. \w+ resumed>", text):
            text = unfinished.pop(process, "") + text[resumed.end() :]
        if match := CALL.match(text):
            yield Call(match["name"], match["arguments"], match["result"], folder)
        else:
            assert text.startswith(("+++", "---")) or text.endswith("= ?"), f"a line that is no call: {line}"
