"""Islands evolve separately, and migration changes their results."""

from __future__ import annotations

import numpy as np
import pytest
from pymoo.problems import get_problem

import paretoik as pk
from paretoik.errors import InvalidInput
from paretoik.search.ask_tell import Search
from paretoik.search.endings import Generations
from paretoik.search.evolution import evolve
from paretoik.search.islands import IslandOptions, Islands

PROBLEM = get_problem("zdt1", n_var=6)
ISLANDS = 3
NEVER = IslandOptions(epoch=10**6)


def advance(search: Search | Islands) -> np.ndarray:
    """Evaluate one generation and return its genes."""
    candidates = search.ask()
    search.tell(
        candidates.ids,
        PROBLEM.evaluate(candidates.X),
        np.empty((len(candidates.X), 0)),
        H=np.empty((len(candidates.X), 0)),
    )
    return candidates.X


def alone(island: int) -> Search:
    """Return the search that equals an island without migrants."""
    seed = int(np.random.SeedSequence([7, island]).generate_state(1)[0])
    return Search(PROBLEM, population=8, seed=seed)


def islands(options: IslandOptions) -> Islands:
    return Islands(PROBLEM, ISLANDS, population=8, seed=7, options=options)


def test_islands_without_migration_equal_separate_searches():
    searches, separate = [alone(i) for i in range(ISLANDS)], islands(NEVER)
    for _ in range(6):
        assert np.array_equal(advance(separate), np.concatenate([advance(each) for each in searches]))
    assert np.array_equal(separate.population, np.concatenate([each.population for each in searches]))
    fronts = np.concatenate([each.archive.F for each in searches])
    best = fronts[[not ((fronts <= one).all(axis=1) & (fronts < one).any(axis=1)).any() for one in fronts]]
    assert {*map(tuple, separate.archive.F)} == {*map(tuple, best)}
    assert separate.evaluations == 6 * 8 * ISLANDS


def test_migration_changes_what_islands_come_to_from_the_first_epoch_on():
    separate, together = islands(NEVER), islands(IslandOptions(epoch=4, share=0.25))
    same = [np.array_equal(advance(separate), advance(together)) for _ in range(12)]
    assert same == [True] * 4 + [False] * 8


def test_the_best_of_an_island_arrive_at_the_next_one_in_the_order_of_their_ids():
    together = islands(IslandOptions(epoch=4, share=0.25))
    genes = np.stack([advance(together) for _ in range(4)]).reshape(4, ISLANDS, 8, -1)
    fronts = [search.archive.members for search in together._searches]
    arrived = advance(together).reshape(ISLANDS, 8, -1)[:, -2:]
    for i in range(ISLANDS):
        home = fronts[i - 1]
        rows = [int(np.flatnonzero((one == home.X).all(axis=1))[0]) for one in arrived[i]]
        assert rows == sorted(rows)
        assert all((genes[:, i - 1] == one).all(axis=2).any() for one in arrived[i])


def test_ids_and_causes_are_those_of_the_rows_of_all_islands():
    def evaluate(X):
        F = PROBLEM.evaluate(X)
        F[X[:, 0] < 0.2] = np.nan
        return {"F": F, "cause": ["too far left" if one < 0.2 else "" for one in X[:, 0]]}

    search = islands(IslandOptions(epoch=2))
    evolve(search, [Generations(5)], evaluate=evaluate)
    members = search.archive.members
    assert (members.X[:, 0] >= 0.2).all()
    assert len({*members.ids.tolist()}) == len(members)
    assert members.ids.max() < search.evaluations
    assert search.failed.count > 0
    assert search.failed.first_cause == "too far left"


def test_no_migrant_leaves_while_objectives_are_searched_alone():
    options = {"population": 8, "seed": 7, "anchors": 3}
    separate = Islands(PROBLEM, ISLANDS, options=NEVER, **options)
    together = Islands(PROBLEM, ISLANDS, options=IslandOptions(epoch=2), **options)
    same = [np.array_equal(advance(separate), advance(together)) for _ in range(8)]
    assert same == [True] * 6 + [False] * 2


def test_one_island_equals_one_search():
    one, none = (
        pk.solve(PROBLEM, population=10, generations=12, seed=3, **islands) for islands in ({"islands": 1}, {})
    )
    assert np.array_equal(one.objectives, none.objectives)
    assert np.array_equal(one.ids, none.ids)
    other = pk.solve(PROBLEM, population=10, generations=12, seed=3, islands=2)
    assert not np.array_equal(other.objectives, none.objectives)
    assert other.provenance["settings"]["islands"] == 2
    assert other.provenance["counts"]["evaluations"] == 2 * none.provenance["counts"]["evaluations"]


@pytest.mark.parametrize("islands", [0, -1, 1.5, True, "2"])
def test_invalid_number_of_islands_is_refused(islands, unchecked):
    with pytest.raises(InvalidInput, match="islands must be an integer of at least 1"):
        pk.solve(PROBLEM, islands=islands)
