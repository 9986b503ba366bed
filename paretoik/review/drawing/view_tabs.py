"""Tabs of views whose names can all be read."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import TypeAlias

import rerun.blueprint as rrb

from paretoik.review.drawing_options import VIEWS

Group: TypeAlias = tuple[str, list[int]]  # the name of a tab, and the numbers of its views


def fitting_tabs(views: Sequence[rrb.View], width: float) -> rrb.Tabs:
    """Return views as tabs in a column so many pixels wide.

    Where their names do not fit, they lose their units, which their axes have; then views whose names begin with one
    word become tabs of a tab, which is called that; at last the longest names are cut.
    """
    names, groups = _arrange([str(view.name) for view in views], width)
    tabs = list[rrb.View | rrb.Tabs]()
    for view, name in zip(views, names, strict=True):
        view.name = name
    for name, members in groups:
        group = [views[number] for number in members]
        if len(group) == 1:
            group[0].name = name
        tabs.append(group[0] if len(group) == 1 else rrb.Tabs(*group, name=name))
    return rrb.Tabs(*tabs)


def nested_tabs(names: Sequence[str], width: float) -> list[bool]:
    """Say which views of these names become tabs of a tab in a column so many pixels wide, below two rows of names."""
    nested = {number for _, members in _arrange(names, width)[1] if len(members) > 1 for number in members}
    return [number in nested for number in range(len(names))]


def _arrange(names: Sequence[str], width: float) -> tuple[list[str], list[Group]]:
    """Return the names of views as they are shown, and the tabs."""
    room, shown = width - VIEWS.tab_controls, list(names)
    if _width(shown) > room:
        shown = [_without_unit(name) for name in shown]
    groups: list[Group] = [(name, [number]) for number, name in enumerate(shown)]
    for word, count in Counter(_first_word(name) for name in shown).most_common():
        if count > 1 and _width([name for name, _ in groups]) > room:
            groups = _grouped(groups, shown, word)
    tabs = [name for name, _ in groups]
    while _width(tabs) > room and max(map(len, tabs)) > 2:
        longest = tabs.index(max(tabs, key=len))
        tabs[longest] = tabs[longest].rstrip("…")[:-1] + "…"
    return shown, [(name, members) for name, (_, members) in zip(tabs, groups, strict=True)]


def _width(names: Sequence[str]) -> float:
    return sum(VIEWS.tab_margin + VIEWS.tab_character * len(name) for name in names)


def _without_unit(name: str) -> str:
    """Return a name without what stands in brackets.

    >>> _without_unit("best speed [m/s] ↑")
    'best speed ↑'
    """
    before, bracket, after = name.partition(" [")
    return before + after.partition("]")[2] if bracket else name


def _first_word(name: str) -> str:
    return name.split(" ")[0]


def _grouped(groups: Sequence[Group], names: Sequence[str], word: str) -> list[Group]:
    """Return groups in which the views whose names begin with a word are one, called that, where its first was."""
    members = [number for number, name in enumerate(names) if _first_word(name) == word]
    joined: list[Group] = []
    for group in groups:
        if group[1][0] not in members:
            joined.append(group)
        elif group[1][0] == members[0]:
            joined.append((word, members))
    return joined
