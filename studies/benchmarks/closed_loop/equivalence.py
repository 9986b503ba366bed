"""Tests whether the engine's fronts equal those of the readable path in pymoo: two one-sided tests on several steps.

Hypervolumes of fronts of 31 seeds each are taken in the box of all fronts together. They are equal if both one-sided
Mann-Whitney tests say that they differ by less than 1 % of the exact front's.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import numpy as np
from moocore import is_nondominated
from scipy.stats import mannwhitneyu

from paretoik.closed_loop.control_step import HISTORY, StepState
from paretoik.formulations.closed_loop import ClosedLoop
from paretoik.front.indicators import hypervolume
from problems.marcos_2012 import Links
from studies.benchmarks.closed_loop.contestants import GENERATIONS, engine, loop_of, pymoo
from studies.marcos_2012.exact_loop import OPTIONS, exact_steps
from studies.reporting import Row

MARGIN, LEVEL = 0.01, 0.05
STEPS: tuple[tuple[Links, int], ...] = ((3, 1), (3, 60), (3, 240), (4, 60))
REFERENCE = 1.1
DENSE = 200_001


def equivalence_rows(seeds: int, steps: Sequence[tuple[Links, int]] = STEPS) -> list[Row]:
    """Return, for each step, both medians, the larger p of the two tests and the verdict."""
    rows = []
    with ProcessPoolExecutor(mp_context=get_context("spawn")) as pool:
        for links, sample in steps:
            fronts = {
                name: list(pool.map(search_front, [links] * seeds, [sample] * seeds, [name] * seeds, range(seeds)))
                for name in ("engine", "pymoo")
            }
            loop = loop_of(links, as_printed=False)
            ours, theirs = volumes(fronts["engine"], fronts["pymoo"], exact_front(loop, control_step(loop, sample)))
            p = max(
                mannwhitneyu(ours + MARGIN, theirs, alternative="greater").pvalue,
                mannwhitneyu(ours - MARGIN, theirs, alternative="less").pvalue,
            )
            verdict = "equal" if p < LEVEL else "UNDECIDED"
            rows.append(
                Row(
                    table=f"the engine's fronts beside pymoo's, {GENERATIONS} generations, {seeds} seeds",
                    row=f"{links}R, step {sample}",
                    column="median hypervolume, share of the exact front's",
                    unit="",
                    ours=float(np.median(ours)),
                    reference=float(np.median(theirs)),
                    source="pymoo",
                    note=f"{verdict} within {MARGIN:.0%}: p {p:.1e}; ranges {np.ptp(ours):.1e}, {np.ptp(theirs):.1e}",
                )
            )
    return rows


def search_front(links: Links, sample: int, name: str, seed: int) -> np.ndarray:
    """Return the objectives of one run's last population."""
    loop = loop_of(links, as_printed=False)
    step = control_step(loop, sample)
    run = engine(loop, step) if name == "engine" else pymoo(loop, step, compiled=False)
    return run(seed, GENERATIONS)


def volumes(
    ours: Sequence[np.ndarray], theirs: Sequence[np.ndarray], exact: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the hypervolumes of all fronts as shares of the exact one's, in the box of all non-dominated points."""
    union = np.concatenate([*ours, *theirs])
    union = union[is_nondominated(union)]
    low, width = np.minimum(union.min(axis=0), exact.min(axis=0)), np.ptp(union, axis=0)
    whole = _volume(exact, low, width)
    shares = [np.array([_volume(F, low, width) / whole for F in side]) for side in (ours, theirs)]
    return shares[0], shares[1]


def exact_front(loop: ClosedLoop, step: StepState) -> np.ndarray:
    """Return a fine front of the admissible steps: along a line for three links, over a plane for four.

    The plane's grid is fine: its front's hypervolume lacks less than 1 %. Searches can come out above it.
    """
    error, jacobian = step.linearise()
    null = np.linalg.svd(jacobian)[2][len(error) :].T
    shortest = np.linalg.pinv(jacobian) @ error
    center = -0.5 * null.T @ (step.previous + shortest - step.home)
    if null.shape[1] == 1:
        y = np.sinh(np.linspace(-18, 18, DENSE))[:, None] * OPTIONS.farthest / np.sinh(18)
    else:
        radius, angle = np.meshgrid(np.geomspace(1e-7, 1.0, 700), np.linspace(0, 2 * np.pi, 360, endpoint=False))
        y = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=-1).reshape(-1, 2)
        y = np.concatenate([np.zeros((1, 2)), y])
    q = step.previous + shortest + (center + y) @ null.T
    steps = step.steps(q[step.is_admissible(q)])
    F = np.stack([each.function(steps)[..., -1] * each.sign for each in loop.objectives], axis=1)
    front: np.ndarray = F[is_nondominated(F)]
    return front


def control_step(loop: ClosedLoop, sample: int) -> StepState:
    """Return a step of the exact loop."""
    q = loop.start[None]
    if sample > 1:
        q = exact_steps(loop.task.truncate(sample), loop.start, weight=0.5, longest_step=loop.longest)
    return loop.step_state(sample, np.concatenate([np.tile(q[:1], (HISTORY, 1)), q])[-HISTORY:])


def _volume(F: np.ndarray, low: np.ndarray, width: np.ndarray) -> float:
    return float(hypervolume((F - low) / width, np.full(2, REFERENCE)))
