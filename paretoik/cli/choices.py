"""``paretoik select`` and ``navigate``: choose a motion, or move along the front."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import typer

from paretoik.api.result_text import choice_text, entries
from paretoik.cli.console import (
    JsonFlag,
    QuietFlag,
    RunFolder,
    RunProblem,
    agreed_problem,
    exit_code,
    print_json,
    print_text,
    stdout_for_results,
)
from paretoik.errors import InvalidInput
from paretoik.file_paths import shell_command
from paretoik.front.choice import Preference
from paretoik.front.choice_tree import present_point, read_choices
from paretoik.front.points import NAVIGATIONS
from paretoik.front.preferences import Aspiration, Bounds, Classify, Knee, Lexicographic, Robust, Weights
from paretoik.front.preferences.knee_and_compromise import Compromise, Point
from paretoik.inputs import likely_spelling, shown
from paretoik.progress import open_observer
from paretoik.runs.files import PICTURE_MARK, RUN, check_target, problem_words, read_run

NUMBERS = "NAME=NUMBER,NAME=NUMBER"


WeightsOption = Annotated[
    str | None, typer.Option(help="Least weighted sum; missing objectives have weight 0.", metavar=NUMBERS)
]
KneeOption = Annotated[
    bool, typer.Option("--knee", help="The point from which any step costs the most relative to its gain.")
]
CompromiseOption = Annotated[
    bool, typer.Option("--compromise", help="The point whose worst objective loses the least of its range.")
]
AspirationOption = Annotated[
    str | None, typer.Option(help="Point nearest to given values, which may be unreachable.", metavar=NUMBERS)
]
LexicographicOption = Annotated[
    str | None,
    typer.Option(
        help="The first objective decides, then the second among points within the tolerance of the first, ...; a "
        "tolerance is in the objective's units, with % a share of its range.",
        metavar="NAME[=TOLERANCE],NAME",
    ),
]
BoundsOption = Annotated[
    str | None,
    typer.Option(
        help="Only points within these bounds (in quotes); another preference may choose among them.",
        metavar="'NAME<=VALUE,NAME>=VALUE'",
    ),
]
RobustOption = Annotated[str | None, typer.Option(help="Least regret if these weights are not exact.", metavar=NUMBERS)]
UncertaintyOption = Annotated[
    float | None, typer.Option(help="Share by which the weights of --robust may be wrong (0.2).")
]
ClassifyOption = Annotated[
    str | None,
    typer.Option(
        help="Class of each objective, relative to a point: improve, improve:VALUE, keep, relax:VALUE or free "
        "(NIMBUS).",
        metavar="NAME=CLASS,NAME=CLASS",
    ),
]
StartOption = Annotated[
    int | None, typer.Option("--from", help="Point from which --classify starts (the present choice).", metavar="ID")
]
PointOption = Annotated[int | None, typer.Option(help="The point with this id.", metavar="ID")]
HistoryOption = Annotated[bool, typer.Option("--history", help="Print the tree of choices so far.")]
UndoOption = Annotated[bool, typer.Option("--undo", help="Go back to the choice before the present one.")]
PictureOption = Annotated[Path | None, typer.Option(help="Draw the front and the chosen motion into this PNG.")]
OutOption = Annotated[Path | None, typer.Option(help="Folder for the new run of a closed loop.")]
OverwriteOption = Annotated[
    bool, typer.Option(help="Replace a run in that folder, or a file that is not a picture by paretoik.")
]


def select(
    run: RunFolder,
    weights: WeightsOption = None,
    knee: KneeOption = False,
    compromise: CompromiseOption = False,
    aspiration: AspirationOption = None,
    lexicographic: LexicographicOption = None,
    bounds: BoundsOption = None,
    robust: RobustOption = None,
    uncertainty: UncertaintyOption = None,
    classify: ClassifyOption = None,
    start: StartOption = None,
    point: PointOption = None,
    history: HistoryOption = False,
    undo: UndoOption = False,
    picture: PictureOption = None,
    out: OutOption = None,
    overwrite: OverwriteOption = False,
    problem: RunProblem = None,
    quiet: QuietFlag = False,
    as_json: JsonFlag = False,
) -> None:
    """Choose one motion of a front, and keep the choice.

    The reason of the choice is printed. A closed loop is run again with other weights at every step.
    """
    given = {**locals(), "from": start}
    wishes = {name: given[name] for name in OPTIONS if given[name] is not None and given[name] is not False}
    if history or undo:
        _show_history(run, wishes, undo=undo, problem=problem, as_json=as_json)
        return
    with stdout_for_results():
        if picture is not None:
            check_target("picture", picture, overwrite=overwrite, mark=PICTURE_MARK)
        from paretoik.api.load import load_front
        from paretoik.api.result_text import choice_entry
        from paretoik.api.select import select as select_point

        preference = read_preference(wishes, run=run)
        front = load_front(run, agreed_problem(run, problem))
        with open_observer(not quiet) as observe:
            selected, choice = select_point(front, preference, out=out, overwrite=overwrite, observe=observe or False)
        if picture is not None:
            from paretoik.review.pictures.fronts import front_picture

            front_picture(selected, picture, choice)
    if as_json:
        print_json(choice_entry(selected, choice))
    else:
        print_text(choice_text(selected, choice))
    if selected is not front:
        raise typer.Exit(exit_code(selected.provenance["status"]))


def _show_history(run: Path, wishes: Mapping[str, object], *, undo: bool, problem: str | None, as_json: bool) -> None:
    """Print the choices of a run, after one step back if ``undo``. Raises InvalidInput if a preference is given too."""
    if wishes:
        raise InvalidInput(f"--history and --undo must come without a preference, got --{next(iter(wishes))} too")
    read_run(run / RUN)
    if undo:
        with stdout_for_results():
            from paretoik.api.select import undo as go_back

            choices = go_back(run, agreed_problem(run, problem))
    else:
        choices = read_choices(run)
    if as_json:
        print_json(asdict(choices))
    else:
        print_text(choices.text)


# Preferences in the form of the command line.


CLASSES = "improve, improve:VALUE, keep, relax:VALUE or free"
PREFERENCES: Mapping[str, Callable[[Any, Mapping[str, Any], Path], Preference]] = {
    "weights": lambda text, *_: Weights(parse_numbers("weights", text)),
    "knee": lambda *_: Knee(),
    "compromise": lambda *_: Compromise(),
    "aspiration": lambda text, *_: Aspiration(parse_numbers("aspiration", text)),
    "lexicographic": lambda text, *_: parse_lexicographic(text),
    "robust": lambda text, wishes, _: Robust(
        parse_numbers("robust", text), **({"uncertainty": wishes["uncertainty"]} if "uncertainty" in wishes else {})
    ),
    "classify": lambda text, wishes, run: parse_classes(text, wishes.get("from"), run),
    "point": lambda id, *_: Point(id),
}  # by option: function (value, other options, run) that returns the preference
PREFERENCE_OF_OPTION = {"uncertainty": "robust", "from": "classify"}
OPTIONS = (*PREFERENCES, "bounds", *PREFERENCE_OF_OPTION)


def read_preference(wishes: Mapping[str, Any], *, run: Path) -> Preference:
    """Return the preference that the given options (by name) describe.

    ``bounds`` may come with another preference, which then decides within them; ``uncertainty`` belongs to ``robust``,
    ``from`` is the point that ``classify`` starts from. Raises InvalidInput unless there is exactly one preference.
    """
    for name, preference_name in PREFERENCE_OF_OPTION.items():
        if name in wishes and preference_name not in wishes:
            raise InvalidInput(f"{name} must come with --{preference_name}, got no --{preference_name}")
    chosen, bounds = [name for name in PREFERENCES if name in wishes], wishes.get("bounds")
    if len(chosen) > 1 or not (chosen or bounds):
        names = ", ".join(f"--{name}" for name in PREFERENCES)
        got = " and ".join(f"--{name}" for name in chosen) or "none"
        raise InvalidInput(f"preference must be one of {names}, with or without --bounds, got {got}")
    preference = PREFERENCES[chosen[0]](wishes[chosen[0]], wishes, run) if chosen else Compromise()
    return preference if bounds is None else Bounds(parse_bounds(bounds), then=preference)


def parse_numbers(option: str, text: str) -> dict[str, float]:
    """Return numbers by name.

    Raises InvalidInput if a part is not NAME=NUMBER, or a name comes twice.

    >>> parse_numbers("weights", "kinetic_energy=0.3, torque_norm=0.7")
    {'kinetic_energy': 0.3, 'torque_norm': 0.7}
    """
    numbers: dict[str, float] = {}
    for name, value in _parts(option, text, "NAME=NUMBER,NAME=NUMBER"):
        if name in numbers:
            raise InvalidInput(f"{option} must have each objective once, got {name} twice")
        numbers[name] = _number(option, name, value)
    return numbers


def parse_lexicographic(text: str) -> Lexicographic:
    """Return names in order, with their tolerances.

    A tolerance is in the unit of its objective, or with a percent sign a share of its range.

    >>> parse_lexicographic("kinetic_energy=5%,torque_norm=0.1,joint_travel")
    Lexicographic('kinetic_energy', 'torque_norm', 'joint_travel', tolerances={'torque_norm': 0.1}, \
tolerance_shares={'kinetic_energy': 0.05})
    """
    order: list[str] = []
    tolerances: dict[str, float] = {}
    shares: dict[str, float] = {}
    for part in text.split(","):
        name, _, value = map(str.strip, part.partition("="))
        order.append(name)
        if value.endswith("%"):
            shares[name] = _number("lexicographic", name, value.removesuffix("%")) / 100
        elif value:
            tolerances[name] = _number("lexicographic", name, value)
    return Lexicographic(*order, tolerances=tolerances, tolerance_shares=shares)


def parse_bounds(text: str) -> dict[str, tuple[float | None, float | None]]:
    """Return (lower, upper) by name; an objective may have both.

    >>> parse_bounds("kinetic_energy<=0.05, torque_norm>=1, torque_norm<=3")
    {'kinetic_energy': (None, 0.05), 'torque_norm': (1.0, 3.0)}
    """
    bounds: dict[str, tuple[float | None, float | None]] = {}
    for part in text.split(","):
        match = re.fullmatch(r"\s*(.+?)\s*(<=|>=)\s*(\S+)\s*", part)
        if match is None:
            raise InvalidInput(f"bounds must be 'NAME<=VALUE,NAME>=VALUE' in quotes, got {shown(part)}")
        name, sign, value = match[1], match[2], _number("bounds", match[1], match[3])
        lower, upper = bounds.get(name, (None, None))
        if (upper if sign == "<=" else lower) is not None:
            raise InvalidInput(f"bounds must have at most one bound on each side, got {name} {sign} twice")
        bounds[name] = (lower, value) if sign == "<=" else (value, upper)
    return bounds


def parse_classes(text: str, start: int | None, run: Path) -> Classify:
    """Return a preference with the class of every objective, from ``start`` or else the run's present choice."""
    lists: dict[str, list[str]] = {"improve": [], "keep": [], "free": []}
    values: dict[str, dict[str, float]] = {"improve": {}, "relax": {}}
    for name, kind in _parts("classify", text, "NAME=CLASS,NAME=CLASS"):
        word, separator, value = kind.partition(":")
        if separator and word in values:
            values[word][name] = _number("classify", name, value)
        elif not separator and word in lists:
            lists[word].append(name)
        else:
            hint = likely_spelling(word, ("improve", "keep", "relax", "free"))
            raise InvalidInput(f"classify: {name} must be {CLASSES}, got {shown(kind)}{hint}")
    if start is None:
        start = present_point(read_choices(run), name="--from")
    return Classify(start, improve_to=values["improve"], relax_to=values["relax"], **lists)


def _parts(option: str, text: str, form: str) -> Iterator[tuple[str, str]]:
    for part in text.split(","):
        name, separator, value = map(str.strip, part.partition("="))
        if not separator or not name:
            raise InvalidInput(f"{option} must be {form}, got {shown(part)}")
        yield name, value


def _number(option: str, name: str, text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise InvalidInput(f"{option} must be a number for {name}, got {shown(text)}") from None


# ``paretoik navigate``: move along the front of a run to a new certified point.


def navigate(
    run: RunFolder,
    improve: Annotated[str, typer.Option(help="The objective that gets better.")],
    point: Annotated[int | None, typer.Option(help="Id of the point to move from (the present choice).")] = None,
    allow: Annotated[
        list[str] | None, typer.Option(help="An objective that may get worse; repeatable (all but --hold).")
    ] = None,
    hold: Annotated[list[str] | None, typer.Option(help="An objective that must not get worse; repeatable.")] = None,
    by: Annotated[float | None, typer.Option(help="Improvement, in its unit (5 % of its range).")] = None,
    to: Annotated[float | None, typer.Option(help="Value to reach, in its unit, in place of --by.")] = None,
    out: Annotated[Path | None, typer.Option(help="Keep the new front in this folder, not in the run.")] = None,
    overwrite: Annotated[bool, typer.Option(help="Replace a run that is in that folder.")] = False,
    problem: RunProblem = None,
    as_json: JsonFlag = False,
) -> None:
    """Move along a front to a new certified point.

    The new point is better in one objective and is added to the run.

    No point is lost: if the new point dominates points of the run, the new front is kept in a folder next to the run.
    The recording opens on the new point, next to the present choice of the run if there is one.
    """
    with stdout_for_results():
        from paretoik.api.navigate import navigate as move

        front, choice, place = move(
            run,
            point,
            improve=improve,
            allow=allow,
            hold=hold or (),
            by=by,
            to=to,
            out=out,
            overwrite=overwrite,
            problem=agreed_problem(run, problem, needed=True),
        )
    start = front.provenance[NAVIGATIONS][-1]["from"]
    if as_json:
        print_json({**entries(front)[choice.index], **front.provenance[NAVIGATIONS][-1], "out": place})
    else:
        if point is None:
            print_text(f"from the present choice, point {start}:")
        print_text(choice_text(front, choice))
        why = ""
        if out is None and place != run and front.provenance[NAVIGATIONS][-1]["dominated"]:
            why = f", because the new point dominates points of {run}, which keeps them"
        elif out is None and place != run:
            why = f", because {run} was stopped, and resuming it would drop the new point"
        print_text(f"kept in {place}{why}")
        named = problem_words(front.provenance.get("problem"))
        print_text(f"export:  {shell_command('paretoik', 'export', place, '--point', str(choice.id), *named)}")
