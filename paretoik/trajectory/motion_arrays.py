"""Programs of motions as arrays, for compiled solvers."""

from __future__ import annotations

import numpy as np

from paretoik.robot.kinematics import joint_scales
from paretoik.trajectory import motion_kernel as _steps  # noqa: F401  the steps of solvers on these arrays
from paretoik.trajectory.curve_states import curve_arrays
from paretoik.trajectory.kernel_arrays import MotionKernel
from paretoik.trajectory.motion_terms import MotionTerms


def motion_kernel(program: MotionTerms) -> MotionKernel:
    """Return a program of sums and peaks for interior points, with its own registers: one per thread."""
    evaluators, stencil = program.evaluators, program.stencil
    variables, auxiliary = len(program.variables), len(program.variables) - program.rates
    rows = len(program.rows) + len(program.epigraph_rows)
    row = program.limited[:, 0]
    limits = row < variables + rows  # the ties of slacks, which follow, are satisfied by definition
    row = np.where(row >= variables, row - auxiliary, row)
    row_peaks = np.full(rows, -1, dtype=np.int64)
    row_peaks[program.epigraph_rows] = program.epigraph_peaks
    # input, variable, sign and first tie of every slack, innermost first, and the depth of nested kinks
    count, first_tie = program.slacks, program.sums + len(program.rows) + len(program.epigraph_rows)
    function, variable = program.evaluators.gradient_sparsity.rows, program.evaluators.gradient_sparsity.columns
    inner = [set[int]() for _ in range(count)]
    for tie, column in zip(function - first_tie, variable - program.rates, strict=True):
        if tie >= 0 and 0 <= column < count and column != tie // 2:
            inner[tie // 2].add(int(column))
    order, depths = list[int](), dict[int, int]()
    while len(order) < count:
        for j in range(count):
            if j not in depths and inner[j] <= depths.keys():
                depths[j] = 1 + max((depths[k] for k in inner[j]), default=0)
                order.append(j)
    table = [
        (program.slack_inputs[j], program.rates + j, program.evaluators.signs[j], first_tie + 2 * j) for j in order
    ]
    kinks, nesting = np.array(table, dtype=np.int64).reshape(-1, 4), max(depths.values(), default=0)
    return MotionKernel(
        value=evaluators.value.arrays,
        slope=evaluators.gradient.arrays,
        slope_of=evaluators.gradient_sparsity.rows,
        slope_by=evaluators.gradient_sparsity.columns,
        curvature=evaluators.hessian.arrays,
        second_i=evaluators.hessian_sparsity.rows,
        second_j=evaluators.hessian_sparsity.columns,
        track=evaluators.path.arrays,
        track_curvature=evaluators.path_hessian.arrays,
        curve=curve_arrays(program.task),
        kinked=program.rates > program.states,
        neighbours=stencil.neighbours,
        coefficients=stencil.coefficients,
        first_unknown=stencil.first_unknown,
        unknowns=stencil.unknowns,
        border=stencil.border,
        stride=program.task.stride,
        stops=program.task.ties_end,
        ones=np.ones(len(program.task.instants)),
        quadrature=np.array(program.task.weights),
        inputs=program.inputs,
        multipliers=evaluators.multipliers,
        limited=np.stack([row, program.limited[:, 1]], axis=1)[limits],
        factors=program.sides[limits] / program.ranges[limits],
        bounds=program.bounds[limits],
        scales=joint_scales(program.task.arm),
        totals=np.array([each.index if each.kind == "sum" else -1 - each.index for each in program.totals]),
        peak_inputs=program.peak_inputs,
        row_peaks=row_peaks,
        kinks=kinks,
        nesting=nesting,
        smoothing=float(len(kinks) * len(program.task.instants)),
    )
