"""The value of more candidates: Figure 1, the best of a number of roll-outs against the best optimum."""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

import paretoik as pk
from paretoik.runs.distribution import Executor
from paretoik.task.random_starts import rollout_starts
from studies.processes import run_each
from studies.reporting import Row
from studies.tringali_2020.simulations import LOW, MASSES, as_printed, beside, paper, with_arm

SAMPLES = 13
FITTED_FROM = SAMPLES * 3  # candidates: the number of parameters, at which the paper's line begins
POINTS = 60
RATE = "-1/3 where six parameters, one of the start and five of the weights, come near a minimum"


class Decline(NamedTuple):
    """One arm's best candidates' cost above the best optimum (seeds, points) [J s], by candidates (points,)."""

    masses: str
    counts: Int[np.ndarray, " points"]
    above: Float[np.ndarray, "seeds points"]

    @property
    def lines(self) -> Float[np.ndarray, "seeds 2"]:
        """Exponent and logarithm of the factor of each seed's power law, from ``FITTED_FROM`` candidates on."""
        selected = self.counts >= FITTED_FROM
        lines: np.ndarray = np.polyfit(np.log(self.counts[selected]), np.log(self.above[:, selected]).T, 1).T
        return lines


def declines(*, count: int, seeds: int, executor: Executor | None = None) -> list[Decline]:
    """Return the decline for each arm, up to ``count`` candidates; both weigh the same roll-outs."""
    best = {masses: pk.plan(_problem(masses)).best.objective for masses in MASSES}
    by_seed = run_each(executor, {(f"seed {seed}",): partial(lowest_costs, count, seed) for seed in range(seeds)})
    lowest = {masses: [costs[masses] for costs in by_seed.values()] for masses in MASSES}
    fewest = min(len(costs) for costs in lowest["fitted"])
    counts = np.unique(np.geomspace(1, fewest, POINTS).round().astype(int))
    return [Decline(m, counts, np.stack([costs[counts - 1] for costs in lowest[m]]) - best[m]) for m in MASSES]


def lowest_costs(count: int, seed: int) -> dict[str, Float[np.ndarray, " candidates"]]:
    """Return by masses the least cost [J s] of the first candidate, of the first two, and so on."""
    q = rollout_starts(_problem("fitted").task, count, np.random.default_rng(seed))
    return {masses: np.minimum.accumulate(pk.kinetic_energy(_problem(masses).task.motion(q))) for masses in MASSES}


def _problem(masses: str) -> pk.Tracking:
    return with_arm(as_printed("simulation_1"), masses, SAMPLES)


def figure_1(decline: Decline) -> list[Row]:
    """Return the power law of one arm, mean and deviation over seeds, and the paper's."""
    (exponent, factor), spread = decline.lines.mean(axis=0), decline.lines.std(axis=0, ddof=1)
    seeds, count = len(decline.above), int(decline.counts[-1])
    smallest, largest = decline.lines[:, 0].min(), decline.lines[:, 0].max()
    setting = f"{seeds} seeds, to {count} candidates of {SAMPLES} samples 1/12 s apart (0.08 s does not divide 1 s)"
    name, table = "least kinetic energy", "Figure 1"
    spread_note = (
        f"± {spread[0]:.2f}, {smallest:.2f} to {largest:.2f}: a seed's curve is a staircase; {setting}; {RATE}"
    )
    off = abs(float(factor) - paper()[table, name, "logarithm of the factor"])
    factor_note = f"± {spread[1]:.2f} over seeds: {off / spread[1]:.1f} deviations off"
    if decline.masses == "printed":
        factor_note = f"{LOW}; {factor_note}"
    last = float(np.median(decline.above[:, -1]))
    return [
        beside(table, decline.masses, name, "exponent", "", float(exponent), spread_note),
        beside(table, decline.masses, name, "logarithm of the factor", "", float(factor), factor_note),
        beside(table, decline.masses, name, "best candidate above the optimum", "J s", last, f"median of {count}"),
    ]
