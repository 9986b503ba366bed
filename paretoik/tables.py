"""Tables of text: aligned columns for a terminal, and HTML for a notebook."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

Rows = Sequence[Sequence[str]]


def columns(rows: Rows) -> str:
    """Return rows of cells as lines with aligned columns."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return "\n".join(
        "  ".join(f"{cell:<{width}}" for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows
    )


def html_table(rows: Rows, *, caption: str = "") -> str:
    """Return rows of cells as an HTML table, the first its head; every cell is text.

    >>> html_table([["a", "b"], ["1 < 2", ""]])
    '<table><thead><tr><th>a</th><th>b</th></tr></thead><tbody><tr><td>1 &lt; 2</td><td></td></tr></tbody></table>'
    """
    head, *body = ["".join(f"<{kind}>{escape(cell)}</{kind}>" for cell in row) for kind, row in _kinds(rows)]
    lines = "".join(f"<tr>{line}</tr>" for line in body)
    title = f"<caption>{escape(caption)}</caption>" if caption else ""
    return f"<table>{title}<thead><tr>{head}</tr></thead><tbody>{lines}</tbody></table>"


def html_text(text: str) -> str:
    """Return text as HTML that keeps its lines and columns, long ones wrapped."""
    return f'<pre style="white-space: pre-wrap">{escape(text)}</pre>'


def html_representation(item: object) -> str:
    """Return what a notebook shows of an item: its text."""
    return html_text(repr(item))


def _kinds(rows: Rows) -> list[tuple[str, Sequence[str]]]:
    return [("th" if place == 0 else "td", row) for place, row in enumerate(rows)]
