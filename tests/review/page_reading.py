"""Reads a report as a browser does: its elements, its data and its motions."""

from __future__ import annotations

import base64
import gzip
import json
from html.parser import HTMLParser
from typing import Any

import numpy as np


class Page(HTMLParser):
    """The elements of a page in order: tag, attributes and the text directly within."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str | None], list[str]]] = []
        self.open: list[int] = []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs), []))
        if tag not in ("meta", "link", "input", "br"):
            self.open.append(len(self.elements) - 1)

    def handle_endtag(self, tag: str) -> None:
        assert self.elements[self.open.pop()][0] == tag, f"</{tag}> closes another element"

    def handle_data(self, data: str) -> None:
        if self.open:
            self.elements[self.open[-1]][2].append(data)

    def texts(self, tag: str, **attributes: str) -> list[str]:
        """Return the texts of the elements of a kind."""
        return [
            "".join(text)
            for name, values, text in self.elements
            if name == tag and attributes.items() <= {k: v or "" for k, v in values.items()}.items()
        ]

    @property
    def data(self) -> dict[str, Any]:
        """The data of the scripts."""
        (text,) = self.texts("script", id="data")
        return json.loads(text)

    @property
    def table(self) -> dict[int, list[str]]:
        """The cells of each point, by id."""
        rows: dict[int, list[str]] = {}
        for name, values, text in self.elements:
            if name == "tr" and "data-id" in values:
                number = int(values["data-id"] or "")
                rows[number] = []
            elif name == "td" and rows and "class" not in values:
                rows[number].append("".join(text).strip())
        return {number: cells[1:] for number, cells in rows.items()}


def unpacked(description: dict[str, Any], block: str) -> np.ndarray:
    """Return the channels (channels, time) of a block, as page.js does."""
    planes = np.frombuffer(gzip.decompress(base64.b64decode(block)), dtype=np.uint8).astype(np.uint16)
    low, high = planes.reshape(2, len(description["low"]), description["samples"])
    whole = np.cumsum(low + 256 * high, axis=1, dtype=np.uint16)
    return np.array(description["low"])[:, None] + whole * np.array(description["step"])[:, None]
