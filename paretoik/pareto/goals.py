"""What a move along a front asks for: one objective better by so much, some that pay for it, the others no worse.

    minimise    F̂_m + ρ Σ F̂_j                                 F̂ = F / ranges, m the payer with the largest weight
    subject to  F̂_i ≤ F̂_i(start) − s · by                     the objective that is improved
                F̂_p − F̂_m ≤ F̂_p(start) − F̂_m(start)           the other payers: all pay alike, in shares of their ranges
                F̂_h ≤ F̂_h(start)                              those that are held

At s = 0 a Pareto-critical start is optimal, with multipliers that follow from its weights; unlike a weighted sum it
stays so where the front is concave. Source: Pascoletti & Serafini 1984; ρ is the augmentation of Wierzbicki 1980.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from paretoik.nlp.program import Goal


@dataclass(frozen=True, kw_only=True)
class GoalOptions:
    """The weight of all objectives beside the payer: ``augmentation``, or a ``share`` of the least weight if less.

    A point stays the optimum of its own goal then.
    """

    augmentation: float = 5e-4
    share: float = 0.5


OPTIONS = GoalOptions()


@dataclass(frozen=True, kw_only=True)
class Wish:
    """Improve objective ``improve`` by a share ``by`` of its range; ``payers`` may get worse, the others may not."""

    improve: int
    payers: tuple[int, ...]
    by: float


@dataclass(frozen=True, kw_only=True, eq=False)
class Aim:
    """The goals from a start (``at_share`` 0) to what is wished for (1), of a program with objectives F.

    ``weights`` are those of the objectives at the start, over their ranges, their sum 1.
    """

    wish: Wish
    ranges: Float[np.ndarray, " n_obj"]
    start: Float[np.ndarray, " n_obj"]
    weights: Float[np.ndarray, " n_obj"]
    objectives: int

    @property
    def main(self) -> int:
        """The payer that is minimised."""
        return max(self.wish.payers, key=lambda payer: self.weights[payer])

    def at_share(self, share: float) -> Goal:
        """Return the goal of a share of the way."""
        count, main, wish = len(self.ranges), self.main, self.wish
        identity = np.eye(count, self.objectives) / np.append(self.ranges, np.ones(self.objectives - count))
        others = [k for k in range(count) if k != main]
        rows, upper = identity[others], (self.start / self.ranges)[others]
        for i, k in enumerate(others):
            if k == wish.improve:
                upper[i] -= share * wish.by
            elif k in wish.payers:
                rows[i] -= identity[main]
                upper[i] -= self.start[main] / self.ranges[main]
        scale = self.weights[list(wish.payers)].sum()
        smallest = float(self.weights.min() / scale) if scale > 0 else 0.0
        augmentation = min(OPTIONS.augmentation, OPTIONS.share * smallest)
        return Goal(weights=identity[main] + augmentation * identity.sum(axis=0), rows=rows, upper=upper)

    @property
    def predicted(self) -> Float[np.ndarray, " n_obj"]:
        """How objectives change, in shares of their ranges, by the exchange rates at the start; inf without a payer."""
        wish, change = self.wish, np.zeros(len(self.ranges))
        change[wish.improve] = -wish.by
        payers, total = list(wish.payers), float(self.weights[list(wish.payers)].sum())
        change[payers] = wish.by * self.weights[wish.improve] / total if total > 0 else np.inf
        return change
