"""Whoever misspells an argument of a public name, leaves one out or gives one too many is told so in one line."""

from __future__ import annotations

import inspect
from collections.abc import Iterator

import pytest

import paretoik as pk
from paretoik.inputs import check_call
from studies.benchmarks.reliability.inputs.messages import message_faults
from studies.benchmarks.reliability.inputs.surfaces import members

NAMESPACES = [name for name in pk.__all__ if inspect.ismodule(getattr(pk, name)) and name != "errors"]


def callables() -> Iterator[tuple[str, object]]:
    """Yield the public functions, the constructors of public classes, and their methods that have arguments' names."""
    for name in pk.__all__:
        item = getattr(pk, name)
        for public, each in members(name, item) if name in NAMESPACES else [(name, item)]:
            yield from of_item(public, each)


def of_item(name: str, item: object) -> Iterator[tuple[str, object]]:
    if inspect.isfunction(item):
        yield name, item
    elif inspect.isclass(item) and not issubclass(item, Exception) and not getattr(item, "_is_protocol", False):
        yield name, item
        for method, each in vars(item).items():
            function = getattr(each, "__func__", each)
            if not method.startswith("_") and inspect.isfunction(function):
                yield f"{name}.{method}", getattr(item, method)


CALLABLES = {name: each for name, each in callables() if not name.startswith("arms.Arm")}  # which is public anyway


def named(function: object) -> list[str]:
    """Return the arguments that have names, but for a method's own object."""
    parameters = inspect.signature(function).parameters.values()
    kinds = inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY
    return [each.name for each in parameters if each.kind in kinds and each.name != "self"]


def takes_any_name(function: object) -> bool:
    return any(each.kind is each.VAR_KEYWORD for each in inspect.signature(function).parameters.values())


def called(public: str) -> list[tuple[str, object]]:
    """Return the callables of a public name, itself among them."""
    return [(name, each) for name, each in CALLABLES.items() if name.partition(".")[0] == public]


def refusal(function: object, *arguments: object, **keywords: object) -> str:
    with pytest.raises(pk.InvalidInput) as refused:
        function(*arguments, **keywords)
    return str(refused.value)


def test_the_public_names_are_all_here():
    assert {"solve", "Tracking", "Arm.planar", "Front.select", "methods.Nedungadi", "obstacles.Box"} <= set(CALLABLES)
    assert len(CALLABLES) > 150


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize("public", sorted({name.partition(".")[0] for name in CALLABLES}))
def test_a_misspelt_argument_is_refused_by_name_with_the_nearest(public):
    for name, function in called(public):
        for argument in [] if takes_any_name(function) else named(function) or [""]:
            message = refusal(function, **{f"{argument}x": 1})
            assert not message_faults(message, is_named=name.rpartition(".")[2] in message)
            assert f"{argument}x'" in message
            assert "did you mean" in message or len(argument) < 2


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize("public", sorted({name.partition(".")[0] for name in CALLABLES}))
def test_arguments_that_are_missing_or_too_many_are_refused_in_one_line(public):
    for name, function in called(public):
        parameters = inspect.signature(function).parameters.values()
        positional = [each for each in parameters if each.kind in (each.POSITIONAL_ONLY, each.POSITIONAL_OR_KEYWORD)]
        if not any(each.kind is each.VAR_POSITIONAL for each in parameters):
            message = refusal(function, *[None] * (len(positional) + 1))
            assert not message_faults(message, is_named=name.rpartition(".")[2] in message)
        required = [each for each in parameters if each.default is each.empty and each.kind is each.KEYWORD_ONLY]
        if required:
            message = refusal(function, *[None] * len(positional))
            assert not message_faults(message, is_named=required[0].name in message)


def test_what_a_function_itself_raises_passes():
    @check_call
    def add(a: int) -> int:
        return a + "b"

    with pytest.raises(TypeError, match="unsupported operand"):
        add(1)
