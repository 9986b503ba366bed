"""The first inputs of fuzzing, which tests run again: one folder per target, one file per input."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from hashlib import sha256
from pathlib import Path
from typing import TypeAlias

from studies.benchmarks.reliability.fuzzing.command_lines import CommandLines
from studies.benchmarks.reliability.fuzzing.run_folders import RunFolders
from studies.benchmarks.reliability.fuzzing.urdf_files import UrdfFiles
from studies.benchmarks.reliability.fuzzing.verb_options import VerbOptions

CORPUS = Path(__file__).parents[4] / "tests" / "fuzzing" / "corpus"
TARGETS: dict[str, Callable[[Path], UrdfFiles | RunFolders | CommandLines]] = {
    "urdf": UrdfFiles,
    "folders": RunFolders,
    "commands": CommandLines,
    "options": VerbOptions,
}
Target: TypeAlias = Callable[[bytes], None]


def inputs(target: str) -> Iterator[tuple[str, bytes]]:
    """Yield the name and the bytes of every input of a target, in order."""
    for file in sorted((CORPUS / target).iterdir()):
        yield file.name, file.read_bytes()


def keep(folder: Path, data: bytes) -> Path:
    """Write an input into a folder, named by the beginning of its digest, and return its path."""
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / sha256(data).hexdigest()[:16]
    file.write_bytes(data)
    return file
