"""Tabs of views whose names can all be read."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import rerun.blueprint as rrb

from paretoik.review.drawing_options import VIEWS


def fitting_tabs(views: Sequence[rrb.View], width: float) -> rrb.Tabs:
    """Return views as tabs in a column so many pixels wide.

    Where their names do not fit, they lose their units, which their axes have; then views whose names begin with one
    word become tabs of a tab, which is called that; at last the longest names are cut.
    """
    room, shown = width - VIEWS.tab_controls, list(views)
    if _width([str(view.name) for view in shown]) > room:
        for view in shown:
            view.name = _without_unit(str(view.name))
    groups: dict[str, list[rrb.View]] = {str(view.id): [view] for view in shown}
    for word, count in Counter(str(view.name).split(" ")[0] for view in shown).most_common():
        names = [_name(group, key) for key, group in groups.items()]
        if count > 1 and _width(names) > room:
            groups = _grouped(groups, word)
    names = [_name(group, key) for key, group in groups.items()]
    while _width(names) > room and max(map(len, names)) > 2:
        longest = names.index(max(names, key=len))
        names[longest] = names[longest].rstrip("…")[:-1] + "…"
    tabs = list[rrb.View | rrb.Tabs]()
    for name, group in zip(names, groups.values(), strict=True):
        if len(group) == 1:
            group[0].name = name
        tabs.append(group[0] if len(group) == 1 else rrb.Tabs(*group, name=name))
    return rrb.Tabs(*tabs)


def _width(names: Sequence[str]) -> float:
    return sum(VIEWS.tab_margin + VIEWS.tab_character * len(name) for name in names)


def _without_unit(name: str) -> str:
    """Return a name without what stands in brackets.

    >>> _without_unit("best speed [m/s] ↑")
    'best speed ↑'
    """
    before, bracket, after = name.partition(" [")
    return before + after.partition("]")[2] if bracket else name


def _name(group: Sequence[rrb.View], key: str) -> str:
    return str(group[0].name) if len(group) == 1 else key


def _grouped(groups: dict[str, list[rrb.View]], word: str) -> dict[str, list[rrb.View]]:
    """Return groups in which those of names that begin with a word are one, called that, where its first was."""
    joined: dict[str, list[rrb.View]] = {}
    for key, group in groups.items():
        same = str(group[0].name).split(" ")[0] == word
        joined.setdefault(word if same else key, []).extend(group)
    return joined
