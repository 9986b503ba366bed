"""Arrays of samples, their traced arrays, and the numbers of traced arrays."""

from __future__ import annotations

import numpy as np

from paretoik.autodiff.evaluator import compile_evaluator
from paretoik.autodiff.tape import as_entry
from paretoik.autodiff.tracing import Trace

SAMPLES = 6
RNG = np.random.default_rng(0)
Q, V, R = (RNG.normal(size=(SAMPLES, *shape)) for shape in ((3,), (3,), (3, 3)))
ROW, TABLE = RNG.normal(size=3), RNG.normal(size=(SAMPLES, 3))
TIME = np.linspace(0.0, 1.0, SAMPLES)
TURNS = RNG.normal(size=(SAMPLES, 3, 3))


def traced(*arrays, samples=SAMPLES):
    """Return a trace and a traced array for each given array (time, ...)."""
    trace = Trace(samples)
    return trace, [trace.inputs(*(array.shape[1:] if samples else array.shape)) for array in arrays]


def numbers(trace, array, *sources):
    """Return the numbers of a traced array for given numbers of the traced inputs."""
    lanes = SAMPLES if trace.samples else 1
    rows = np.zeros((len(trace.tape.inputs), lanes))
    begun = 0
    for source in sources:
        flat = source.reshape(lanes, -1).T
        rows[begun : begun + len(flat)] = flat
        begun += len(flat)
    for i, values in trace.parameters.items():
        rows[trace.tape.entries[i][1]] = values
    outputs = [as_entry(trace.tape, value) for value in array.entries.ravel()]
    return compile_evaluator(trace.tape, outputs)(rows).T.reshape(array.shape)
