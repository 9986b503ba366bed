"""The one compiled loop that runs programs."""

from __future__ import annotations

import numpy as np

from paretoik.autodiff.evaluator import Fused
from paretoik.autodiff.sine_cosine import cosines, sines, waves
from paretoik.autodiff.tape import Op
from paretoik.compilation import compiled

ADD, SUBTRACT, MULTIPLY, DIVIDE, NEGATE = (int(op) for op in (Op.ADD, Op.SUBTRACT, Op.MULTIPLY, Op.DIVIDE, Op.NEGATE))
MULTIPLY_ADD, MULTIPLY_SUBTRACT, SUBTRACT_PRODUCT, SINE_COSINE = (int(op) for op in Fused)
SINE, COSINE, SQUARE_ROOT = int(Op.SINE), int(Op.COSINE), int(Op.SQUARE_ROOT)
ABSOLUTE, SIGN, MAXIMUM, MINIMUM = int(Op.ABSOLUTE), int(Op.SIGN), int(Op.MAXIMUM), int(Op.MINIMUM)
LESS, LESS_EQUAL, CHOOSE, WEIGH = int(Op.LESS), int(Op.LESS_EQUAL), int(Op.CHOOSE), int(Op.WEIGH)
EXPONENTIAL, LOGARITHM, TANH, POWER = int(Op.EXPONENTIAL), int(Op.LOGARITHM), int(Op.TANH), int(Op.POWER)
ARC_TANGENT, ARC_SINE, ARC_COSINE = int(Op.ARC_TANGENT), int(Op.ARC_SINE), int(Op.ARC_COSINE)


@compiled
def run(parts, given, found):
    """Run a program over all lanes: ``given`` (inputs, lanes) to ``found`` (outputs, lanes)."""
    run_first(parts, given, found, given.shape[1])


@compiled
def run_first(parts, given, found, lanes):
    """Run a program over the first ``lanes``."""
    code, constants, inputs, outputs, space = parts
    width, loaded = space.shape[1], inputs.shape[0]
    for j in range(constants.shape[0]):
        for lane in range(width):
            space[loaded + j, lane] = constants[j]
    for start in range(0, lanes, width):
        n = min(width, lanes - start)
        for j in range(loaded):
            row = inputs[j]
            for lane in range(n):
                space[j, lane] = given[row, start + lane]
        block(code, space, n)
        for j in range(outputs.shape[0]):
            row = outputs[j]
            for lane in range(n):
                found[j, start + lane] = space[row, lane]


@compiled
def block(code, space, n):
    """Run a program on the first ``n`` lanes of its registers."""
    for step in range(code.shape[0]):
        op, to, a, b, c = code[step, 0], code[step, 1], code[step, 2], code[step, 3], code[step, 4]
        if op == MULTIPLY:
            for lane in range(n):
                space[to, lane] = space[a, lane] * space[b, lane]
        elif op == MULTIPLY_ADD:
            for lane in range(n):
                space[to, lane] = space[a, lane] * space[b, lane] + space[c, lane]
        elif op == MULTIPLY_SUBTRACT:
            for lane in range(n):
                space[to, lane] = space[a, lane] * space[b, lane] - space[c, lane]
        elif op == SUBTRACT_PRODUCT:
            for lane in range(n):
                space[to, lane] = space[c, lane] - space[a, lane] * space[b, lane]
        elif op == ADD:
            for lane in range(n):
                space[to, lane] = space[a, lane] + space[b, lane]
        elif op == SUBTRACT:
            for lane in range(n):
                space[to, lane] = space[a, lane] - space[b, lane]
        elif op == NEGATE:
            for lane in range(n):
                space[to, lane] = -space[a, lane]
        elif op == DIVIDE:
            for lane in range(n):
                space[to, lane] = space[a, lane] / space[b, lane]
        elif op == SINE_COSINE:
            waves(space[to], space[b], space[a], n)
        elif op == SINE:
            sines(space[to], space[a], n)
        elif op == COSINE:
            cosines(space[to], space[a], n)
        elif op == SQUARE_ROOT:
            for lane in range(n):
                space[to, lane] = np.sqrt(space[a, lane])
        else:
            _rare(op, space[to], space[a], space[b], space[c], n)


@compiled
def _rare(op, to, a, b, c, n):
    for lane in range(n):
        x, y = a[lane], b[lane]
        if op == ABSOLUTE:
            to[lane] = abs(x)
        elif op == SIGN:
            to[lane] = np.sign(x)
        elif op == MAXIMUM:
            to[lane] = x if x >= y or x != x else y  # NaN wins, as in NumPy
        elif op == MINIMUM:
            to[lane] = x if x <= y or x != x else y
        elif op == LESS:
            to[lane] = 1.0 if x < y else 0.0
        elif op == LESS_EQUAL:
            to[lane] = 1.0 if x <= y else 0.0
        elif op == CHOOSE:
            to[lane] = y if x != 0.0 else c[lane]
        elif op == WEIGH:
            to[lane] = x * y if x != 0.0 else 0.0
        elif op == EXPONENTIAL:
            to[lane] = np.exp(x)
        elif op == LOGARITHM:
            to[lane] = np.log(x)
        elif op == TANH:
            to[lane] = np.tanh(x)
        elif op == POWER:
            to[lane] = x**y
        elif op == ARC_TANGENT:
            to[lane] = np.arctan2(x, y)
        elif op == ARC_SINE:
            to[lane] = np.arcsin(x)
        elif op == ARC_COSINE:
            to[lane] = np.arccos(x)
