"""Text for a screen: aligned columns, fields, and HTML for notebooks."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, dataclass, fields, is_dataclass
from html import escape
from typing import Any, TypeVar

import numpy as np

Rows = Sequence[Sequence[str]]
Item = TypeVar("Item")


@dataclass(frozen=True, kw_only=True)
class ScreenOptions:
    """Maximum sizes of an item's text.

    lines: number of lines
    width: characters of a line
    value: characters of a field
    numbers: numbers of an array; a longer array is shown by its range
    """

    lines: int = 25
    width: int = 120
    value: int = 90
    numbers: int = 8


SCREEN = ScreenOptions()


def columns(rows: Rows) -> str:
    """Return rows of cells as lines with aligned columns."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return "\n".join(
        "  ".join(f"{cell:<{width}}" for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows
    )


def html_table(rows: Rows, *, caption: str = "") -> str:
    """Return rows of cells as an HTML table.

    The first row is the head of the table. Cells are text, not HTML.

    >>> html_table([["a", "b"], ["1 < 2", ""]])
    '<table><thead><tr><th>a</th><th>b</th></tr></thead><tbody><tr><td>1 &lt; 2</td><td></td></tr></tbody></table>'
    """
    kinds = ["th", *["td"] * (len(rows) - 1)]
    head, *body = [
        "".join(f"<{kind}>{escape(cell)}</{kind}>" for cell in row) for kind, row in zip(kinds, rows, strict=True)
    ]
    lines = "".join(f"<tr>{line}</tr>" for line in body)
    title = f"<caption>{escape(caption)}</caption>" if caption else ""
    return f"<table>{title}<thead><tr>{head}</tr></thead><tbody>{lines}</tbody></table>"


def html_text(text: str) -> str:
    """Return text as HTML that keeps lines and columns. Long lines are wrapped."""
    return f'<pre style="white-space: pre-wrap">{escape(text)}</pre>'


def html_representation(item: object) -> str:
    """Return an item's text as HTML for a notebook."""
    return html_text(repr(item))


def represented(kind: type[Item]) -> type[Item]:
    """Give a dataclass a text that lists its fields, in notebooks too; return it."""
    kind.__repr__ = field_representation  # type: ignore[method-assign]
    kind._repr_html_ = html_representation  # type: ignore[attr-defined]
    return kind


def fit_screen(text: str) -> str:
    """Return text that fits a screen.

    Long lines are wrapped between words, and lines that do not fit are only counted.

    >>> print(fit_screen("limits  " + ", ".join(f"joint{i}" for i in range(20))))
    limits  joint0, joint1, joint2, joint3, joint4, joint5, joint6, joint7, joint8, joint9, joint10, joint11, joint12,
            joint13, joint14, joint15, joint16, joint17, joint18, joint19
    """
    lines = wrap_text(text, SCREEN.width).splitlines()
    if len(lines) > SCREEN.lines:
        lines[SCREEN.lines - 1 :] = [f"... and {len(lines) - SCREEN.lines + 1} more lines"]
    return "\n".join(lines)


def wrap_text(text: str, width: int) -> str:
    """Wrap lines to a width; continuation lines begin below the second column, or a bullet's text."""
    lines = list[str]()
    for line in text.splitlines():
        if len(line) <= width:
            lines.append(line)
            continue
        label = re.match(r"\s*\S+\s{2,}|\s*(?:- )?", line)
        indent = " " * min(label.end() if label is not None else 0, width // 2)
        lines += textwrap.wrap(line, width, subsequent_indent=indent, break_on_hyphens=False, replace_whitespace=False)
    return "\n".join(lines)


def field_representation(item: Any) -> str:
    """Return a dataclass or named tuple as text that fits a screen.

    Fields that have their default value are left out, and long arrays are shown by their shapes.

    >>> from paretoik.capability import MotorCurve
    >>> MotorCurve(stall=[1.0, 2.0], fastest=[3.0, 4.0])
    MotorCurve(stall=[1, 2], fastest=[3, 4])
    """
    values = {each.name: getattr(item, each.name) for each in fields(item)} if is_dataclass(item) else item._asdict()
    for each in fields(item) if is_dataclass(item) else ():
        value = values[each.name]
        if each.default is not MISSING:
            is_default = value is each.default or (isinstance(value, int | float | str) and value == each.default)
        else:  # default_factory makes a default for each object
            is_default = each.default_factory is not MISSING and not (isinstance(value, np.ndarray) or value)
        if is_default:
            del values[each.name]
    name, parts = type(item).__name__, [f"{field}={_brief(value)}" for field, value in values.items()]
    line = f"{name}({', '.join(parts)})"
    if len(line) <= SCREEN.width and "\n" not in line:
        return line
    return fit_screen("\n".join([name, columns([(f"  {field}", _brief(value)) for field, value in values.items()])]))


def _brief(value: object) -> str:
    """Return a value in one line. A short array is shown by its numbers, a long one by its shape and range."""
    if isinstance(value, np.ndarray):
        kind = value.dtype.kind
        if value.ndim <= 1 and value.size <= SCREEN.numbers:
            return "[" + ", ".join(f"{each:.4g}" if kind == "f" else str(each) for each in value.ravel()) + "]"
        finite = value[np.isfinite(value)] if kind in "iuf" else value[:0]
        extent = f", {finite.min():.4g} to {finite.max():.4g}" if finite.size else ""
        return f"{value.dtype} {value.shape}{extent}"
    if isinstance(value, float):
        return f"{value:.6g}"
    text = repr(value)
    if "\n" not in text and len(text) <= SCREEN.value and "array(" not in text:
        return text
    if is_dataclass(value) and "array(" in text:  # a class without its own representation
        return type(value).__name__
    if isinstance(value, Sequence | Mapping) and not isinstance(value, str):
        return f"{len(value)} of {type(value).__name__}"
    return text.splitlines()[0][: SCREEN.value].rstrip("(,[ ")
