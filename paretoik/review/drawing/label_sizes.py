"""How large the labels of marks are, as the viewer draws them: words on a plate, whose letters differ in width."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float


@dataclass(frozen=True, kw_only=True)
class LabelOptions:
    """Sizes of labels [pixels], measured in pictures of the viewer.

    ``letters`` are widths of letters as shares of the ``height`` of the viewer's font, Inter; capitals, figures and
    letters that are in none of the groups have the ``usual`` one. Lines are ``line`` apart, and the plate is larger
    than the words by ``padding`` across and upwards. A label takes ``reserve`` times as much of a frame that a smaller
    window draws smaller, since it is as large as ever.
    """

    height: float = 12.5
    letters: tuple[tuple[float, str], ...] = (
        (0.24, "ijlI'"),
        (0.28, " .,:;!·"),
        (0.365, "frt()[]{}/|"),
        (0.45, "1-_²³"),
        (0.55, "aceksvxyzε?"),
        (0.66, "ABKPRSTVXY+<=>≤≥~"),
        (0.74, "CDGHNOQU"),
        (0.87, "mwMW%@↑"),
    )
    usual: float = 0.61
    line: float = 15.0
    padding: tuple[float, float] = (11.0, 8.0)
    reserve: float = 1.06


LABEL = LabelOptions()


def plate_half(words: str) -> Float[np.ndarray, " 2"]:
    """Return half the width and height of a label's plate [pixels]."""
    lines = words.split("\n")
    size = max(map(_width, lines)), LABEL.line * len(lines)
    return 0.5 * (np.array(size) + LABEL.padding)


def half_size(words: str) -> Float[np.ndarray, " 2"]:
    """Return half the width and height that a label needs [pixels], also in a smaller window."""
    return LABEL.reserve * plate_half(words)


def below_first(words: str) -> float:
    """Return how far the middle of words lies below that of their first line [pixels]."""
    return 0.5 * LABEL.line * words.count("\n")


def _width(line: str) -> float:
    """Return how wide a line of words is [pixels]."""
    shares = (next((share for share, group in LABEL.letters if letter in group), LABEL.usual) for letter in line)
    return LABEL.height * sum(shares)
