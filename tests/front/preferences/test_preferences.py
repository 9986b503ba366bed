"""Laws of all preferences: they agree with plain loops, and units, order and copies do not move a choice."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
import pytest

from paretoik.errors import Infeasible, InvalidInput
from paretoik.front.front import Front, Preference
from paretoik.front.preferences import Aspiration, Bounds, Classify, Lexicographic, Robust, Weights
from paretoik.front.preferences.knee_and_compromise import Compromise
from tests.front.preferences import brute_force
from tests.front.random_fronts import random_front

FRONTS = 60
Asked = tuple[Preference, Callable[[Front], int | None]]


def wishes_of(front: Front, rng: np.random.Generator) -> Iterator[Asked]:
    """Yield one preference of every kind, with the plain loops that choose."""
    names, size = list(front.names), len(front.names)
    weights = (rng.integers(0, 4, size) if rng.random() < 0.5 else rng.random(size)).astype(float)
    weights[rng.integers(size)] += 1.0
    named = dict(zip(names, weights.tolist(), strict=True))
    yield Weights(named), lambda front: brute_force.weighted(front, weights.tolist())
    yield Compromise(), brute_force.compromise
    low, high = front.ranges.T
    some = rng.permutation(names)[: rng.integers(1, size + 1)].tolist()
    values = low + (high - low) * rng.uniform(-0.5, 1.2, size)
    wish = {name: float(values[names.index(name)]) for name in some}
    yield Aspiration(wish), lambda front: brute_force.aspiration(front, wish)
    shares = {name: float(rng.choice([0.0, 0.1, 0.3])) for name in some}
    yield Lexicographic(*some, tolerance_shares=shares), lambda front: brute_force.lexicographic(front, some, shares)
    uncertainty = float(rng.choice([0.0, 0.2, 1.0]))
    robust = Robust(named, uncertainty=uncertainty)
    yield robust, lambda front: brute_force.robust(front, weights.tolist(), uncertainty)
    if size > 1:
        yield from _classified(front, rng)


def _classified(front: Front, rng: np.random.Generator) -> Iterator[Asked]:
    names, start = rng.permutation(front.names).tolist(), int(rng.choice(front.ids))
    now = front.objectives[front.ids.tolist().index(start)]
    classes = {names[0]: rng.choice(["improve", "improve_to"]), names[1]: rng.choice(["relax_to", "free"])}
    classes |= {name: rng.choice(["improve", "keep", "free", "improve_to", "relax_to"]) for name in names[2:]}
    values, width = {}, np.ptp(front.ranges, axis=1)
    for axis, name in enumerate(front.names):
        better = -1.0 if front.maximised[axis] else 1.0
        step = rng.uniform(0.05, 0.7) * max(width[axis], 1.0)
        values[name] = float(now[axis] + better * step * (1 if classes[name] == "relax_to" else -1))
    of = {kind: [name for name in front.names if classes[name] == kind] for kind in ("improve", "keep", "free")}
    to = {kind: {n: values[n] for n in front.names if classes[n] == kind} for kind in ("improve_to", "relax_to")}
    yield Classify(start, **of, **to), lambda front: brute_force.classified(front, start, classes, values)


def test_every_preference_chooses_what_plain_loops_over_the_points_do():
    for seed in range(FRONTS):
        front = random_front(seed, points=1 + seed % 25)
        for preference, expected in wishes_of(front, np.random.default_rng(seed)):
            choice = preference.choose(front)
            assert choice.id == expected(front), (seed, preference)
            assert choice.id == front.ids[choice.index]


def test_the_knee_is_what_plain_loops_say_or_none():
    knees, refused = 0, 0
    for seed in range(FRONTS):
        front = random_front(seed, n_obj=2 + seed % 3, points=1 + seed % 25)
        if seed % 5 == 0:  # a former outlier: relative to it all are equal in the first objective
            wider = front.ranges.copy()
            wider[0, 1] += 1e10
            front = replace(front, ranges=wider)
        expected = brute_force.knee(front)
        if expected is None:
            assert len(front.names) == 2
            with pytest.raises(InvalidInput, match="no knee"):
                front.select("knee")
            refused += 1
        else:
            choice = front.select("knee")
            assert choice.id == expected, seed
            assert ("all are equal" in choice.verdict) == bool((np.ptp(front.shares, axis=0) <= 1e-9).all())
            knees += 1
    assert min(knees, refused) > 5


def test_the_best_in_both_is_the_knee_if_one_objective_has_no_extent():
    values = np.array([[1e10, 0.0], [0.0, 3.0], [0.5, 2.9], [1.0, 2.0]])
    front = Front(ids=np.arange(4), objectives=values, names=["f", "g"], units=["", ""], maximised=[False, False])
    choice = front.select(Bounds(f=(None, 1.0), then="knee"))
    assert choice.id == 3
    assert "it is the best in every objective, within rounding" in choice.verdict


@pytest.mark.parametrize("power", [1.2, 4.0])
@pytest.mark.parametrize("steps", [4, 13])
def test_the_knee_of_a_front_that_bulges_evenly_lies_in_its_middle(power, steps):
    lattice = np.array([(i, j, steps - i - j) for i in range(steps + 1) for j in range(steps + 1 - i)]) / steps
    values = 1.0 - lattice / (lattice**power).sum(axis=1, keepdims=True) ** (1 / power)
    front = Front(
        ids=np.arange(len(values)), objectives=values, names=["f", "g", "h"], units=[""] * 3, maximised=[False] * 3
    )
    assert np.ptp(lattice[front.select("knee").id]) <= 1 / steps + 1e-12


@pytest.mark.parametrize("seed", range(12))
def test_bounds_choose_as_the_named_preference_among_the_points_within_on_the_ranges_of_all(seed):
    front, rng = random_front(seed, points=30), np.random.default_rng(seed)
    axis = int(rng.integers(len(front.names)))
    bound = (None, float(np.median(front.objectives[:, axis])))
    for then, _ in wishes_of(front, rng):
        if isinstance(then, Classify):
            continue
        part = front.where({front.names[axis]: bound})
        choice = front.select(Bounds({front.names[axis]: bound}, then=then))
        assert choice.id == then.choose(part).id
        assert front.ids[choice.index] == choice.id
        assert (part.ranges == front.ranges).all()


def test_an_aspiration_to_a_point_that_gains_a_ten_thousandth_chooses_it():
    reached = 0
    for seed in range(25):
        front = random_front(seed, points=20)
        for row, point in enumerate(front.shares):
            gains = np.delete(front.shares, row, axis=0) - point
            if (gains.max(axis=1) >= 1e-4 * np.maximum(-gains, 0.0).sum(axis=1) + 1e-8).all():
                wish = dict(zip(front.names, front.objectives[row].tolist(), strict=True))
                assert Aspiration(wish).choose(front).id == front.ids[row]
                reached += 1
    assert reached > 20


def test_a_bound_is_missed_by_a_share_of_the_value_that_all_points_have():
    front = Front(
        ids=np.arange(1), objectives=np.array([[1.0, 2.0]]), names=["f", "g"], units=["J", ""], maximised=[False] * 2
    )
    with pytest.raises(Infeasible, match=r"f 1 misses it by 0.5 J \(50% of the value that all have\)"):
        front.select(Bounds(f=(None, 0.5)))


def in_other_units(front: Front, scale: np.ndarray, offset: np.ndarray) -> Front:
    return replace(
        front,
        objectives=front.objectives * scale + offset,
        ranges=front.ranges * scale[:, None] + offset[:, None],
    )


def in_other_units_too(preference: Preference, front: Front, scale: np.ndarray, offset: np.ndarray) -> Preference:
    """Return a preference with its values in the new units."""

    def moved(values):
        return {
            name: value * scale[axis] + offset[axis]
            for name, value in values.items()
            for axis in [front.names.index(name)]
        }

    if isinstance(preference, Aspiration):
        return Aspiration(moved(preference.values))
    if isinstance(preference, Classify):
        parts = {kind: getattr(preference, kind) for kind in ("improve", "keep", "free")}
        to = {kind: moved(getattr(preference, kind)) for kind in ("improve_to", "relax_to")}
        return Classify(preference.current, **parts, **to)
    return preference


def test_no_choice_depends_on_the_units_of_the_objectives():
    for seed in range(12):
        front, rng = random_front(seed, points=20), np.random.default_rng(seed)
        scale, offset = 10.0 ** rng.uniform(-3, 3, len(front.names)), rng.uniform(-2, 2, len(front.names))
        offset *= scale
        other = in_other_units(front, scale, offset)
        for preference, _ in wishes_of(front, np.random.default_rng(seed)):
            changed = in_other_units_too(preference, front, scale, offset)
            assert changed.choose(other).id == preference.choose(front).id, (seed, preference)


def test_neither_the_order_of_the_points_nor_copies_of_them_move_a_choice():
    for seed in range(12):
        front, rng = random_front(seed, points=20), np.random.default_rng(seed)
        order = rng.permutation(len(front))
        copies = rng.integers(0, len(front), 5)
        both = np.concatenate([front.objectives, front.objectives[copies]])[np.append(order, len(front) + np.arange(5))]
        ids = np.append(front.ids[order], front.ids.max() + 1 + np.arange(5))
        more = replace(front, ids=ids, objectives=both)
        for preference, _ in wishes_of(front, rng):
            assert preference.choose(more).id == preference.choose(front).id, (seed, preference)


@pytest.mark.parametrize("seed", range(12))
def test_more_points_move_a_choice_to_none_but_a_new_one(seed):
    """This holds for preferences that score each point by itself, on the stored ranges."""
    denser, rng = random_front(2 * seed, points=60), np.random.default_rng(seed)
    front = denser[rng.permutation(denser.ids)[: 1 + len(denser) // 2]]
    for preference, _ in wishes_of(front, rng):
        if isinstance(preference, Weights | Compromise | Aspiration):
            before, after = preference.choose(front), preference.choose(denser)
            assert after.id == before.id or after.id not in front.ids
            assert after.score <= before.score + 1e-9
