"""The outcome of a bad input: refused in one good line before any work, accepted, or worse."""

from __future__ import annotations

import inspect
import os
import re
import time
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from paretoik.errors import InvalidInput, ParetoikError
from paretoik.inputs import cause_of
from studies.benchmarks.reliability.inputs.examples import PARTS, STARS, Examples
from studies.benchmarks.reliability.inputs.faults import BadInput, bad_inputs
from studies.benchmarks.reliability.inputs.messages import message_faults
from studies.benchmarks.reliability.inputs.surfaces import Surface

Verdict = Literal["good", "taken", "poor", "bad"]


@dataclass(frozen=True, kw_only=True)
class JudgingOptions:
    """The most processor time of a refusal [s]."""

    seconds: float = 0.25


OPTIONS = JudgingOptions()


@dataclass(frozen=True, kw_only=True)
class Case:
    """One bad value of one argument of one surface."""

    surface: Surface
    bad: BadInput

    @property
    def name(self) -> str:
        """Return the surface, the argument and the class of the fault."""
        return f"{self.surface.name}({self.bad.argument.name}): {self.bad.fault.name}"


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """The outcome of a case: good, taken, poor or bad, and the words."""

    verdict: Verdict
    words: str


def cases(surfaces: list[Surface]) -> Iterator[Case]:
    """Yield every class of bad values of every argument."""
    for surface in surfaces:
        for argument in surface.arguments:
            for bad in bad_inputs(argument):
                yield Case(surface=surface, bad=bad)


def judge(case: Case, examples: Examples) -> Outcome:
    """Call a surface with one bad argument, all others good, and judge the outcome."""
    call = _call(case, examples)
    before, began = sorted(os.walk(examples.folder)), time.process_time()
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always")
        try:
            call()
        except InvalidInput as refusal:
            outcome = _judge_message(case, str(refusal))
        except ParetoikError as failure:
            outcome = Outcome(verdict="bad" if case.bad.is_certain else "taken", words=f"{failure}")
        except Exception as error:
            outcome = Outcome(verdict="bad", words=cause_of(error))
        else:
            outcome = Outcome(verdict="taken", words="")
    seconds = time.process_time() - began
    if warned:
        return Outcome(verdict="bad", words=f"warning: {warned[0].message}")
    if outcome.verdict == "good" and seconds > OPTIONS.seconds:
        return Outcome(verdict="poor", words=f"after {seconds:.1f} s: {outcome.words}")
    if outcome.verdict == "good" and sorted(os.walk(examples.folder)) != before:
        return Outcome(verdict="poor", words=f"after files were written: {outcome.words}")
    return outcome


def _call(case: Case, examples: Examples) -> Any:
    surface, argument = case.surface, case.bad.argument
    value = case.bad.fault.make(examples.folder)
    others: dict[str, Any] = examples.arguments(surface, argument)
    function = surface.function if surface.owner is None else getattr(examples.owner(surface), surface.method)
    positional, named = [], {}
    for name, parameter in inspect.signature(function).parameters.items():
        if name == argument.name:
            if argument.star == "**":
                named[str(STARS.get(surface.name, {}).get(name, "option"))] = value
            elif argument.star == "*" or parameter.kind is parameter.POSITIONAL_ONLY:
                positional.append(value)
            else:
                named[name] = value
        elif name in others:
            if parameter.kind is parameter.VAR_POSITIONAL:
                positional.extend(others[name])
            elif parameter.kind is parameter.VAR_KEYWORD:
                named.update(others[name])
            elif parameter.kind is parameter.POSITIONAL_ONLY:
                positional.append(others[name])
            else:
                named[name] = others[name]

    def call() -> None:
        result = function(*positional, **named)
        if inspect.isgenerator(result):
            next(result)
        elif surface.name in ("objective", "constraint", "step_objective"):
            result(lambda motion: motion.q)

    return call


def _judge_message(case: Case, message: str) -> Outcome:
    faults = message_faults(message, is_named=_is_named(case, message))
    words = f"{', '.join(faults)}: {message}" if faults else message
    return Outcome(verdict="poor" if faults else "good", words=words)


def _is_named(case: Case, message: str) -> bool:
    argument = case.bad.argument
    names = {argument.name, argument.name.replace("_", " "), argument.name.removesuffix("s")}
    if argument.star:
        names.add(str(STARS.get(case.surface.name, {}).get(argument.name, "option")))
    if argument.is_unnamed or argument == case.surface.arguments[0]:
        names.add(case.surface.name.rpartition(".")[2])
    names.update(PARTS.get(f"{case.surface.name}({argument.name})", ()))
    value = case.bad.fault.make(Path.cwd())
    is_told = "/" in message or (isinstance(value, str) and " ".join(value.split()) in message)
    if "path" in argument.kinds and is_told:
        return True  # a file is named by its path
    return any(re.search(rf"\b{re.escape(name)}\b", message, re.IGNORECASE) for name in names)
