"""How often the best optimum is found: our plan against multi-starts of IPOPT and FATROP; losses first.

    python -m studies.benchmarks.basins [--quick] [--problems TEXT ...] [--seed N] [--seeds N] [--cluster ADDRESS]
                                       [--json FILE]

Sixty problems drawn from a seed, by backward differences as the peers' programs have. Ours are plans at default
settings over several seeds. A peer gets as much processor time as all of these together; its starts alternate between
starts like ours and plain rollouts, and its motions are led back to the path and judged by our exact functions. FATROP
has neither cycles nor peaks. Building programs and making starts are not counted for peers; ours is a whole plan.

The time to the best is the time of all tries divided by the number that ended there. Twenty seeds take hours, three
about 40 minutes; --json writes the rows so far.
"""

from __future__ import annotations

import math
import resource
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import lru_cache, partial
from multiprocessing import get_context
from multiprocessing.connection import Connection

import numpy as np

import paretoik as pk
from paretoik.errors import ParetoikError
from paretoik.robot.kinematics import forward_kinematics
from paretoik.task.motion_task import MotionTask
from paretoik.task.objectives import Objective
from paretoik.task.random_starts import rollout_starts
from paretoik.trajectory.plan_starts import sample_starts
from problems.panda import panda
from studies.benchmarks.certified.attacks import led_back, objectives, violation
from studies.benchmarks.peers.programs import joint_program, staged_program
from studies.benchmarks.peers.solvers import Peer
from studies.processes import each_result, workers_of
from studies.reporting import Row, goal_row, losses_first, report, save_rows, study_parser, tell, versus

SAMPLES = 51
DRAWS = 200  # of a path, at most: the arm cannot reach many of them
INTEGRALS: tuple[Objective, ...] = (pk.kinetic_energy, pk.torque_norm)
PEAKS: tuple[Objective, ...] = (pk.peak_velocity, pk.peak_torque)
NONE = pk.Limits(velocity=np.inf, torque=np.inf)  # only the joints' ranges


@dataclass(frozen=True, kw_only=True)
class Case:
    """A problem drawn from a seed: an arm, the axes of its task, whether it is a cycle, and its objective."""

    arm: str
    axes: str  # "position", "axis" or "pose"
    cyclic: bool
    objective: Objective
    seed: int

    @property
    def name(self) -> str:
        """Name of the problem, unique."""
        kind = "cycle" if self.cyclic else "line"
        return f"{self.arm} {self.axes} {kind} {self.objective.name} {self.seed}"

    def problem(self) -> pk.Tracking:
        """Return the problem: the first draw that the arm can follow."""
        return _draw(self)


def planar(joints: int, rng: np.random.Generator) -> pk.Arm:
    """Return a planar arm with a total length of 1 m, random links, tapered masses."""
    lengths = rng.uniform(0.6, 1.4, joints)
    lengths /= lengths.sum()
    masses = 2.0 * np.linspace(1.0, 0.4, joints) * rng.uniform(0.7, 1.3, joints)
    return pk.Arm.planar(
        lengths=lengths,
        masses=masses,
        centers=lengths / 2,
        inertias=masses * lengths**2 / 12,
        position_limits=np.deg2rad(160.0),
        name=f"planar {joints}R",
    )


def rail(rng: np.random.Generator) -> pk.Arm:
    """Return a planar 3R arm on a rail along x."""
    lengths, masses = rng.uniform(0.2, 0.4, 3), rng.uniform(0.5, 1.5, 3)
    centers = np.stack([np.append(lengths / 2, 0.0)[[3, 0, 1, 2]], np.zeros(4), np.zeros(4)], axis=1)
    inertias = [
        np.zeros((3, 3)),
        *(np.diag([0.0, m * a**2 / 12, m * a**2 / 12]) for m, a in zip(masses, lengths, strict=True)),
    ]
    arm = pk.Arm.from_dh(
        a=[0.0, 0.0, lengths[0], lengths[1]],
        alpha=[0.0, np.pi / 2, 0.0, 0.0],
        d=np.zeros(4),
        theta=[-np.pi / 2, 0.0, 0.0, 0.0],
        types=["prismatic", "revolute", "revolute", "revolute"],
        masses=[rng.uniform(1.0, 4.0), *masses],
        centers=centers,
        inertias=inertias,
        convention="modified",
        position_limits=[0.8, *[np.deg2rad(160.0)] * 3],
        name="rail",
    )
    tool = pk.Pose(np.array([lengths[2], 0.0, 0.0]))
    return arm.with_tool(tool).mounted(base=pk.Pose.from_rpy((0, 0, 0), (0, np.pi / 2, 0)))


def _rods(a: np.ndarray, d: np.ndarray, masses: np.ndarray) -> dict[str, object]:
    """Return masses, centres and inertias of links as rods, in the frames at their far ends."""
    lengths = np.maximum(np.hypot(a, d), 0.05)
    centers = -0.5 * np.stack([a, np.zeros_like(a), np.zeros_like(a)], axis=1)
    return {
        "masses": masses,
        "centers": centers,
        "inertias": [np.eye(3) * m * (length**2 / 12 + 0.001) for m, length in zip(masses, lengths, strict=True)],
    }


def ur10(rng: np.random.Generator) -> pk.Arm:
    """Return Universal Robots' UR10: published DH table and masses, links as rods."""
    a, d = np.array([0, -0.612, -0.5723, 0, 0, 0]), np.array([0.1273, 0, 0, 0.163941, 0.1157, 0.0922])
    return pk.Arm.from_dh(
        a=a,
        alpha=[np.pi / 2, 0, 0, np.pi / 2, -np.pi / 2, 0],
        d=d,
        theta=np.zeros(6),
        convention="standard",
        position_limits=np.deg2rad(180.0),
        name="UR10",
        **_rods(a, d, np.array([7.778, 12.93, 3.87, 1.96, 1.96, 0.202])),  # type: ignore[arg-type]
    )


def iiwa(rng: np.random.Generator) -> pk.Arm:
    """Return KUKA's LBR iiwa 14: published DH table, limits and masses, links as rods."""
    a, d = np.zeros(7), np.array([0.36, 0, 0.42, 0, 0.4, 0, 0.126])
    quarter = np.pi / 2
    return pk.Arm.from_dh(
        a=a,
        alpha=[-quarter, quarter, quarter, -quarter, -quarter, quarter, 0],
        d=d,
        theta=np.zeros(7),
        convention="standard",
        position_limits=np.deg2rad([170, 120, 170, 120, 170, 120, 175]),
        name="iiwa",
        **_rods(a, d, np.array([3.95, 4.50, 2.45, 2.61, 3.41, 3.39, 0.35])),  # type: ignore[arg-type]
    )


def random_arm(rng: np.random.Generator) -> pk.Arm:
    """Return a 7R arm with a random DH table of quarter turns."""
    a, d = rng.uniform(0.0, 0.25, 7), rng.uniform(0.0, 0.25, 7)
    return pk.Arm.from_dh(
        a=a,
        alpha=rng.choice([-1.0, 1.0], 7) * np.pi / 2,
        d=d,
        theta=np.zeros(7),
        convention="standard",
        position_limits=np.deg2rad(160.0),
        name="random 7R",
        **_rods(a, d, np.linspace(4.0, 0.5, 7)),  # type: ignore[arg-type]
    )


ARMS: dict[str, Callable[[np.random.Generator], pk.Arm]] = {
    "planar 3R": lambda rng: planar(3, rng),
    "planar 4R": lambda rng: planar(4, rng),
    "planar 5R": lambda rng: planar(5, rng),
    "planar 6R": lambda rng: planar(6, rng),
    "rail": rail,
    "random 7R": random_arm,
    "UR10": ur10,
    "iiwa": iiwa,
    "Panda": lambda rng: panda(),
}


@lru_cache(maxsize=4)
def _draw(case: Case) -> pk.Tracking:
    rng = np.random.default_rng([case.seed, *case.arm.encode()])
    arm = ARMS[case.arm](rng)
    for _ in range(DRAWS):
        try:
            path = _path(arm, case, rng)
            return pk.Tracking(
                arm, path, objectives=[case.objective], cyclic=case.cyclic, limits=NONE, differences="backward"
            )
        except ParetoikError:
            continue
    raise AssertionError(f"{case.name}: no path that the arm can follow in {DRAWS} draws")


def _path(arm: pk.Arm, case: Case, rng: np.random.Generator) -> pk.Path | pk.Task:
    """Return a path between the positions of two postures, or a circle at one."""
    lower, upper = np.clip(arm.position_limits, -np.pi, np.pi).T
    q = rng.uniform(0.8 * lower, 0.8 * upper)
    ends = [q, np.clip(q + rng.normal(scale=0.7, size=arm.dof), 0.8 * lower, 0.8 * upper)]
    poses = [pk.Pose.from_matrix(*forward_kinematics(arm, each)) for each in ends]
    flat = case.arm == "rail" or arm.is_planar
    points = [pose.position[: 2 if flat else 3] for pose in poses]
    size = float(np.linalg.norm(points[1] - points[0]))
    if not 0.2 <= size <= 0.8:
        raise pk.InvalidInput(f"a path's length must be 0.2 to 0.8 m, got {size:.3g} m")
    settings = {"duration": float(rng.uniform(1.0, 2.0)), "samples": SAMPLES}
    posed = case.axes != "position"
    if case.cyclic:
        centre = pk.Pose(poses[0].position, poses[0].quaternion) if posed else points[0]
        path = pk.circle(centre, 0.3 * size, start_angle=float(rng.uniform(0, 2 * np.pi)), **settings)  # type: ignore[arg-type]
    elif posed:
        path = pk.line(poses[0], poses[1], **settings)  # type: ignore[arg-type]
    else:
        path = pk.line(points[0], points[1], **settings)  # type: ignore[arg-type]
    axes = {"position": "xy" if flat else "xyz", "axis": "xyz+z-axis", "pose": "pose"}[case.axes]
    return pk.Task(path, axes=axes)  # type: ignore[arg-type]


KINDS = (
    ("planar 4R", "position"),
    ("planar 5R", "position"),
    ("planar 6R", "position"),
    ("rail", "position"),
    ("random 7R", "axis"),
    ("random 7R", "pose"),
    ("UR10", "position"),
    ("UR10", "axis"),
    ("iiwa", "position"),
    ("iiwa", "axis"),
    ("iiwa", "pose"),
    ("Panda", "pose"),
)


def all_cases(seed: int) -> list[Case]:
    """Return 60 problems drawn from a seed: every kind as a line and a cycle for sums, and another draw for a peak."""
    sums = [
        Case(arm=arm, axes=axes, cyclic=cyclic, objective=objective, seed=seed)
        for arm, axes in KINDS
        for cyclic in (False, True)
        for objective in INTEGRALS
    ]
    peaks = [
        Case(arm=arm, axes=axes, cyclic=bool(i % 2), objective=PEAKS[i // 2 % 2], seed=seed + 1)
        for i, (arm, axes) in enumerate(KINDS)
    ]
    return sums + peaks


@dataclass(frozen=True, kw_only=True)
class RacingOptions:
    """How tries are judged, and how many of a peer's ``starts`` are made at a time.

    A value counts as the best up to a share ``equal`` of it. A peer's motion counts as feasible up to a ``violation``,
    a share of a limit's range. A problem takes minutes, at most ``limit`` [s]; with a limit a cluster's workers compute
    in a separate process.
    """

    equal: float = 1e-6
    violation: float = 1e-8
    starts: int = 24
    limit: float = 4 * 3600.0


OPTIONS = RacingOptions()


@dataclass(kw_only=True)
class Tries:
    """Values that a method found, and the processor seconds of each try."""

    values: list[float] = field(default_factory=list)
    seconds: list[float] = field(default_factory=list)

    @property
    def best(self) -> float:
        """The best value; infinite without one."""
        return min(self.values, default=np.inf)

    def hits(self, best: float) -> int:
        """Return the number of tries that ended at the best."""
        return sum(value <= best * (1 + OPTIONS.equal) for value in self.values)

    def time_to_best(self, best: float) -> float:
        """Return the expected processor time of independent tries to the best."""
        hits = self.hits(best)
        return sum(self.seconds) / hits if hits else np.inf


@dataclass(frozen=True, kw_only=True)
class Race:
    """The result for a problem: our tries, and those of every peer."""

    case: Case
    redundancy: int
    ours: Tries
    peers: dict[str, Tries]

    @property
    def peers_best(self) -> float:
        """The best value of all peers."""
        return min(tries.best for tries in self.peers.values())

    @property
    def best(self) -> float:
        """The best value of all methods."""
        return min(self.ours.best, self.peers_best)

    @property
    def time_ratio(self) -> float:
        """Our time to the best over the better peer's; 0 without a peer, infinite if we did not find it."""
        theirs = min(tries.time_to_best(self.best) for tries in self.peers.values())
        ours = self.ours.time_to_best(self.best)
        return ours / theirs if np.isfinite(ours) else np.inf

    @property
    def summary(self) -> str:
        """One line: values, hits of each, and time."""
        sides = {"ours": self.ours, **self.peers}
        hits = ", ".join(f"{name} {tries.hits(self.best)}/{len(tries.values)}" for name, tries in sides.items())
        return (
            f"{self.case.name}: redundancy {self.redundancy}, best {self.ours.best:.8g} beside {self.peers_best:.8g} "
            f"({self.ours.best / self.best - 1:.1e} worse), {hits}, {sum(self.ours.seconds):.1f} s, "
            f"time ratio {self.time_ratio:.2g}"
        )


def race_named(name: str, *, seed: int, seeds: int) -> Race:
    """Return the race of the problem with a name: by name so that it can run in another process."""
    return race(next(case for case in all_cases(seed) if case.name == name), seeds=seeds)


def race(case: Case, *, seeds: int) -> Race:
    """Return the race of one problem. FATROP's form has neither peaks nor cycles."""
    problem = case.problem()
    pk.plan(problem, starts=1)  # compiles
    ours = Tries()
    for seed in range(seeds):
        start = time.process_time()
        try:
            ours.values.append(pk.plan(problem, seed=seed).best.objective)
        except ParetoikError:
            ours.values.append(np.inf)
        ours.seconds.append(time.process_time() - start)
    budget = sum(ours.seconds)
    peers = {"IPOPT": peer_tries(joint_program(problem.task), problem.task, budget, case.seed)}
    if not case.cyclic and case.objective.form != "peak":
        peers["FATROP"] = peer_tries(staged_program(problem.task), problem.task, budget, case.seed)
    return Race(case=case, redundancy=problem.task.redundancy, ours=ours, peers=peers)


def peer_tries(peer: Peer, task: MotionTask, budget: float, seed: int) -> Tries:
    """Return a peer's results in a processor time, from starts like ours alternating with plain rollouts.

    It runs in a process of its own, which ends with its time: FATROP sometimes never returns from a start.
    """
    context, tries = get_context("fork"), Tries()
    reader, writer = context.Pipe(duplex=False)
    process = context.Process(target=_solve_starts, args=(writer, peer, task, budget, seed))
    process.start()
    writer.close()
    with suppress(EOFError):
        while True:
            value, seconds = reader.recv()
            tries.values.append(value)
            tries.seconds.append(seconds)
    process.join()
    remaining = budget - sum(tries.seconds)
    if remaining > 0:  # the last try did not end
        tries.values.append(np.inf)
        tries.seconds.append(remaining)
    return tries


def _solve_starts(writer: Connection, peer: Peer, task: MotionTask, budget: float, seed: int) -> None:
    """Send value and seconds of one start after another until a budget [s] is spent."""
    spent = 0.0
    for q in _starts(task, seed):
        start = time.process_time()
        resource.setrlimit(resource.RLIMIT_CPU, (math.ceil(start + budget - spent) + 1, resource.RLIM_INFINITY))
        end = peer.solve(q).motion
        seconds = time.process_time() - start
        resource.setrlimit(resource.RLIMIT_CPU, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
        motion = None if end is None else led_back(task, end)
        feasible = motion is not None and violation(task, motion) <= OPTIONS.violation
        writer.send((float(objectives(task, motion)[0]) if feasible and motion is not None else np.inf, seconds))
        spent += seconds
        if spent >= budget:
            return


def _starts(task: MotionTask, seed: int) -> Iterator[np.ndarray]:
    """Yield starts without end."""
    rng = np.random.default_rng(seed)
    while True:
        both = [sample_starts(task, OPTIONS.starts, rng), rollout_starts(task, OPTIONS.starts, rng)[: OPTIONS.starts]]
        yield from rng.permutation(np.concatenate(both))


NO_WORSE, WON = 1e-7, 58 / 60  # goals: ours above the peers' best by at most a share; on a share of problems
TIME = 0.5  # goal: our time to the best over the better peer's
HITS = (0.95, 0.85)  # goals: shares of seeds that find the best, redundancy 1 and 2, and more


def table_rows(races: Sequence[Race]) -> list[Row]:
    """Return the summary, then the rows of all problems, losses first."""
    rows = list[Row]()
    for each in races:  # the best values, and the times to the best with every peer's
        table, name, best = f"redundancy {each.redundancy}", each.case.name, each.best
        note = f"ours {each.ours.hits(best)} of {len(each.ours.values)} seeds"
        place, goal = (table, name, "best found", each.case.objective.unit), 1 + NO_WORSE
        rows.append(versus(*place, each.ours.best, each.peers_best, goal=goal, note=note))
        for peer, tries in each.peers.items():
            note = f"{peer} {tries.hits(best)} of {len(tries.values)} starts"
            times = each.ours.time_to_best(best), tries.time_to_best(best)
            rows.append(versus(table, name, f"time to best, {peer}", "s", *times, goal=TIME, note=note))
    return summary_rows(races) + losses_first(rows)


def summary_rows(races: Sequence[Race]) -> list[Row]:
    """Return the number of problems on which no peer is better, the median time ratio, and hit rates by redundancy."""
    won = sum(each.ours.best <= (1 + NO_WORSE) * each.peers_best for each in races)
    ratios, count = [each.time_ratio for each in races], len(races)
    within = f"{sum(ratio <= TIME for ratio in ratios)} of {count} problems within the goal"
    better, row = "no peer better by more than 1e-7", "time to best over the better peer's"
    rows = [
        goal_row("summary", better, "all", "problems", won, np.ceil(WON * count), f"of {count} problems", least=True),
        Row("summary", row, "median", "", float(np.median(ratios)), source="goal", reference=TIME, note=within),
    ]
    for high, name in enumerate(("redundancy 1 and 2", "redundancy 3 and more")):
        group = [each for each in races if (each.redundancy > 2) == bool(high)]
        if group:
            share = sum(each.ours.hits(each.best) for each in group) / sum(len(each.ours.values) for each in group)
            place, note = ("summary", f"seeds that find the best, {name}", "all", "share"), f"of {len(group)} problems"
            rows.append(goal_row(*place, share, HITS[high], note, least=True))
    return rows


SEEDS, QUICK_SEEDS = 20, 2
QUICK = 4  # problems


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the benchmark."""
    parser = study_parser(__doc__, quick="four problems, two seeds", cluster="each problem's race")
    parser.add_argument("--problems", nargs="+", metavar="TEXT", help="only problems whose names contain one of these")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--seeds", type=int, help="plans of each problem")
    options = parser.parse_args(arguments)
    cases = all_cases(options.seed)
    if options.problems:
        cases = [case for case in cases if any(text in case.name for text in options.problems)]
    if options.quick:
        cases = cases[:QUICK]
    seeds = options.seeds or (QUICK_SEEDS if options.quick else SEEDS)
    calls = {(case.name,): partial(race_named, case.name, seed=options.seed, seeds=seeds) for case in cases}
    races, done = list[Race](), dict[tuple[str], Race]()
    with workers_of(options.cluster) as executor:
        for name, one in each_result(executor, calls, limit=OPTIONS.limit):
            done[name] = one
            races = [done[each] for each in calls if each in done]
            tell(one.summary)
            if options.json is not None:
                save_rows(table_rows(races), options.json)
    report(table_rows(races), json_file=options.json)


if __name__ == "__main__":
    from studies.benchmarks.basins import main as named_main  # workers know its functions by this name

    named_main()
