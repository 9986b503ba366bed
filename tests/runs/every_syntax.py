"""A user's module with most of Python's syntax, whose fingerprint every version of Python must agree on."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum
from functools import cached_property, lru_cache, partial, wraps

import numpy as np

SCALE = 2.0
TABLE = {"a": 1.0, "b": [1, 2]}


class Color(Enum):
    RED = 1
    BLUE = 2


@dataclass(frozen=True)
class Weights:
    first: float = 0.3
    others: tuple[float, ...] = (1.0, 2.0)
    names: list[str] = field(default_factory=lambda: ["a", "b"])

    def total(self):
        return self.first + sum(self.others)


WEIGHTS = Weights()


def twice(function):
    @wraps(function)
    def inner(*arguments, **named):
        return function(*arguments, **named) * 2

    return inner


@twice
def helper(x: int, *arguments, flag=True, **named) -> float:
    """Return something."""
    y: float = np.abs(x) * SCALE
    try:
        z = [f"{v!r:>{3}} {v=}and" for v in (1, 2) if v]
    except (ValueError, TypeError) as error:
        raise RuntimeError from error
    match x:
        case [1, *others]:
            return others
        case {"a": 1}:
            return 3
        case _:
            pass

    class Local:
        """Local."""

        attribute = SCALE

        def method(self):
            return super().__init__()

    async def numbers():
        async with x as opened:
            yield {k: v async for k, v in opened}

    if (n := len(z)) > 3:
        del z[0]
    return -(y**2) if n else (lambda q: q[1:2, ...])(y), Local, numbers


@lru_cache
def remembered(n):
    return n * 7


def factory(gain):
    count = 0

    def scaled(m):
        nonlocal count
        count += 1
        return gain * m

    return scaled


def cost(m, p=2, *, floor=0.5):
    few = sum(x for x in range(3) if x > SCALE)
    return helper(m) ** p + remembered(2) + len(TABLE) + WEIGHTS.total() + few + floor


class Base:
    __slots__ = ("size",)

    def __init__(self):
        self.size = 1


class Mine(Base):
    offset: float = 1.0

    def __init__(self):
        super().__init__()
        self.numbers, self.count = np.arange(3), 0

    @cached_property
    def late(self):
        return 1

    @property
    def same(self):
        return self.offset

    @staticmethod
    def double(x):
        return 2 * x

    @classmethod
    def kind(cls):
        return cls

    def evaluate(self, x):
        self.count += 1
        return __class__, self.double(x)


EVERYTHING = [cost, factory(1.5), lambda x: x + 1, partial(helper, 3.0), Mine(), WEIGHTS, Color.RED]
