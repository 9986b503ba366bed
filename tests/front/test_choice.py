"""Every number in a reason is recomputed, only from the front and by plain loops."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from paretoik.front.choice import Choice
from paretoik.front.front import Front
from tests.front.random_fronts import minima, random_front

NUMBER = r"[-+.\de]+"
AMOUNT = (
    rf"(?P<amount>{NUMBER}) (?P<unit>[A-Za-z]*) ?(?P<direction>more|less) (?P<name>f\d)"
    rf"(?: \((?P<share>{NUMBER})% of the range\))?"
)


def digits(value: float, count: int = 3) -> str:
    return f"{value:.{count}g}"


def check_amounts(front: Front, words: str, this: int, other: int) -> None:
    """Check the stated differences between the points of rows ``this`` and ``other``."""
    said = {match["name"]: match for match in re.finditer(AMOUNT, words)}
    assert re.sub(AMOUNT, "", words).translate(str.maketrans("", "", " ,")).replace("and", "").replace("for", "") == ""
    for axis, name in enumerate(front.names):
        step = front.objectives[this, axis] - front.objectives[other, axis]
        width = front.ranges[axis, 1] - front.ranges[axis, 0]
        assert (name in said) == (abs(step) > 1e-9 * width)
        if name in said:
            assert said[name]["amount"] == digits(abs(step))
            assert said[name]["unit"] == front.units[axis]
            assert said[name]["direction"] == ("more" if step > 0 else "less")
            assert said[name]["share"] in (None, digits(100 * abs(step) / width))


def best_rows(front: Front, axis: int) -> list[int]:
    values = front.minimised[:, axis]
    return np.flatnonzero(values <= values.min() + 1e-9 * np.ptp(front.ranges[axis])).tolist()


def check_reason(front: Front, choice: Choice) -> None:
    """Check a reason of at most five bullets sentence by sentence, until none is left."""
    row, ids = choice.index, front.ids.tolist()
    bullets = choice.reason.splitlines()
    assert bullets[0] == f"- {choice.verdict}"
    assert len(bullets) <= 5
    rest = "".join(bullet.removeprefix("-") for bullet in bullets[1:])
    place = re.search(r" It has (.*?)\.(?= [A-Z]|$)", rest)
    assert re.findall(r"(f\d) ([-+.\de]+)", re.sub(r"\(.*?\)", "", place[1])) == [
        (name, digits(value, 4)) for name, value in zip(front.names, front.objectives[row], strict=True)
    ]
    for share, name_place in zip(
        re.findall(r"\(([-+.\de]+)% of the range from the best\)", place[1]), range(9), strict=False
    ):
        axes = [axis for axis in range(len(front.names)) if np.ptp(front.ranges[axis]) > 0]
        assert share == digits(100 * front.shares[row, axes[name_place]])
    rest = rest.replace(place[0], "", 1)
    best = re.search(r" No point is better in (.*?)\.", rest)
    ranged = [axis for axis in range(len(front.names)) if np.ptp(front.ranges[axis]) > 0]
    expected = [front.names[axis] for axis in ranged if row in best_rows(front, axis)]
    assert (re.findall(r"f\d", best[1]) if best else []) == expected
    rest = rest.replace(best[0], "", 1) if best else rest
    for end in re.finditer(r" Compared with point (\d+), the best in (.*?), it has (.*?)\.(?= |$)", rest):
        other = ids.index(int(end[1]))
        assert all(other in best_rows(front, front.names.index(name)) for name in re.findall(r"f\d", end[2]))
        check_amounts(front, end[3], row, other)
        rest = rest.replace(end[0], "", 1)
    several = re.search(r" The best are (.*?)\.(?= |$)", rest)
    for number, names in re.findall(r"point (\d+) in ((?:f\d|, | and (?!point))+)", several[1] if several else ""):
        assert all(ids.index(int(number)) in best_rows(front, front.names.index(n)) for n in re.findall(r"f\d", names))
    rest = rest.replace(several[0], "", 1) if several else rest
    near = re.search(r" Its neighbours?: (.*?)\.(?= [A-Z]|$)", rest)
    for part in near[1].split("; ") if near else []:
        number, words = re.fullmatch(r"point (\d+) has (.*)", part).groups()
        other = ids.index(int(number))
        check_amounts(front, words, other, row)
        check_nearest(front, row, other)
    rest = rest.replace(near[0], "", 1) if near else rest
    assert rest.strip() == check_rates(front, row)


def check_nearest(front: Front, row: int, other: int) -> None:
    """Check that in some objective no nearer point gains."""
    Z = front.shares
    distance = [sum((a - b) ** 2 for a, b in zip(point, Z[row], strict=True)) ** 0.5 for point in Z]
    nearest = [
        min((distance[q] for q in range(len(Z)) if Z[row, axis] - Z[q, axis] > 1e-9), default=np.inf)
        for axis in range(Z.shape[1])
    ]
    assert any(
        distance[other] <= least + 1e-9 and Z[row, axis] - Z[other, axis] > 1e-9 for axis, least in enumerate(nearest)
    )


def check_rates(front: Front, row: int) -> str:
    """Return the sentences on exchange rates, from the certificates by plain loops."""
    if front.certificates is None:
        return ""
    rates, names, units = np.abs(front.certificates.exchange_rates[row]), front.names, front.units
    sentences = []
    for i, name in enumerate(names):
        gains = front.minimised[row] - front.minimised
        better = [q for q in range(len(front)) if front.shares[row, i] - front.shares[q, i] > 1e-9]
        better.sort(key=lambda q: (np.linalg.norm(front.shares[q] - front.shares[row]), front.ids[q]))
        if not better:
            continue
        held, failing = None, None
        for q in better:
            for j in (j for j in range(len(names)) if j != i):
                costs = [rates[k, j] * gains[q, k] for k in range(len(names)) if k != j]
                if abs(sum(costs) + gains[q, j]) > 0.1 * sum(map(abs, costs)):
                    failing = q
            if failing is not None:
                break
            held = q
        costs = [f"{digits(rates[i, j])} {units[j]}".rstrip() + f" of {names[j]}" for j in range(len(names)) if j != i]
        verb, per = ("gaining" if front.maximised[i] else "saving"), units[i] or "unit"
        words = f"By its certificate, {verb} {name} costs {' or '.join(costs)} per {per}"
        words += ", the others unchanged" if len(names) > 2 else ""
        if held is not None:
            away = f"{digits(gains[held, i])} {units[i]}".rstrip()
            words += f"; that holds within 10% as far as point {front.ids[held]}, {away} away"
        elif failing is not None:
            words += f"; it is off by more than 10% already at point {front.ids[failing]}"
        sentences.append(words + ".")
    return " ".join(sentences)


def with_certificates(front: Front, weights: np.ndarray) -> Front:
    """Return a front with exchange rates from weights (points, n_obj) of the minimised objectives."""
    signs = np.where(front.maximised, -1.0, 1.0)
    rates = -weights[:, :, None] / weights[:, None, :] * (signs[:, None] * signs)
    rates[:, np.arange(len(signs)), np.arange(len(signs))] = 1.0
    widths = np.ptp(front.ranges, axis=1)
    return replace(front, certificates=minima(weights * widths / (weights * widths).sum(axis=1, keepdims=True), rates))


def convex_front(n_obj: int, points: int, seed: int) -> Front:
    """Return points on a sphere that bulges towards the best corner, with exact exchange rates."""
    rng = np.random.default_rng(seed)
    normals = np.abs(rng.normal(size=(points, n_obj))) + 0.05
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    scales = 10.0 ** rng.uniform(-2, 2, n_obj)
    maximised = rng.random(n_obj) < 0.4
    values = (1.0 - normals) * scales
    front = Front(
        ids=rng.permutation(10 * points)[:points],
        objectives=np.where(maximised, -values, values),
        names=[f"f{axis}" for axis in range(n_obj)],
        units=["J", "", "m"][:n_obj],
        maximised=maximised.tolist(),
    )
    return with_certificates(front, 1.0 / scales * (1.0 - front.minimised / scales))


@pytest.mark.parametrize("block", range(2))
def test_every_number_in_a_reason_follows_from_the_points_of_the_front(block):
    for seed in range(block * 40, (block + 1) * 40):
        front = random_front(seed, points=2 + seed % 30)
        row = seed % len(front)
        if len(front) > 1:
            check_reason(front, front.choice(row, f"Point {front.ids[row]} was taken."))


@pytest.mark.parametrize("n_obj", [2, 3])
def test_every_number_about_exchange_rates_follows_from_the_certificates_and_the_points(n_obj):
    held = 0
    for seed in range(40):
        front = convex_front(n_obj, 5 + 4 * seed, seed)
        choice = front.choice(seed % len(front), "It was taken.")
        check_reason(front, choice)
        held += any(rate.holds_to is not None for rate in choice.rates)
    assert held > 15


def test_a_rate_does_not_hold_beyond_a_jump(monkeypatch):
    front = convex_front(2, 60, 1)
    whole = front.choice(30, "")
    rate = whole.rates[0]
    assert abs(front.ids.tolist().index(rate.holds_to) - 30) > 1
    jumps = tuple((int(front.ids[i]), int(front.ids[i + 1])) for i in (28, 31))
    monkeypatch.setattr(Front, "jumps", jumps)
    cut = {each.gain: each for each in convex_front(2, 60, 1).choice(30, "").rates}
    sides = {front.ids[29], front.ids[31]}
    assert {each.holds_to for each in cut.values()} == sides
    assert {each.fails_at for each in cut.values()} == {front.ids[28], front.ids[32]}


def test_the_reason_gives_an_interval_of_rates():
    front = convex_front(2, 9, 2)
    intervals = front.certificates.exchange_intervals * np.array([1.0, 1.5])
    front = replace(front, certificates=replace(front.certificates, exchange_intervals=intervals))
    rate = abs(front.certificates.exchange_rates[4, 0, 1])
    assert f"costs {rate:.3g} to {1.5 * rate:.3g} of f1 per J" in front.choice(4, "").reason


def test_the_reason_says_if_an_objective_has_no_weight():
    front = convex_front(2, 9, 2)
    certificates = replace(
        front.certificates,
        weights=np.where(np.arange(9)[:, None] == 0, [1.0, 0.0], front.certificates.weights),
        exchange_intervals=np.where(
            np.arange(9)[:, None, None, None] == 0, np.nan, front.certificates.exchange_intervals
        ),
    )
    assert (
        replace(front, certificates=certificates)
        .choice(0, "")
        .reason.endswith("No exchange rate is certified here: f1 has no weight, as at an end of the front.")
    )
