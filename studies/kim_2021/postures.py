"""Postures along a path and their durations: every joint turns as fast as it can while it holds the arm.

A path leaves a planar arm with three joints one freedom: the direction of its last link. Between neighbouring samples
every joint turns by the difference, so that a piece takes the time of its slowest joint. The soonest postures without a
jump come from dynamic programming over a grid that covers whole turns of the last link and both elbows, global but for
its steps. From there linear programs move all angles at once, which no grid does: if several joints are equally slow,
the steps of a grid are in the way.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from scipy import sparse
from scipy.optimize import linprog

import paretoik as pk
from paretoik.capability.joint_capability import joint_speeds
from paretoik.errors import SolverFailed
from paretoik.robot.dynamics import gravity_torques


@dataclass(frozen=True, kw_only=True, eq=False)
class Mechanism:
    """An arm and its actuation."""

    arm: pk.Arm
    actuation: pk.capability.JointActuation | pk.capability.DistributedActuation


@dataclass(frozen=True, kw_only=True, eq=False)
class Profile:
    """Postures ``q`` (n, 3) along ``points`` (n, 2) [m], ``times`` (n,) [s]; holding torques ``torque`` (n, 3).

    ``angles`` (n,) are the last link's, ``elbows`` (n,) the signs of the second joint's angle.
    """

    points: Float[np.ndarray, "n 2"]
    angles: Float[np.ndarray, " n"]
    elbows: Float[np.ndarray, " n"]
    q: Float[np.ndarray, "n 3"]
    torque: Float[np.ndarray, "n 3"]
    times: Float[np.ndarray, " n"]

    @property
    def turned(self) -> Float[np.ndarray, "pieces 3"]:
        """Turn of the joints in every piece [rad]."""
        return wrap_angles(np.diff(self.q, axis=0))

    @property
    def work(self) -> Float[np.ndarray, " 3"]:
        """∫ |τ q̇| dt of every joint [J]."""
        loaded = np.abs(self.torque[1:] + self.torque[:-1]) / 2
        slowness: np.ndarray = (loaded * np.abs(self.turned)).sum(axis=0)
        return slowness


@dataclass(frozen=True, kw_only=True, eq=False)
class Nodes:
    """Possible postures of each sample, their torques [N m], and 1 / speed [s/rad] down and up: inf if impossible."""

    q: Float[np.ndarray, "samples choices 3"]
    torque: Float[np.ndarray, "samples choices 3"]
    slowness: Float[np.ndarray, "2 samples choices 3"]


def nodes(
    mechanism: Mechanism,
    points: Float[np.ndarray, "samples 2"],
    angles: Float[np.ndarray, "samples choices"],
    elbows: object,
) -> Nodes:
    """Return postures by the last link's angle and the sign of the second joint's."""
    arm = mechanism.arm
    first, second, third = (pose.position[0] for pose in (arm.placements[1], arm.placements[2], arm.tool))
    wrist = points[:, None] - third * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    x, y = wrist[..., 0], wrist[..., 1]
    cosine = (x**2 + y**2 - first**2 - second**2) / (2 * first * second)
    bent = np.asarray(elbows) * np.arccos(np.clip(cosine, -1.0, 1.0))
    begun = np.arctan2(y, x) - np.arctan2(second * np.sin(bent), first + second * np.cos(bent))
    q = wrap_angles(np.stack([begun, bent, angles - begun - bent], axis=-1))
    torque = gravity_torques(arm, q)
    known = joint_speeds(mechanism.actuation, q, torque)
    speeds = np.stack([-known.low, known.high])
    low, high = np.where(np.isfinite(arm.position_limits), arm.position_limits, [-np.pi, np.pi]).T
    inside = np.abs(wrap_angles(q - (low + high) / 2)) <= (high - low) / 2
    able = (np.abs(cosine) <= 1.0)[..., None] & inside & (speeds > 0)  # NaN, if it cannot hold, is not above 0
    slowness = np.divide(1.0, speeds, out=np.full_like(speeds, np.inf), where=able)
    return Nodes(q=q, torque=torque, slowness=slowness)


def minimum_timing(
    mechanism: Mechanism,
    points: Float[np.ndarray, "n 2"],
    angles: Float[np.ndarray, " n"],
    elbows: Float[np.ndarray, " n"],
) -> Profile:
    """Return a profile with its times: every piece takes that of its slowest joint."""
    known = nodes(mechanism, points, angles[:, None], elbows[:, None])
    q, slowness = known.q[:, 0], known.slowness[:, :, 0]
    pieces = lasting(wrap_angles(np.diff(q, axis=0)), slowness[:, :-1], slowness[:, 1:]).max(axis=-1)
    times = np.append(0.0, np.cumsum(pieces))
    return Profile(points=points, angles=angles, elbows=elbows, q=q, torque=known.torque[:, 0], times=times)


def evenly(points: Float[np.ndarray, "n 2"], pieces: int) -> Float[np.ndarray, "m 2"]:
    """Return points of a path at equal distances along it."""
    along = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
    places = np.linspace(0.0, along[-1], pieces + 1)
    return np.stack([np.interp(places, along, column) for column in points.T], axis=1)


def lasting(
    turned: Float[np.ndarray, "*batch 3"],
    before: Float[np.ndarray, "2 *batch 3"],
    after: Float[np.ndarray, "2 *batch 3"],
) -> Float[np.ndarray, "*batch 3"]:
    """Return the time of each joint [s], by the mean slowness of both ends in its direction of turning."""
    mean = (before + after) / 2
    with np.errstate(invalid="ignore"):
        slow = np.abs(turned) * np.where(turned < 0, mean[0], mean[1])
    slowness: np.ndarray = np.where(np.isnan(slow), np.inf, slow)
    return slowness


def wrap_angles(angle: np.ndarray) -> np.ndarray:
    """Return angles within half a turn of 0."""
    wrapped: np.ndarray = angle - 2 * np.pi * np.round(angle / (2 * np.pi))
    return wrapped


ELBOWS = (1.0, -1.0)
TIE = 1e-3  # s/J: among equally soon postures prefer less work; otherwise joints that do not count wander
FURTHEST = np.deg2rad(200.0)  # most turn of the last link on the grid, if all pieces turned as far as they may
EASY = 1.0  # s/J: another price of work to begin with
RADIUS, SHORTEST = np.deg2rad(1.0), np.deg2rad(1e-4)  # of a linear program's moves
NEARBY = 1e-6  # rad, for differences
LOOKED = 4  # positions within the radius, either way, that are tested for whether joints can hold there
ITERATIONS, SETTLED = 300, 1e-9


def resolved(
    mechanism: Mechanism, path: Float[np.ndarray, "n 2"], *, pieces: int, cell: float, price: float = TIE
) -> Profile:
    """Return the postures of least time + ``price`` [s/J] · work, with four times as many pieces of the path.

    Raises SolverFailed if none follow the path.
    """
    fine, profiles = evenly(path, 4 * pieces), []
    for first in dict.fromkeys((price, EASY)):  # if work counts for little, the grid has too many ties
        coarse = continuous(mechanism, evenly(path, pieces), cell=cell, price=first)
        # on more points, evenly between those of the grid, the last link's angle linear between
        count = len(coarse.angles)
        places = np.linspace(0, count - 1, len(fine))
        angles = np.interp(places, np.arange(count), np.unwrap(coarse.angles))
        finer = minimum_timing(mechanism, fine, angles, coarse.elbows[np.round(places).astype(int)])
        start = improve_profile(mechanism, finer, first)
        profiles.append(start if first == price else improve_profile(mechanism, start, price))
    return min(profiles, key=lambda one: _whole(one, price))


def continuous(
    mechanism: Mechanism, points: Float[np.ndarray, "n 2"], *, cell: float = 0.1, price: float = TIE
) -> Profile:
    """Return the postures of least time + ``price`` [s/J] · work, from a grid of ``cell`` [degrees].

    Raises SolverFailed if none follow the path.
    """
    count = round(360 / cell)
    turns = 2 * np.pi / count * np.arange(count)
    sides = [nodes(mechanism, points, np.broadcast_to(turns, (len(points), count)), side) for side in ELBOWS]
    chosen = _search_curves(sides, max(1, round(FURTHEST / (len(points) - 1) / turns[1])), price)
    return improve_profile(
        mechanism, minimum_timing(mechanism, points, turns[chosen % count], np.array(ELBOWS)[chosen // count]), price
    )


def improve_profile(mechanism: Mechanism, profile: Profile, price: float = TIE) -> Profile:
    """Return a profile that no linear program can improve."""
    points, angles, elbows, radius = profile.points, profile.angles, profile.elbows, RADIUS
    now = _whole(profile, price)
    for _ in range(ITERATIONS):
        if radius < SHORTEST:
            break
        moves, promised = _program(mechanism, points, angles, elbows, price, radius)
        trial = minimum_timing(mechanism, points, angles + moves, elbows)
        gained = now - _whole(trial, price)
        if gained > 0.1 * promised > 0:
            profile, angles, now = trial, trial.angles, now - gained
        radius = radius / 2 if gained < 0.25 * promised or promised <= SETTLED * now else min(2 * radius, RADIUS)
    return profile


def _search_curves(sides: list[Nodes], reach: int, price: float) -> Int[np.ndarray, " samples"]:
    """Return the choice at each sample, counted through both elbows; neighbours are within reach of each other."""
    samples, choices = sides[0].q.shape[:2]
    togo = [np.where(np.isfinite(side.slowness[0, -1]).all(axis=-1), 0.0, np.inf) for side in sides]
    following = np.zeros((samples, 2 * choices), dtype=int)
    for i in range(samples - 2, -1, -1):
        best = [np.full(choices, np.inf) for _ in sides]
        for here, there in ((0, 0), (0, 1), (1, 0), (1, 1)):
            rows = np.flatnonzero(np.isfinite(sides[here].slowness[0, i]).all(axis=-1))
            for shift in range(-reach, reach + 1):
                turned = (rows + shift) % choices
                cost = _costs(sides[here], sides[there], i, rows, turned, price) + togo[there][turned]
                better = cost < best[here][rows]
                best[here][rows[better]] = cost[better]
                following[i, here * choices + rows[better]] = there * choices + turned[better]
        togo = best
    whole = np.concatenate(togo)
    if not np.isfinite(whole.min()):
        raise SolverFailed("profile: postures without jumps must be held along the whole path, got none")
    chosen = [int(np.argmin(whole))]
    for row in following[:-1]:
        chosen.append(int(row[chosen[-1]]))
    return np.array(chosen)


def _costs(before: Nodes, after: Nodes, i: int, rows: np.ndarray, other: np.ndarray, price: float) -> np.ndarray:
    """Return time + price · work of piece i from some postures to others, inf if one cannot be held."""
    change = wrap_angles(after.q[i + 1, other] - before.q[i, rows])
    time = lasting(change, before.slowness[:, i, rows], after.slowness[:, i + 1, other]).max(axis=-1)
    if price:
        loaded = np.abs(before.torque[i, rows] + after.torque[i + 1, other]) / 2
        time = time + price * (loaded * np.abs(change)).sum(axis=-1)
    cost: np.ndarray = time
    return cost


def _whole(profile: Profile, price: float) -> float:
    return float(profile.times[-1] + price * profile.work.sum())


def _program(
    mechanism: Mechanism, points: np.ndarray, angles: np.ndarray, elbows: np.ndarray, price: float, radius: float
) -> tuple[np.ndarray, float]:
    """Return the moves with the largest first-order gain, and the gain.

    Unknowns are moves, the pieces' times, and the joints' works if they have a price.
    """
    samples, pieces = len(angles), len(angles) - 1
    tables = _tables(mechanism, points, angles, elbows)[: 1 + bool(price)]
    rows, right = list[sparse.csr_array](), list[np.ndarray]()
    piece = np.broadcast_to(np.arange(pieces)[:, None], (2, pieces, 3)).ravel()
    joint = np.broadcast_to(np.arange(3 * pieces).reshape(pieces, 3), (2, pieces, 3)).ravel()
    size = samples + pieces + 3 * pieces * bool(price)
    for what, (here, before, after) in enumerate(tables):
        place = samples + (pieces + joint if what else piece)
        columns = np.concatenate([piece, piece + 1, place])
        entries = np.concatenate([before.ravel(), after.ravel(), -np.ones(len(piece))])
        rows.append(sparse.csr_array((entries, (np.tile(np.arange(len(piece)), 3), columns)), (len(piece), size)))
        right.append(-here.ravel())
    cost = np.concatenate([np.zeros(samples), np.ones(pieces), np.full(size - samples - pieces, price)])
    bounds = [*_room(mechanism, points, angles, elbows, radius), *[(0.0, None)] * (size - samples)]
    solution = linprog(cost, A_ub=sparse.vstack(rows), b_ub=np.concatenate(right), bounds=bounds, method="highs")
    if solution.status != 0:
        return np.zeros(samples), 0.0
    now = tables[0][0].max(axis=(0, 2)).sum() + (price * tables[1][0].max(axis=0).sum() if price else 0.0)
    return solution.x[:samples], float(now - solution.fun)


def _tables(mechanism: Mechanism, points: np.ndarray, angles: np.ndarray, elbows: np.ndarray) -> list[list[np.ndarray]]:
    """Return times and works (2, pieces, 3) for joints turning down and up, with derivatives by angles at both ends.

    At the end of a joint's range, derivatives are those towards the inside.
    """
    near = nodes(mechanism, points, angles[:, None] + NEARBY * np.array([-1.0, 0.0, 1.0]), elbows[:, None])
    at = [_signed(near, *pair) for pair in ((1, 1), (0, 1), (2, 1), (1, 0), (1, 2))]
    tables = []
    for here, *ends in zip(*at, strict=True):
        slopes = []
        for down, up in (ends[:2], ends[2:]):
            down, up = (np.where(np.isfinite(each), each, here) for each in (down, up))
            sides = (down != here).astype(int) + (up != here)
            slopes.append((up - down) / (NEARBY * np.maximum(sides, 1)))
        tables.append([here, *slopes])
    return tables


def _room(
    mechanism: Mechanism, points: np.ndarray, angles: np.ndarray, elbows: np.ndarray, radius: float
) -> list[tuple[float, float]]:
    """Return how far each angle may move either way, within a radius and the range in which joints can hold."""
    steps = radius * np.linspace(-1.0, 1.0, 2 * LOOKED + 1)
    grid = nodes(mechanism, points, angles[:, None] + steps, elbows[:, None])
    able = np.isfinite(grid.slowness).all(axis=(0, 3))
    up, down = (np.cumprod(part, axis=1).sum(axis=1) for part in (able[:, LOOKED + 1 :], able[:, LOOKED - 1 :: -1]))
    return list(zip(steps[LOOKED - down], steps[LOOKED + up], strict=True))


def _signed(near: Nodes, one: int, other: int) -> tuple[np.ndarray, np.ndarray]:
    change = wrap_angles(near.q[1:, other] - near.q[:-1, one])
    mean = (near.slowness[:, :-1, one] + near.slowness[:, 1:, other]) / 2
    loaded = np.abs(near.torque[:-1, one] + near.torque[1:, other]) / 2
    ways = np.stack([-change, change])
    return ways * mean, ways * loaded
