"""The choices kept in a run folder: `choices.json`, a tree in which every choice knows its parent.

The file is strict JSON with a format and a SHA-256 digest, like `run.json`; every choice rewrites it. ``entries`` are
in the order of their ids, from 1 on; ``current`` is the id of the present choice, null if all were undone. Going back
deletes nothing: the next choice becomes another branch.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from paretoik.errors import InvalidInput, InvalidRun, warn_user
from paretoik.front.choice import Choice, Preference
from paretoik.front.points import row_of
from paretoik.paths import missing_file
from paretoik.runs.file_replacement import only_writer, replace_file
from paretoik.runs.files import CHOICES, RUN, check_digest, read_run, run_bytes, to_json
from paretoik.tables import field_representation, fit_screen, html_representation

if TYPE_CHECKING:
    from paretoik.front.front import Front


@dataclass(frozen=True, kw_only=True)
class ChoiceOptions:
    """Limits on what is kept of a choice."""

    text: int = 300  # most characters of a preference's text: a user's own may have any number


OPTIONS = ChoiceOptions()


@dataclass(frozen=True, kw_only=True)
class KeptChoice:
    """One kept choice.

    id, parent: its id, and that of the choice before it (None for a first one)
    point, objectives: id of the chosen point, and its values by name
    preference, reason: type and parameters of the preference as data, and the reason in words
    time: time in UTC (ISO 8601)
    former: run and choice after which a closed loop was followed again, else None
    """

    id: int
    parent: int | None
    point: int
    preference: Mapping[str, Any]
    objectives: Mapping[str, float]
    reason: str
    time: str
    former: Mapping[str, Any] | None = None

    __repr__ = field_representation
    _repr_html_ = html_representation


@dataclass(frozen=True, kw_only=True)
class Choices:
    """The choices kept in a run folder, in order, and the id of the ``current`` one."""

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
        """The whole tree, one line per choice, with the present one marked."""
        return "\n".join(self._lines()) or "no choice yet"

    def _lines(self) -> Iterator[str]:
        """Yield one line per choice; only branches are indented."""
        children: dict[int | None, list[KeptChoice]] = {}
        for entry in self.entries:
            children.setdefault(entry.parent, []).append(entry)
        stack = [("  " * (len(children.get(None, ())) > 1), entry) for entry in reversed(children.get(None, ()))]
        while stack:
            indent, entry = stack.pop()
            values = ", ".join(f"{name} {value:.4g}" for name, value in entry.objectives.items())
            mark = "  <- now" if entry.id == self.current else ""
            yield f"{indent}{entry.id}. point {entry.point} ({values}) by {entry.preference['text']}{mark}"
            following = children.get(entry.id, ())
            stack += [(indent + "  " * (len(following) > 1), each) for each in reversed(following)]


def read_choices(folder: Path) -> Choices:
    """Return the choices kept in a run folder, none without such a file.

    Raises InvalidRun, in one line, if the file is damaged, a link, or of another version.
    """
    file = folder / CHOICES
    if not file.is_symlink() and not file.exists():
        return Choices()
    content = read_run(file, kind="choices")
    check_digest(file, content)
    try:
        entries, current = content["entries"], content["current"]
        _check_tree(entries, current)
        return Choices(entries=tuple(KeptChoice(**entry) for entry in entries), current=current)
    except (KeyError, TypeError, ValueError) as fault:
        raise InvalidRun(f"{file}: entries must be choices, got others: {fault}") from fault


def keep_choice(
    front: Front, choice: Choice, preference: Preference, *, former: Mapping[str, Any] | None = None
) -> bool:
    """Append a choice to those in the front's run folder, and return whether it is kept.

    Its parent is the present choice. If the folder does not contain the chosen point (any more) or cannot be written, a
    warning says that the choice is not kept. Raises InvalidRun if the file of choices is damaged.
    """
    folder = front.folder
    assert folder is not None
    try:
        with _run_locked(folder):
            _check_holds(front, choice, folder)
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


def go_back(folder: Path, *, front: Front | None = None) -> Choices:
    """Make the parent of the present choice the present one.

    Raises InvalidInput if there is no choice, and if a given ``front`` does not have the parent's point.
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


def chosen(front: Front) -> Choice | None:
    """Return the present choice of the front's run folder with its stored reason, or None.

    Raises InvalidInput if the front does not have its point.
    """
    entry = front.choices.chosen
    if entry is None:
        return None
    return replace(front[entry.point], reason=entry.reason)


def present_point(choices: Choices, *, name: str) -> int:
    """Return the id of the present choice's point; raises InvalidInput, by ``name``, without a choice."""
    if choices.chosen is None:
        raise InvalidInput(
            f"{name}: must be the id of a point unless a choice is kept (paretoik select RUN, front.select), "
            "got neither"
        )
    return choices.chosen.point


def pick_point(
    front: Front, point: Choice | int | None, *, name: str, otherwise: Callable[[Front], Choice] | None = None
) -> Choice:
    """Return a point of a front: the named one, or else the present choice, or the only point.

    If there is no choice either, ``otherwise`` is called. Raises InvalidInput, by ``name``, for points that the front
    does not have, and if there is no point to pick.
    """
    if point is not None:
        return front[int(front.ids[row_of(front, getattr(point, "id", point), name=name)])]
    choice = chosen(front)
    if choice is None and otherwise is not None:
        choice = otherwise(front)
    return choice or front[present_id(front, name=name)]


def present_id(front: Front, *, name: str) -> int:
    """Return the id of the present choice or of the only point; raises InvalidInput, by ``name``, for neither."""
    choices = front.choices
    return int(front.ids[0]) if choices.chosen is None and len(front) == 1 else present_point(choices, name=name)


def preference_data(preference: Preference) -> dict[str, Any]:
    """Return a preference as data: type, text, and for one of this project its parameters by name."""
    kind = type(preference)
    data = {"type": kind.__name__, "text": repr(preference)[: OPTIONS.text]}
    if not kind.__module__.startswith("paretoik."):
        return data
    values = {name: getattr(preference, name) for name in getattr(kind, "__dataclass_fields__", ())}
    return data | {
        name: preference_data(value) if isinstance(value, Preference) else value for name, value in values.items()
    }


ENTRY_TYPES = {
    "id": int,
    "parent": int | None,
    "point": int,
    "preference": dict,
    "objectives": dict,
    "reason": str,
    "time": str,
}


def _check_tree(entries: Any, current: Any) -> None:
    """Raise ValueError unless ids count from 1 on, parents come first, and the current id exists."""
    for place, entry in enumerate(entries, 1):
        wrong = [name for name, kind in ENTRY_TYPES.items() if not isinstance(entry[name], kind)]
        if wrong:
            raise ValueError(f"{wrong[0]} of entry {place} is {entry[wrong[0]]!r}")
        if not isinstance(entry["preference"].get("text"), str):
            raise ValueError(f"the preference of entry {place} has no text")
        if entry["id"] != place or not (entry["parent"] is None or 1 <= entry["parent"] < place):
            raise ValueError(f"entry {place} is out of order")
    if not (current is None or (isinstance(current, int) and 1 <= current <= len(entries))):
        raise ValueError(f"no entry {current!r}")


def _check_holds(front: Front, choice: Choice, folder: Path) -> None:
    """Raise InvalidInput unless a run folder contains the chosen point of a front."""
    from paretoik.front.storage import stored_points

    try:
        values = stored_points(folder).get(choice.id)
    except InvalidRun as fault:
        raise InvalidInput(str(fault)) from fault
    if values is None or list(values) != choice.objectives.tolist():
        raise InvalidInput(f"{folder} must be the run with point {choice.id} of this front, got another")


def _write(folder: Path, choices: Choices) -> None:
    replace_file(folder / CHOICES, choices_bytes(choices))


def choices_bytes(choices: Choices) -> bytes:
    """Return the content of `choices.json`."""
    return run_bytes({"entries": [asdict(entry) for entry in choices.entries], "current": choices.current})


@contextmanager
def _run_locked(folder: Path) -> Iterator[None]:
    """Lock a run folder against other writers; raises InvalidInput if it is no run folder."""
    if not (folder / RUN).is_file():
        raise InvalidInput(f"{folder / RUN} must be a run, got {missing_file(folder / RUN)}")
    with only_writer(folder):
        yield
