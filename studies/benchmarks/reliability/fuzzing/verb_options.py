"""A command line of a verb's own options: every verb, every option, with good and bad values.

Verbs and options are read from the commands themselves, so that a new option is tried at once.
"""

from __future__ import annotations

from pathlib import Path

import typer

from paretoik.cli.app import app
from studies.benchmarks.reliability.fuzzing.command_lines import CommandLines

VALUES = (
    *("", " ", "0", "-1", "2", "0.5", "nan", "inf", "1e309", "9" * 30, "x", "\u20ac", "../x", "-x", "=x", "a,b", ","),
    *(
        "run",
        "robot.urdf",
        "new",
        "new.csv",
        "new.png",
        "no_problem.py",
        "no_problem.py:value",
        "tiny.py:tiny",
        "os:abort",
    ),
    *("f", "f=1", "f=1,g=2", "f=nan,g=1", "f=1,f=2", "f=", "=1", "f<=2", "f>=3,f<=1", "f=improve,g=free", "f=10%,g"),
    *("csv", "npz", "ros2-bag", "franka", "gen3", "sqp", "auto", "tcp://", "http://127.0.0.1", "a", "b", "b,a"),
)
"""The values of options; none makes a command compute for long, or connect to anything."""

TARGETS = {
    "list": "no_problem.py",
    "solve": "tiny.py:tiny --out run --population 4 --generations 2",  # only with --overwrite: it searches and records
    "plan": "tiny.py:tiny --out new",
    "front": "tiny.py:tiny --out new",
    "refine": "run --out new",
    "check-robot": "robot.urdf",
}
"""The argument of a verb, by its name; that of the others is the run."""
LEFT_OUT = ("--live", "--workers")  # a viewer, and processes that take seconds to begin


class VerbOptions(CommandLines):
    """Reads bytes as a verb and its options: one byte for the verb, then two for an option and its value.

    An option beyond the last is a word without a meaning.
    """

    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        self.options = verb_options()

    def __call__(self, data: bytes) -> None:
        """Run a verb with options; raise Defect."""
        if data:
            self.run(self.words(data))

    def words(self, data: bytes) -> list[str]:
        """Return the words of the command line that bytes, at least one, stand for."""
        verb = list(self.options)[data[0] % len(self.options)]
        words = [verb, *TARGETS.get(verb, "run").split()]
        for which, value in zip(data[1::2], data[2::2], strict=False):
            words += self.option_words(verb, which, VALUES[value % len(VALUES)])
        return words

    def option_words(self, verb: str, which: int, value: str) -> list[str]:
        """Return the words of a verb's option; a flag has no value."""
        options = self.options[verb]
        name, is_flag = [*options, ("", False)][which % (len(options) + 1)]
        return [value] if not name else [name] if is_flag else [name, value]


def verb_options() -> dict[str, list[tuple[str, bool]]]:
    """Return the options of every verb: their names, and whether they are flags."""
    group = typer.main.get_command(app)
    return {
        verb: [
            (name, bool(getattr(parameter, "is_flag", False)))
            for parameter in command.params
            if parameter.param_type_name == "option"
            for name in (*parameter.opts, *parameter.secondary_opts)
            if name not in LEFT_OUT
        ]
        for verb, command in group.commands.items()  # type: ignore[attr-defined]
    }
