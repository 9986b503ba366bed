"""Islands: separate populations in a ring. At intervals, good individuals migrate to the next one.

The candidates of all islands are evaluated together, to keep many workers busy. Each island has its own random numbers,
all migrate after the same generations, and migrants are in the order of their ids: the result is the same bit for bit,
no matter which process evaluates. Source: Alba & Tomassini 2002, "Parallelism and evolutionary algorithms", section IV.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from paretoik.arrays import Genes, Ids, Objectives
from paretoik.inputs import check_size
from paretoik.search.archive import Archive, Failures
from paretoik.search.ask_tell import Candidates, Search, archive_front, seed_of
from paretoik.search.maximin import survivors


@dataclass(frozen=True, kw_only=True)
class IslandOptions:
    """Settings of migration; migrants are spread over the front of their island.

    epoch: number of generations between migrations, which begin when all objectives are searched together
    share: share of a population that migrates; at least one individual does
    """

    epoch: int = 10
    share: float = 0.05


OPTIONS = IslandOptions()


class Islands:
    """Islands with one common archive. Each is a ``Search`` with the same arguments and its own seed.

    ``ask`` and ``tell`` work as in ``Search``, but ``tell`` takes all rows of a generation at once. Raises InvalidInput
    as ``Search`` does.
    """

    def __init__(
        self,
        problem: Any,
        islands: int,
        *,
        population: int = 100,
        seed: int = 0,
        initial: ArrayLike | None = None,
        algorithm: Any = None,
        anchors: int = 0,
        options: IslandOptions = OPTIONS,
    ) -> None:
        check_size("islands", islands, 1)
        self.problem, self.seed, self.evaluations = problem, seed, 0
        self._searches = [
            Search(
                problem,
                population=population,
                seed=seed_of(seed, i),
                initial=initial,
                algorithm=algorithm,
                anchors=anchors,
            )
            for i in range(islands)
        ]
        first = self._searches[0]
        self.names, self.units, self.maximised = first.names, first.units, first.maximised
        self.archive = Archive(names=self.names, **first.tolerances)
        self._migrants = max(1, round(options.share * population))
        self._epoch, self._first_epoch = options.epoch, anchors * problem.n_obj
        self._candidates: Candidates | None = None

    @property
    def generation(self) -> int:
        """Number of completed generations, which is the index of the current one."""
        return self._searches[0].generation

    @property
    def failed(self) -> Failures:
        """Number of failed evaluations, and the cause of the first."""
        return self.archive.failed

    @property
    def population(self) -> Objectives:
        """Minimised objectives (individuals, n_obj) of all populations, inf for failed individuals."""
        return np.concatenate([search.population for search in self._searches])

    front_of = archive_front

    def ask(self) -> Candidates:
        """Return the candidates of all islands; the same object until all of them are told."""
        if self._candidates is None:
            X = np.concatenate([search.ask().X for search in self._searches])
            X.flags.writeable = False
            self._candidates = Candidates(self.evaluations + np.arange(len(X)), X, self.generation)
        return self._candidates

    def suggest(self, X: Genes) -> None:
        """Add genes (rows, genes) to the next generations, distributed among the islands."""
        for i, search in enumerate(self._searches):
            search.suggest(X[i :: len(self._searches)])

    def tell(
        self, ids: Ids, F: Objectives, G: np.ndarray, *, H: np.ndarray, causes: Mapping[int, str] | None = None
    ) -> None:
        """Tell objectives and constraints of all candidates, and ``causes`` of failure by id; see ``Search``."""
        candidates, causes = self._candidates, causes or {}
        assert candidates is not None
        assert np.array_equal(ids, candidates.ids)
        self.archive.add(ids, candidates.X, F, G, candidates.generation, H=H, causes=causes)
        first = 0
        for search in self._searches:
            own = search.ask().ids
            rows = slice(first, first + len(own))
            pairs = zip(own.tolist(), ids[rows].tolist(), strict=True)
            own_causes = {one: causes[number] for one, number in pairs if number in causes}
            search.tell(own, F[rows], G[rows], H=H[rows], causes=own_causes)
            first += len(own)
        self.evaluations, self._candidates = self.evaluations + len(ids), None
        if self.generation >= self._first_epoch and self.generation % self._epoch == 0:
            # Migrants of every island go to the next one, where each replaces one offspring.
            migrants = list[Genes]()
            for search in self._searches:
                # genes of points spread over an island's front, in the order of their ids
                members = search.archive.members
                if members is None:
                    migrant = np.empty((0, self.problem.n_var))
                else:
                    if len(members) > self._migrants:
                        members = members[survivors(members.F, np.zeros(len(members)), self._migrants).index]
                    migrant = np.asarray(members.X[np.argsort(members.ids)])
                migrants.append(migrant)
            for i, search in enumerate(self._searches):
                search.suggest(migrants[i - 1])
