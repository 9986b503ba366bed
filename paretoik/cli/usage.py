"""What is wrong with the words of a command line, in one line with the name, the wish and the fact."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

import typer

from paretoik.errors import InvalidInput
from paretoik.inputs import likely_spelling, shown

USAGE_ERRORS: Any = typer.BadParameter.__base__  # all that the parser raises, by no public name
WISHES = {"integer": "an integer", "number": "a number", "float": "a number"}  # by what the parser says


def refusal_of(error: Any, words: Sequence[str], commands: Sequence[str]) -> InvalidInput:
    """Return what the parser found wrong with the ``words`` of a command line as an error of ours."""
    command = next((word for word in words if word in commands), "")
    kind, option = type(error).__name__, getattr(error, "option_name", "")
    if kind == "NoSuchOption":
        options = [name for each in error.ctx.command.params for name in each.opts if name.startswith("-")]
        text = f"option: one of those of {command or 'paretoik'} wanted, got {shown(option)}"
        return _refusal(command, text + likely_spelling(option, options))
    if kind == "BadOptionUsage":
        has_value = "requires" not in str(error)
        text = f"{option}: no value wanted, got one" if has_value else f"{option}: a value wanted, got none"
        return _refusal(command, text)
    if kind == "MissingParameter":
        return _refusal(command, f"{_name(error.param)}: a value wanted, got none")
    if getattr(error, "param", None) is not None:
        return _refusal(command, f"{_name(error.param)}: {_wish(str(error))} wanted, got {_fact(error, words)}")
    name = re.fullmatch(r"No such command '(.*?)'\..*", str(error), re.DOTALL)
    if name is not None:
        text = f"command: one of {', '.join(commands)} wanted, got {shown(name[1])}"
        return _refusal("", text + likely_spelling(name[1], commands))
    extra = re.fullmatch(r".*unexpected extra argument(?:s|\(s\))? \((.*)\)", str(error), re.DOTALL)
    text = "arguments: no more of them wanted" if extra is not None else "other words wanted"
    return _refusal(command, f"{text}, got {shown(extra[1] if extra is not None else str(error))}")


def _refusal(command: str, text: str) -> InvalidInput:
    about = f"paretoik {command}".strip()
    return InvalidInput(f"{text}; '{about} --help' says what there is")


def _name(param: Any) -> str:
    return str(max(param.opts, key=len))


def _wish(message: str) -> str:
    """Return what is wanted by what the parser says, in its own words where it says something else."""
    if choices := _choices(message):
        return f"one of {', '.join(choices)}"
    return next((wish for word, wish in WISHES.items() if word in message), f"another value ({message})")


def _choices(message: str) -> list[str]:
    """Return the choices of which the parser says that a value is none."""
    listed = re.search(r"is not one of (.*?)\.?$", message, re.DOTALL)
    return [] if listed is None else listed[1].replace("'", "").split(", ")


def _fact(error: Any, words: Sequence[str]) -> str:
    """Return the value of an option, which comes after its name or behind its equals sign, and what it may mean."""
    values = [
        word.partition("=")[2] if "=" in word else after
        for word, after in zip(words, [*words[1:], ""], strict=True)
        if word.partition("=")[0] in error.param.opts
    ]
    return f"{shown(values[-1])}{likely_spelling(values[-1], _choices(str(error)))}" if values else "another"
