"""Preferences in the form of the command line."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from paretoik.errors import InvalidInput
from paretoik.front.choice import Preference
from paretoik.front.choice_tree import present_point, read_choices
from paretoik.front.preferences import Aspiration, Bounds, Classify, Knee, Lexicographic, Robust, Weights
from paretoik.front.preferences.compromise import Compromise, Point
from paretoik.inputs import likely_spelling, shown

CLASSES = "improve, improve:VALUE, keep, relax:VALUE or free"
PREFERENCE_OF_OPTION = {"uncertainty": "robust", "from": "classify"}


def read_preference(wishes: Mapping[str, Any], *, run: Path) -> Preference:
    """Return the preference of the given options, by name.

    ``bounds`` may come with another preference, which then decides within them; ``uncertainty`` belongs to ``robust``,
    ``from`` is the point that ``classify`` starts from. Raises InvalidInput unless there is exactly one preference.
    """
    accuracy = {"uncertainty": wishes["uncertainty"]} if "uncertainty" in wishes else {}
    options: dict[str, Callable[[Any], Preference]] = {
        "weights": lambda text: Weights(parse_numbers("weights", text)),
        "knee": lambda _: Knee(),
        "compromise": lambda _: Compromise(),
        "aspiration": lambda text: Aspiration(parse_numbers("aspiration", text)),
        "lexicographic": parse_lexicographic,
        "robust": lambda text: Robust(parse_numbers("robust", text), **accuracy),
        "classify": lambda text: parse_classes(text, wishes.get("from"), run),
        "point": Point,
    }
    for name, preference_name in PREFERENCE_OF_OPTION.items():
        if name in wishes and preference_name not in wishes:
            raise InvalidInput(f"{name} must come with --{preference_name}, got no --{preference_name}")
    chosen, bounds = [name for name in options if name in wishes], wishes.get("bounds")
    if len(chosen) > 1 or not (chosen or bounds):
        names = ", ".join(f"--{name}" for name in options)
        got = " and ".join(f"--{name}" for name in chosen) or "none"
        raise InvalidInput(f"preference must be one of {names}, with or without --bounds, got {got}")
    preference = options[chosen[0]](wishes[chosen[0]]) if chosen else Compromise()
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
    """Return names in order, each with a tolerance in its own unit or, with a percent sign, of its range.

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
            raise InvalidInput(f"bounds must have one bound on each side, got {name} {sign} twice")
        bounds[name] = (lower, value) if sign == "<=" else (value, upper)
    return bounds


def parse_classes(text: str, start: int | None, run: Path) -> Classify:
    """Return every objective in its class, from the point ``start`` or else the run's present choice."""
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
            raise InvalidInput(f"classify must be for {name} {CLASSES}, got {shown(kind)}{hint}")
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
