"""Time laws: how much of a path is covered when."""

from __future__ import annotations

from typing import Literal, TypeAlias, get_args

import numpy as np
from jaxtyping import Float

from paretoik.inputs import check_choice

TimeLaw: TypeAlias = Literal["raised-cosine", "quintic", "uniform"]
TIME_LAWS: tuple[TimeLaw, ...] = get_args(TimeLaw)


def progress(t: Float[np.ndarray, "*batch"], duration: float, law: str) -> Float[np.ndarray, "*batch"]:
    """Fraction of the path covered at times ``t`` in [0, duration] [s], from exactly 0 to exactly 1.

    - ``"raised-cosine"``: the first half accelerates with (4/T²)(1 - cos(4πt/T)), the second brakes likewise;
      acceleration and jerk are continuous and zero at 0, T/2 and T; peak speed 2/T, peak acceleration 8/T². Tringali
      and Cocuzza (2020), Eq. 19 with the factor ½ that it lost; (2021), Eq. 5.
    - ``"quintic"``: 10τ³ - 15τ⁴ + 6τ⁵ with τ = t/T, the least squared jerk from rest to rest; peak speed 15/(8T).
    - ``"uniform"``: τ.

    Raises InvalidInput for an unknown law.

    >>> progress(np.array([0.0, 0.5, 1.0, 2.0]), duration=2.0, law="quintic").round(6)
    array([0.      , 0.103516, 0.5     , 1.      ])
    """
    check_law(law)
    fraction = np.asarray(t, dtype=float) / duration
    if law == "uniform":
        return fraction
    from_nearer_end = np.minimum(fraction, 1 - fraction)  # both laws are s(1 - τ) = 1 - s(τ): exact at both ends
    if law == "quintic":
        half = from_nearer_end**3 * (10 + from_nearer_end * (6 * from_nearer_end - 15))
    else:
        half = 2 * from_nearer_end**2 - (np.sin(2 * np.pi * from_nearer_end) / np.pi) ** 2 / 2
    covered: np.ndarray = np.where(fraction <= 0.5, half, 1 - half)
    return covered


def progress_rates(
    t: Float[np.ndarray, "*batch"], duration: float, law: str
) -> tuple[Float[np.ndarray, "*batch"], Float[np.ndarray, "*batch"]]:
    """First and second time derivatives [1/s, 1/s²] of ``progress`` at times ``t`` in [0, duration] [s].

    Raises InvalidInput for an unknown law.
    """
    check_law(law)
    fraction = np.asarray(t, dtype=float) / duration
    if law == "uniform":
        return np.full_like(fraction, 1 / duration), np.zeros_like(fraction)
    from_nearer_end = np.minimum(fraction, 1 - fraction)
    if law == "quintic":
        product = from_nearer_end * (1 - from_nearer_end)
        speed, acceleration = 30 * product**2, 60 * product * (1 - 2 * from_nearer_end)
    else:
        angle = 4 * np.pi * from_nearer_end
        speed, acceleration = 4 * from_nearer_end - np.sin(angle) / np.pi, 8 * np.sin(angle / 2) ** 2
    signs = np.where(fraction <= 0.5, 1.0, -1.0)  # s(τ) = 1 - s(1 - τ): its speed is even about the middle
    return speed / duration, signs * acceleration / duration**2


def check_law(law: str) -> None:
    """Refuse an unknown law."""
    check_choice("timing:", law, TIME_LAWS)
