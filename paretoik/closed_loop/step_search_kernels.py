"""The compiled search of a control step's extended Jacobian: NSGA-II with MaxiMin.

Every seed and step has its own random stream. Objectives and distances are evaluators, so that arms, objectives and
obstacles of all kinds run through the same code. Source: Marcos et al. 2012, section 4.1.
"""

from __future__ import annotations

import numpy as np

from paretoik.autodiff.interpreter import run_first
from paretoik.closed_loop.admissible_steps import clearance_at_start, find_inadmissible, shorten
from paretoik.compilation.array_tuples import refer
from paretoik.compilation.numba_cache import compiled
from paretoik.search.maximin_kernels import (
    insertion_distances,
    keep_farthest,
    rank_points,
    select_by_distance,
    select_by_rank,
)
from paretoik.search.offspring import draw_chromosome, generate_offspring, seed_stream
from paretoik.search.sorted_points import first_front, locate, merge_children, rank_sorted

# Genes to configurations, compiled: the steps of a population's extended Jacobians (Marcos 2012, 4.1).


@compiled
def decode(genes, count, start, systems, q):
    """Write the joint positions (dof, batch) of ``count`` chromosomes (genes, batch). Source: Eqs. 7, 12 and 13.

    A step that makes Δx is Δq = particular + N y, with N the null space of the Jacobian. The rows J* Δq = Δx* of the
    extended Jacobian reduce to J* N y = Δx* − J* particular, a system of the size of the redundancy. ``systems``
    contains the matrix and the right-hand side of each, entry by entry.
    """
    previous, particular, null_space = start.previous, start.particular, start.null_space
    n, r = null_space.shape
    for i in range(r):
        rhs, row = systems[r * r + i], i * (n + 1)
        _weighted_sum(genes, row, particular, n, count, rhs)
        target = genes[row + n]
        for k in range(count):
            rhs[k] = target[k] - rhs[k]
        for j in range(r):
            _weighted_sum(genes, row, null_space[:, j], n, count, systems[i * r + j])
    _solve(systems, r, count)
    for i in range(n):
        base, positions = previous[i] + particular[i], q[i]
        for j in range(r):
            y, factor = systems[r * r + j], null_space[i, j]
            if j == 0:
                for k in range(count):
                    positions[k] = base + factor * y[k]
            else:
                for k in range(count):
                    positions[k] += factor * y[k]


@compiled
def _weighted_sum(genes, row, weights, rows, count, result):
    """Write the weighted sum of ``rows`` rows of genes, read before the loops, for vector instructions."""
    i = 0
    if rows >= 3:
        a, b, c = weights[0], weights[1], weights[2]
        row_a, row_b, row_c = genes[row], genes[row + 1], genes[row + 2]
        for k in range(count):
            result[k] = a * row_a[k] + b * row_b[k] + c * row_c[k]
        i = 3
    else:
        for k in range(count):
            result[k] = 0.0
    while i < rows:
        a, row_a = weights[i], genes[row + i]
        for k in range(count):
            result[k] += a * row_a[k]
        i += 1


@compiled
def _solve(systems, r, count):
    """Solve systems of r equations; the solutions overwrite the right-hand sides."""
    if r == 1:
        matrix, x = systems[0], systems[1]
        for k in range(count):
            x[k] /= matrix[k]
    elif r == 2:
        m11, m12, m21 = systems[0], systems[1], systems[2]
        m22, x, y = systems[3], systems[4], systems[5]
        for k in range(count):  # Cramer's rule
            a, b, c, d = m11[k], m12[k], m21[k], m22[k]
            e, f, determinant = x[k], y[k], a * d - b * c
            x[k], y[k] = (e * d - b * f) / determinant, (a * f - e * c) / determinant
    else:
        for k in range(count):
            # solve one system by Gaussian elimination with partial pivoting
            for column in range(r):
                pivot = column
                for i in range(column + 1, r):
                    if abs(systems[i * r + column, k]) > abs(systems[pivot * r + column, k]):
                        pivot = i
                for j in range(r):
                    here, there = column * r + j, pivot * r + j
                    systems[here, k], systems[there, k] = systems[there, k], systems[here, k]
                here, there = r * r + column, r * r + pivot
                systems[here, k], systems[there, k] = systems[there, k], systems[here, k]
                for i in range(column + 1, r):
                    factor = systems[i * r + column, k] / systems[column * r + column, k]
                    for j in range(column, r):
                        systems[i * r + j, k] -= factor * systems[column * r + j, k]
                    systems[r * r + i, k] -= factor * systems[r * r + column, k]
            for i in range(r - 1, -1, -1):
                for j in range(i + 1, r):
                    systems[r * r + i, k] -= systems[i * r + j, k] * systems[r * r + j, k]
                systems[r * r + i, k] /= systems[i * r + i, k]


# The search of a control step: NSGA-II with MaxiMin.


@compiled(what="the search of a control step", seconds=15)
def search(seed, step, generations, options, start, objectives, constraints, workspace, warm_start, history):
    """Search one step; return the number of individuals of the last population without failure.

    The arguments are those of ``programs.py``. A ``warm_start`` begins with the population in the workspace. The
    ``history`` stores as many generations as it has room for.
    """
    options, start, objectives = refer(options), refer(start), refer(objectives)
    constraints, w = refer(constraints), refer(workspace)
    seed_stream(w.state, seed, step)
    clearance = clearance_at_start(start, constraints, w)
    # fill the children with random chromosomes or the population in the workspace; mark all parents as failed
    for k in range(w.order.shape[0]):
        if warm_start:
            for j in range(w.children.shape[0]):
                w.children[j, k] = w.genes[w.order[k], j]
        else:
            draw_chromosome(w.state, -options.gene_bound, options.gene_bound, w.children, k)
    for k in range(w.order.shape[0]):
        w.order[k] = k
        for m in range(w.F.shape[0]):
            w.F[m, k] = np.inf
    single_rank, bound, row = False, options.gene_bound, start.null_space.shape[0] + 1
    probabilities = options.crossover_probability, options.mutation_probability
    for generation in range(generations + 1):
        count = w.order.shape[0]
        if generation > 0:
            count = generate_offspring(
                w.state, w.genes, w.order, w.fitness, w.F, row, probabilities, (-bound, bound), w.children
            )
        replaces = generation == 0 or not constraints.swept
        evaluate(start, options, objectives, constraints, clearance, count, w, replaces, single_rank)
        single_rank = survive(w, count, single_rank)
        if generation < history.F.shape[0]:
            # the parents' genes (individuals, genes) and objectives (individuals, n_obj)
            for k in range(w.order.shape[0]):
                history.genes[generation][k] = w.genes[w.order[k]]
                history.F[generation][k] = w.F[:, k]
    alive = 0
    for k in range(w.order.shape[0]):
        if w.F[0, k] < np.inf:
            alive += 1
    return alive


@compiled
def evaluate(start, options, objectives, constraints, clearance, count, w, replaces, single_rank):
    """Write the objectives of ``count`` children; inadmissible ones fail, or are drawn again if ``replaces``.

    The test whether the whole step is clear takes long. If all parents have rank one (``single_rank``), children that a
    parent dominates are not tested.
    """
    F, parents = w.F, w.order.shape[0]
    _configure(w.children, w.inputs, count, start, constraints, w)
    for k in range(count):
        w.pending[k] = k
    if replaces and (clearance < np.inf or constraints.bounded):
        _redraw_inadmissible(start, options, constraints, clearance, count, w)
    _evaluate_objectives(start, objectives, count, w)
    if single_rank:
        locate(F, parents, count, w.selection.places, w.selection.dominated)
    if replaces:
        return
    tested = 0
    for k in range(count):
        if F[0, parents + k] < np.inf and not (single_rank and w.selection.dominated[k] > 0):
            w.pending[tested] = k
            tested += 1
    for i in range(find_inadmissible(tested, start, constraints, clearance, options, w)):
        _fail(F, parents + w.pending[i])


@compiled
def _configure(genes, q, count, start, constraints, w):
    """Write the joint positions (dof, batch) of chromosomes, whose genes change if steps exceed bounds."""
    decode(genes, count, start, w.linear_systems, q)
    shorten(genes, q, count, start, constraints, w)


@compiled
def _evaluate_objectives(start, objectives, count, w):
    """Write the objectives of children from joint positions; a child fails if one is not finite."""
    F, inputs, outputs, parents, n = w.F, w.inputs, w.outputs, w.order.shape[0], start.previous.shape[0]
    for j in range(n):
        for order in range(1, objectives.orders):
            before = start.previous[j] if order == 1 else start.rates[order - 2, j]
            rate, value, dt = inputs[order * n + j], inputs[(order - 1) * n + j], start.dt
            for k in range(count):
                rate[k] = (value[k] - before) / dt
    run_first(objectives.arrays, inputs, outputs, count)
    failures = np.int64(0)
    for m in range(F.shape[0]):
        values, children = outputs[m], F[m, parents:]
        for k in range(count):
            children[k] = values[k]
            failures += np.int64(not abs(values[k]) < np.inf)
    if failures > 0:
        for m in range(F.shape[0]):
            for k in range(count):
                if not abs(outputs[m, k]) < np.inf:
                    _fail(F, parents + k)


@compiled
def _fail(F, point):
    for m in range(F.shape[0]):
        F[m, point] = np.inf


@compiled
def _redraw_inadmissible(start, options, constraints, clearance, count, w):
    """Replace inadmissible chromosomes by random ones (section 5.2), at most ``max_redraws`` times."""
    for _ in range(options.max_redraws):
        count = find_inadmissible(count, start, constraints, clearance, options, w)
        if count == 0:
            return
        for i in range(count):
            draw_chromosome(w.state, -options.gene_bound, options.gene_bound, w.redrawn, i)
        _configure(w.redrawn, w.redrawn_positions, count, start, constraints, w)
        _replace_pending(w.redrawn, count, w.pending, w.children)
        _replace_pending(w.redrawn_positions, count, w.pending, w.inputs)
    for i in range(count):
        w.inputs[0, w.pending[i]] = np.nan


@compiled
def _replace_pending(rows, count, pending, replaced):
    """Write ``count`` columns of rows in place of the pending ones."""
    for j in range(rows.shape[0]):
        row, target = rows[j], replaced[j]
        for i in range(count):
            target[pending[i]] = row[i]


@compiled
def survive(w, children, single_rank):
    """Choose the next population from the parents and ``children`` new ones; return whether it has a single rank.

    ``single_rank`` tells whether the parents have one. With two objectives, the survivors are in order of the first.
    """
    F, order, s = w.F, w.order, w.selection
    count = order.shape[0]
    if F.shape[0] > 2:
        # three and more objectives: failed points survive only if others are too few; fitness is the order of choice
        rank_points(F, s.rank, s.spare)
        selected = select_by_distance(
            F, s.rank, count, s.front, s.fitness, s.scaled, s.nearest, s.spare, s.begins, s.objectives
        )
        for k in range(F.shape[1]):
            if selected < count and s.rank[k] == F.shape[1]:
                s.front[selected], s.fitness[selected] = k, 0.0
                selected += 1
        for m in range(F.shape[0]):
            for k in range(count):
                s.objectives[m, k] = F[m, s.front[k]]
        for k in range(count):
            tied = k > 0 and s.rank[s.front[k]] == s.rank[s.front[k - 1]] and s.fitness[k] == s.fitness[k - 1]
            w.fitness[k] = w.fitness[k - 1] if tied else -float(k)
    else:
        # two objectives: if the parents are of a single rank, new children that none dominates are tried first, which
        # mostly suffice
        length, total, tries = 0, 0, single_rank
        while True:
            new = children
            if not tries:  # if ``tries``, ``evaluate`` has located the children
                new = count
                locate(F, count, new, s.places, s.dominated)
            total = merge_children(F, count, new, tries, s)
            length = first_front(s.points, total, s.values, s.front, s.objectives)
            if length >= count or not tries:
                break
            tries = False
        if length >= count:
            insertion_distances(s.objectives, length, s.x, s.y, s.fitness, s.stack)
            keep_farthest(s.front, s.objectives, s.fitness, length, count, s.x, s.y)
        else:
            rank_sorted(s.values, total, s.rank, s.scaled)
            select_by_rank(total, count, s)
        for k in range(count):
            w.fitness[k] = s.fitness[k]
        single_rank = length >= count
    for m in range(F.shape[0]):
        for k in range(count):
            F[m, k] = s.objectives[m, k]
    _replace_parents(w.genes, order, w.children, s.front, s.chosen, s.spare)
    return single_rank


@compiled
def _replace_parents(genes, order, children, front, rows, is_free):
    """Make the chosen points the parents, in order; a chosen child takes the row of a parent that is not."""
    count = order.shape[0]
    for k in range(count + 1):
        is_free[k] = 1
    for k in range(count):
        is_free[min(front[k], count)] = 0
    place = 0
    for k in range(count):
        if front[k] < count:
            rows[k] = order[front[k]]
            continue
        while is_free[place] == 0:
            place += 1
        rows[k] = order[place]
        place += 1
        for j in range(genes.shape[1]):
            genes[rows[k], j] = children[j, front[k] - count]
    for k in range(count):
        order[k] = rows[k]
