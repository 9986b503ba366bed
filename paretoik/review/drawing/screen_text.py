"""Words as the viewer can show them: it ends at a character that its only font (Inter) has not."""

from __future__ import annotations

import re
from collections.abc import Sequence

SYMBOLS = frozenset("•…–—“”‰€−×·≤≥≈≠→←↑↓∂∞√∫∑●■▲○◆″°")
BLOCKS = ((0x20, 0x7E), (0xA0, 0x24F), (0x391, 0x3CE), (0x410, 0x44F), (0x2080, 0x2089), (0x2074, 0x207B))
SUPERSCRIPTS = frozenset("⁰ⁱ")


def screen_text(words: str) -> str:
    """Return `words` with a question mark for every character that the viewer cannot draw.

    >>> screen_text("energy [N²m²s], 能")
    'energy [N²m²s], ?'
    """
    return "".join(character if _is_drawable(character) else "?" for character in words)


def unbroken_units(words: str, units: Sequence[str]) -> str:
    r"""Return `words` in which no line ends between a number and its unit, or within a unit.

    >>> unbroken_units("it has 0.5 J s", ["J s"])
    'it has 0.5\xa0J\xa0s'
    """
    for unit in sorted(set(filter(None, units)), key=len, reverse=True):
        words = re.sub(rf"(?<=\d) {re.escape(unit)}", f"\u00a0{unit.replace(' ', chr(0xA0))}", words)
    return words


def entity_names(names: Sequence[str]) -> list[str]:
    """Return `names` as parts of entity paths: drawable, and still different from each other.

    >>> entity_names(["能", "量", "jerk"])
    ['?', '? (2)', 'jerk']
    """
    drawable = [screen_text(name) for name in names]
    before = [drawable[:place].count(name) for place, name in enumerate(drawable)]
    return [f"{name} ({count + 1})" if count else name for name, count in zip(drawable, before, strict=True)]


def _is_drawable(character: str) -> bool:
    code = ord(character)
    return (
        character in SYMBOLS
        or character in SUPERSCRIPTS
        or character == "\n"
        or any(low <= code <= high for low, high in BLOCKS)
    )
