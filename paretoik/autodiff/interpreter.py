"""The interpreter of evaluators: one compiled loop over instructions.

Each instruction runs on a block of points.
"""

from __future__ import annotations

import math

import numpy as np

from paretoik.autodiff.opcodes import Fused, Op
from paretoik.compilation.numba_cache import c_function, carray, compiled

# Sine and cosine of many numbers at once, without branches, so that the compiler can vectorise them.
#
# Angles are reduced by multiples of π/2, which has two parts, then the polynomials of fdlibm's kernels are used (Sun
# Microsystems 1993). The error is at most one unit in the last place, or 1e-20 if that is more.


MAX_REDUCED = 1e5  # rad: the reduction keeps all digits up to here; above it, math.sin and math.cos are used
ROUNDING = 6755399441055744.0  # 1.5 · 2⁵²: adding and subtracting it rounds to an integer
QUARTERS = 6.36619772367581382433e-01  # 2 / π
QUARTER, QUARTER_REST = 1.57079632673412561417e00, 6.07710050650619224932e-11  # π / 2 in two parts
S1, S2, S3 = -1.66666666666666324348e-01, 8.33333333332248946124e-03, -1.98412698298579493134e-04
S4, S5, S6 = 2.75573137070700676789e-06, -2.50507602534068634195e-08, 1.58969099521155010221e-10
C1, C2, C3 = 4.16666666666666019037e-02, -1.38888888888741095749e-03, 2.48015872894767294178e-05
C4, C5, C6 = -2.75573143513906633035e-07, 2.08757232129817482790e-09, -1.13596475577881948265e-11


@compiled
def sines_and_cosines(sine, cosine, x, n):
    """Write the sines and cosines of the first ``n`` angles [rad]."""
    if _exceeds_reduction(x, n):
        for k in range(n):
            sine[k], cosine[k] = math.sin(x[k]), math.cos(x[k])
        return
    for k in range(n):
        sine[k], cosine[k] = _sine_cosine(x[k])


@compiled
def sines(to, x, n):
    """Write the sines of the first ``n`` angles [rad]."""
    if _exceeds_reduction(x, n):
        for k in range(n):
            to[k] = math.sin(x[k])
        return
    for k in range(n):
        to[k] = _sine_cosine(x[k])[0]


@compiled
def cosines(to, x, n):
    """Write the cosines of the first ``n`` angles [rad]."""
    if _exceeds_reduction(x, n):
        for k in range(n):
            to[k] = math.cos(x[k])
        return
    for k in range(n):
        to[k] = _sine_cosine(x[k])[1]


@compiled
def _exceeds_reduction(x, n):
    largest = 0.0
    for k in range(n):
        largest = max(largest, abs(x[k]))
    return largest > MAX_REDUCED


@compiled
def _sine_cosine(x):
    k = (x * QUARTERS + ROUNDING) - ROUNDING
    near = x - k * QUARTER
    a = near - k * QUARTER_REST
    tail = (near - a) - k * QUARTER_REST  # a + tail is the reduced angle with twice the digits
    z = a * a
    v = z * a
    sine = a - ((z * (0.5 * tail - v * (S2 + z * (S3 + z * (S4 + z * (S5 + z * S6))))) - tail) - v * S1)
    half = 0.5 * z
    w = 1.0 - half
    cosine = w + (((1.0 - w) - half) + (z * (z * (C1 + z * (C2 + z * (C3 + z * (C4 + z * (C5 + z * C6)))))) - a * tail))
    quarter = k - 4.0 * np.floor(0.25 * k)
    odd = (quarter == 1.0) | (quarter == 3.0)
    first, second = (cosine, sine) if odd else (sine, cosine)
    return -first if quarter >= 2.0 else first, -second if (quarter == 1.0) | (quarter == 2.0) else second


# The interpreter: instructions, each on a block of points.


ADD, SUBTRACT, MULTIPLY, DIVIDE, NEGATE = (int(op) for op in (Op.ADD, Op.SUBTRACT, Op.MULTIPLY, Op.DIVIDE, Op.NEGATE))
MULTIPLY_ADD, MULTIPLY_SUBTRACT, SUBTRACT_PRODUCT, SINE_COSINE = (int(op) for op in Fused)
SINE, COSINE, SQUARE_ROOT = int(Op.SINE), int(Op.COSINE), int(Op.SQUARE_ROOT)
ABSOLUTE, SIGN, MAXIMUM, MINIMUM = int(Op.ABSOLUTE), int(Op.SIGN), int(Op.MAXIMUM), int(Op.MINIMUM)
LESS, LESS_EQUAL, WHERE, MASKED_MULTIPLY = (int(op) for op in (Op.LESS, Op.LESS_EQUAL, Op.WHERE, Op.MASKED_MULTIPLY))
EXPONENTIAL, LOGARITHM, TANH, POWER = int(Op.EXPONENTIAL), int(Op.LOGARITHM), int(Op.TANH), int(Op.POWER)
ARC_TANGENT, ARC_SINE, ARC_COSINE = int(Op.ARC_TANGENT), int(Op.ARC_SINE), int(Op.ARC_COSINE)


@compiled
def run(arrays, inputs, outputs):
    """Evaluate ``inputs`` (inputs, points) into ``outputs`` (outputs, points)."""
    run_first(arrays, inputs, outputs, inputs.shape[1])


@compiled
def run_first(arrays, inputs, outputs, points):
    """Evaluate at the first ``points`` points."""
    code, constants, input_rows, output_registers, registers = arrays
    width, loaded = registers.shape[1], input_rows.shape[0]
    for j in range(constants.shape[0]):
        for k in range(min((points + 7) & -8, width)):
            registers[loaded + j, k] = constants[j]
    for start in range(0, points, width):
        n = min(width, points - start)
        whole = min((n + 7) & -8, width) if n > 8 else n  # vectors of eight: copies fill the last one
        for j in range(loaded):
            _copy(inputs[input_rows[j], start:], registers[j], n)
            for k in range(n, whole):
                registers[j, k] = registers[j, n - 1]
        run_block(code, registers, whole)
        for j in range(output_registers.shape[0]):
            _copy(registers[output_registers[j]], outputs[j, start:], n)


@compiled
def _copy(values, to, n):
    for k in range(n):
        to[k] = values[k]


@compiled
def run_block(code, registers, n):
    """Execute all instructions on the first ``n`` points of the registers."""
    _run_block(code.ctypes, code.shape[0], registers.ctypes, registers.shape[0], registers.shape[1], n)


@compiled
def _piecewise_operation(op, to, a, b, c, registers, n):
    """Execute a choice, maximum, minimum or comparison in loops without branches, which are vectorised."""
    if op == WHERE:
        for k in range(n):
            registers[to, k] = registers[b, k] if registers[a, k] != 0.0 else registers[c, k]
    elif op == MAXIMUM:
        for k in range(n):
            x, y = registers[a, k], registers[b, k]
            registers[to, k] = x if (x >= y) | (x != x) else y  # NaN wins, as in NumPy
    elif op == MINIMUM:
        for k in range(n):
            x, y = registers[a, k], registers[b, k]
            registers[to, k] = x if (x <= y) | (x != x) else y
    elif op == LESS:
        for k in range(n):
            registers[to, k] = 1.0 if registers[a, k] < registers[b, k] else 0.0
    elif op == LESS_EQUAL:
        for k in range(n):
            registers[to, k] = 1.0 if registers[a, k] <= registers[b, k] else 0.0
    else:
        _rare_operation(op, registers[to], registers[a], registers[b], n)


@compiled
def _rare_operation(op, to, a, b, n):
    for k in range(n):
        x, y = a[k], b[k]
        if op == ABSOLUTE:
            to[k] = abs(x)
        elif op == SIGN:
            to[k] = np.sign(x)
        elif op == MASKED_MULTIPLY:
            to[k] = x * y if x != 0.0 else 0.0
        elif op == EXPONENTIAL:
            to[k] = np.exp(x)
        elif op == LOGARITHM:
            to[k] = np.log(x)
        elif op == TANH:
            to[k] = np.tanh(x)
        elif op == POWER:
            to[k] = x**y
        elif op == ARC_TANGENT:
            to[k] = np.arctan2(x, y)
        elif op == ARC_SINE:
            to[k] = np.arcsin(x)
        elif op == ARC_COSINE:
            to[k] = np.arccos(x)


SIGNATURE = "void(CPointer(int32), intp, CPointer(float64), intp, intp, intp)"


@c_function(SIGNATURE, what="the evaluator of expressions", seconds=2)
def _run_block(code_pointer, instructions, registers_pointer, count, width, n):
    """Execute instructions (instructions, 5) on the first ``n`` points of registers (count, width)."""
    code, registers = carray(code_pointer, (instructions, 5)), carray(registers_pointer, (count, width))
    for i in range(code.shape[0]):
        op, to, a, b, c = code[i, 0], code[i, 1], code[i, 2], code[i, 3], code[i, 4]
        if op == MULTIPLY:
            for k in range(n):
                registers[to, k] = registers[a, k] * registers[b, k]
        elif op == MULTIPLY_ADD:
            for k in range(n):
                registers[to, k] = registers[a, k] * registers[b, k] + registers[c, k]
        elif op == MULTIPLY_SUBTRACT:
            for k in range(n):
                registers[to, k] = registers[a, k] * registers[b, k] - registers[c, k]
        elif op == SUBTRACT_PRODUCT:
            for k in range(n):
                registers[to, k] = registers[c, k] - registers[a, k] * registers[b, k]
        elif op == ADD:
            for k in range(n):
                registers[to, k] = registers[a, k] + registers[b, k]
        elif op == SUBTRACT:
            for k in range(n):
                registers[to, k] = registers[a, k] - registers[b, k]
        elif op == NEGATE:
            for k in range(n):
                registers[to, k] = -registers[a, k]
        elif op == DIVIDE:
            for k in range(n):
                registers[to, k] = registers[a, k] / registers[b, k]
        elif op == SINE_COSINE:
            sines_and_cosines(registers[to], registers[b], registers[a], n)
        elif op == SINE:
            sines(registers[to], registers[a], n)
        elif op == COSINE:
            cosines(registers[to], registers[a], n)
        elif op == SQUARE_ROOT:
            for k in range(n):
                registers[to, k] = np.sqrt(registers[a, k])
        else:
            _piecewise_operation(op, to, a, b, c, registers, n)
