"""Random expressions: functions of three numbers that run on NumPy arrays and on a tape."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st

from paretoik.autodiff.evaluator import compile_evaluator
from paretoik.autodiff.tape import Tape

VARIABLES = 3
SMOOTH = {
    "add": lambda a, b: a + b,
    "subtract": lambda a, b: a - b,
    "multiply": lambda a, b: a * b,
    "divide": lambda a, b: a / (b * b + 0.5),
    "negative": lambda a, b: -a,
    "sin": lambda a, b: np.sin(a),
    "cos": lambda a, b: np.cos(a),
    "tan": lambda a, b: np.tan(np.tanh(a)),
    "sqrt": lambda a, b: np.sqrt(a * a + 0.5),
    "exp": lambda a, b: np.exp(np.tanh(a)),
    "log": lambda a, b: np.log(a * a + 0.5),
    "arcsin": lambda a, b: np.arcsin(0.9 * np.tanh(a)),
    "arccos": lambda a, b: np.arccos(0.9 * np.tanh(a)),
    "sinh": lambda a, b: np.sinh(np.tanh(a)),
    "power": lambda a, b: (a * a + 0.5) ** 1.7,
    "cube": lambda a, b: np.tanh(a) ** 3,
    "inverse square": lambda a, b: (a * a + 0.5) ** -2,
    "power of both": lambda a, b: (a * a + 0.5) ** np.tanh(b),
}
KINKED = {
    "arctan2": lambda a, b: np.arctan2(a, b * b + 0.5),  # smooth, but not for NumPy's complex numbers
    "hypot": lambda a, b: np.hypot(a, b),
    "absolute": lambda a, b: np.abs(a),
    "maximum": lambda a, b: np.maximum(a, b),
    "minimum": lambda a, b: np.minimum(a, b),
    "sign": lambda a, b: np.sign(a) * a,
    "fmax": lambda a, b: np.fmax(a, 0.3),
}


def trees(functions):
    """Draw functions of (x, y, z), composed of these functions, the variables and a few numbers."""
    variables = [lambda *coordinates, i=i: coordinates[i] for i in range(VARIABLES)]
    numbers = [lambda *coordinates, c=c: c for c in (0.0, 1.0, -1.0, 0.5, 3.0)]
    leaves = st.sampled_from([*variables, *variables, *numbers])

    def joined(children):
        return st.builds(
            lambda f, one, other: lambda *coordinates: f(one(*coordinates), other(*coordinates)),
            st.sampled_from(list(functions.values())),
            children,
            children,
        )

    return st.recursive(leaves, joined, max_leaves=10)


def taped(function):
    """Return a tape, the entry of a function's value on it and its variables."""
    tape = Tape()
    variables = [tape.input() for _ in range(VARIABLES)]
    value = np.positive(function(*variables) + 0.0 * variables[0])
    return tape, value.index, [variable.index for variable in variables]


def evaluated(tape, outputs, inputs):
    return compile_evaluator(tape, list(outputs))(np.atleast_2d(np.asarray(inputs, dtype=float)))


def points(seed, lanes=7):
    """Return (variables, lanes): places that avoid systematic kinks."""
    return np.random.default_rng(seed).uniform(-2, 2, size=(VARIABLES, lanes))


seeds = st.integers(0, 2**32 - 1)
