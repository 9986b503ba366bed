"""The choices kept in a run folder: `choices.json`, a tree in which every choice knows its parent.

The file is strict JSON with a format version and a SHA-256 digest, like `run.json`; every choice rewrites it.
``entries`` are in the order of their ids, from 1 on; ``current`` is the id of the present choice, null if all were
undone. Going back deletes nothing: the next choice becomes another branch.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from paretoik.errors import InvalidInput, InvalidRun, warn_user
from paretoik.file_paths import missing_file
from paretoik.front.choice import Choice, Preference, explain_named
from paretoik.front.points import FrontData, row_of
from paretoik.front.storage import stored_points
from paretoik.inputs import shown
from paretoik.runs.file_replacement import only_writer, replace_file
from paretoik.runs.files import CHOICES, RUN, check_digest, read_run, run_bytes, to_json
from paretoik.tables import fit_screen, represented

ENTRY_TYPES = {
    "id": int,
    "parent": int | None,
    "point": int,
    "preference": dict,
    "objectives": dict,
    "reason": str,
    "time": str,
}


@represented
@dataclass(frozen=True, kw_only=True)
class KeptChoice:
    """One kept choice.

    id: id of the choice, from 1 on
    parent: id of the choice before it, None for a first one
    point: id of the chosen point
    objectives: values of the point, by name
    preference: type, text and parameters of the preference
    reason: why the point was chosen, in words
    time: time in UTC (ISO 8601)
    former: run and choice from which a closed loop was run again with another preference, else None
    """

    id: int
    parent: int | None
    point: int
    preference: Mapping[str, Any]
    objectives: Mapping[str, float]
    reason: str
    time: str
    former: Mapping[str, Any] | None = None


@dataclass(frozen=True, kw_only=True)
class Choices:
    """The choices kept in a run folder, by id, and the id of the ``current`` one."""

    entries: tuple[KeptChoice, ...] = ()
    current: int | None = None

    @property
    def chosen(self) -> KeptChoice | None:
        """The present choice, or None."""
        return None if self.current is None else self.entries[self.current - 1]

    def __len__(self) -> int:
        return len(self.entries)

    def __repr__(self) -> str:
        """Return the tree, cut to fit a screen."""
        return fit_screen(self.text)

    @property
    def text(self) -> str:
        """The whole tree, one line per choice; the present one is marked, branches are indented."""
        children: dict[int | None, list[KeptChoice]] = {}
        for entry in self.entries:
            children.setdefault(entry.parent, []).append(entry)
        lines, stack = list[str](), list[tuple[str, int | None]]([("", None)])
        while stack:
            indent, id = stack.pop()
            if id is not None:
                entry = self.entries[id - 1]
                values = ", ".join(f"{name} {value:.4g}" for name, value in entry.objectives.items())
                mark = "  <- now" if id == self.current else ""
                lines.append(f"{indent}{id}. point {entry.point} ({values}) by {entry.preference['text']}{mark}")
            following = children.get(id, ())
            stack += [(indent + "  " * (len(following) > 1), each.id) for each in reversed(following)]
        return "\n".join(lines) or "no choice yet"


def read_choices(folder: Path) -> Choices:
    """Return the choices kept in a run folder; none if there is no such file.

    Raises InvalidRun if the file is damaged, a link, or of another version.
    """
    file = folder / CHOICES
    if not file.is_symlink() and not file.exists():
        return Choices()
    content = read_run(file, kind="choices")
    check_digest(file, content)
    try:
        entries, current = content["entries"], content["current"]
        for place, entry in enumerate(entries, 1):  # ids count from 1 on, and parents come first
            wrong = [name for name, kind in ENTRY_TYPES.items() if not isinstance(entry[name], kind)]
            if wrong:
                raise ValueError(f"{wrong[0]} of entry {place} is {entry[wrong[0]]!r}")
            if not isinstance(entry["preference"].get("text"), str):
                raise ValueError(f"the preference of entry {place} has no text")
            if entry["id"] != place or not (entry["parent"] is None or 1 <= entry["parent"] < place):
                raise ValueError(f"entry {place} is out of order")
        if not (current is None or (isinstance(current, int) and 1 <= current <= len(entries))):
            raise ValueError(f"no entry {current!r}")
        return Choices(entries=tuple(KeptChoice(**entry) for entry in entries), current=current)
    except (KeyError, TypeError, ValueError) as fault:
        raise InvalidRun(f"{file} must contain valid choices, got a fault: {fault}") from fault


def keep_choice(
    front: FrontData, choice: Choice, preference: Preference, *, former: Mapping[str, Any] | None = None
) -> bool:
    """Append a choice to those in the front's run folder, and return whether it is kept.

    Its parent is the present choice. If the folder does not contain the chosen point, or cannot be written, a warning
    says that the choice is not kept. Raises InvalidRun if the file of choices is damaged.
    """
    folder = front.folder
    assert folder is not None
    try:
        with _run_locked(folder):
            try:
                values = stored_points(folder).get(choice.id)
            except InvalidRun as fault:
                raise InvalidInput(str(fault)) from fault
            if values is None or list(values) != choice.objectives.tolist():
                fact = "no such point" if values is None else f"objectives {shown(list(values))}"
                raise InvalidInput(f"{folder} must have point {choice.id} with this front's objectives, got {fact}")
            choices = read_choices(folder)
            entry = KeptChoice(
                id=len(choices) + 1,
                parent=choices.current,
                point=choice.id,
                preference=to_json(preference_data(preference), name="preference"),
                objectives=dict(zip(front.names, map(float, choice.objectives), strict=True)),
                reason=choice.reason,
                time=datetime.now(UTC).isoformat(timespec="seconds"),
                former=former,
            )
            _write(folder, Choices(entries=(*choices.entries, entry), current=entry.id))
    except InvalidRun:
        raise
    except (InvalidInput, OSError) as fault:
        warn_user(f"the choice is not kept: {fault}")
        return False
    return True


def go_back(folder: Path, *, front: FrontData | None = None) -> Choices:
    """Go back to the parent of the present choice, and return the choices.

    Raises InvalidInput if there is no choice, or if a given ``front`` does not have the parent's point.
    """
    with _run_locked(folder):
        choices = read_choices(folder)
        if choices.chosen is None:
            raise InvalidInput(f"{folder} must have a choice to go back from, got none")
        choices = Choices(entries=choices.entries, current=choices.chosen.parent)
        if front is not None and choices.chosen is not None:
            row_of(front, choices.chosen.point, name="undo")
        _write(folder, choices)
    return choices


def kept_choices(front: FrontData) -> Choices:
    """Return the choices kept in the front's run folder; none without a folder."""
    return Choices() if front.folder is None else read_choices(front.folder)


def chosen(front: FrontData) -> Choice | None:
    """Return the present choice in the front's run folder with its stored reason, or None.

    Raises InvalidInput if the front does not have the choice's point.
    """
    entry = kept_choices(front).chosen
    return None if entry is None else replace(explain_named(front, row_of(front, entry.point)), reason=entry.reason)


def present_point(choices: Choices, *, name: str) -> int:
    """Return the id of the present choice's point; raises InvalidInput if there is no choice."""
    if choices.chosen is None:
        raise InvalidInput(
            f"{name}: the id of a point must be given unless a choice is kept (paretoik select RUN, front.select), "
            "got neither"
        )
    return choices.chosen.point


def pick_point(
    front: FrontData, point: Choice | int | None, *, name: str, otherwise: Callable[[FrontData], Choice] | None = None
) -> Choice:
    """Return the given point of a front, else the present choice, else ``otherwise(front)``, else the only point.

    Raises InvalidInput if the front does not have the given point, or if none of these exists.
    """
    if point is not None:
        return explain_named(front, row_of(front, getattr(point, "id", point), name=name))
    choice = chosen(front)
    if choice is None and otherwise is not None:
        choice = otherwise(front)
    return choice or explain_named(front, row_of(front, present_id(front, name=name)))


def present_id(front: FrontData, *, name: str) -> int:
    """Return the id of the present choice's point, else of the only point; raises InvalidInput without both."""
    choices = kept_choices(front)
    return int(front.ids[0]) if choices.chosen is None and len(front) == 1 else present_point(choices, name=name)


def preference_data(preference: Preference) -> dict[str, Any]:
    """Return a preference's type and text, and its parameters if it is one of paretoik."""
    kind = type(preference)
    data = {"type": kind.__name__, "text": repr(preference)[:300]}  # a user's preference may have a text of any length
    if not kind.__module__.startswith("paretoik."):
        return data
    values = {name: getattr(preference, name) for name in getattr(kind, "__dataclass_fields__", ())}
    return data | {
        name: preference_data(value) if isinstance(value, Preference) else value for name, value in values.items()
    }


def _write(folder: Path, choices: Choices) -> None:
    content = {"entries": [asdict(entry) for entry in choices.entries], "current": choices.current}
    replace_file(folder / CHOICES, run_bytes(content))


@contextmanager
def _run_locked(folder: Path) -> Iterator[None]:
    """Lock a run folder against other writers; raises InvalidInput if it contains no run."""
    if not (folder / RUN).is_file():
        raise InvalidInput(f"{folder / RUN} must be a run, got {missing_file(folder / RUN)}")
    with only_writer(folder):
        yield
