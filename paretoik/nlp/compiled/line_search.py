"""The line search of the interior-point method with its filter, compiled."""

from __future__ import annotations

import numpy as np

from paretoik.compilation import compiled
from paretoik.nlp.compiled.array_loops import dot
from paretoik.nlp.compiled.elastic import merit_terms, reset_slacks, step_slacks
from paretoik.nlp.compiled.iteration import evaluate_all, residual_sum
from paretoik.nlp.compiled.kernel_steps import retract


@compiled
def search_line(
    kernel, work, x, dx, length, slope, before, theta, infeasible, weights, rows, upper, barrier, entries, options,
    trial, it
):  # fmt: skip
    """Write the trial point of the longest step that the filter accepts; return (whether, merit, filter entries).

    A step whose predicted decrease is rounding is tried whole or not at all.
    """
    after, mu, penalty = before, barrier.mu, barrier.penalty
    for _ in range(1 if theta == 0.0 and is_negligible(slope, before, options) else options.halvings):
        if retract(kernel, work, x, dx, length, trial):
            evaluate_all(kernel, work, trial, rows, upper, it.bounds, it.trial_objectives, it.trial_c)
            if kernel.implied_slacks:
                reset_slacks(it.trial_c, mu, penalty, it.trial_s, it.trial_t, it.trial_r)
            else:
                step_slacks(it.trial_c, it.s, it.t, it.ds, it.dt, length, it.trial_s, it.trial_t, it.trial_r)
            after = dot(weights, it.trial_objectives) + merit_terms(it.trial_s, it.trial_t, mu, penalty)
            accepted, entries = _filter_accepts(
                theta, before, residual_sum(it.trial_r, options), after, slope, length, infeasible, it.filter,
                entries, options
            )  # fmt: skip
            if accepted:
                return True, after, entries
        length *= 0.5
    return False, after, entries


@compiled
def is_negligible(slope, before, options):
    """Return whether the decrease of the merit function that a step predicts is rounding."""
    return -slope <= options.flat_decrease * (1 + abs(before))


@compiled
def _filter_accepts(theta, before, trial_theta, after, slope, length, infeasible, filter_, entries, options):
    """Return whether a step may be taken, and the number of filter entries (Wächter & Biegler 2006, section 2.3).

    Without residuals this is Armijo's condition.
    """
    margin, rounding = options.filter_margin, options.merit_rounding * abs(before)
    if not np.isfinite(after + trial_theta):
        return False, entries
    for i in range(entries):
        if trial_theta >= (1 - margin) * filter_[i, 0] and after >= filter_[i, 1] - margin * filter_[i, 0]:
            return False, entries
    if theta <= infeasible and length * (-slope) ** 2.3 >= theta**1.1 and slope <= 0.0:
        return after <= before + options.armijo * length * slope + rounding, entries
    if trial_theta <= (1 - margin) * theta or after <= before - margin * theta + rounding:
        filter_[entries, 0], filter_[entries, 1] = theta, before
        return True, entries + 1
    return False, entries
