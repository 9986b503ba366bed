"""Figure 8: from p4 to p6 by looking ahead, against the fastest path, and against the arm's best on that path."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from paretoik.capability.geodesic import FastestPath, fastest_path, path_time
from paretoik.capability.speed_models import SpeedModel
from paretoik.capability.time_optimal import Formulation, Plan, Planner, TimeOptimalRun, time_optimal_control
from paretoik.errors import ParetoikError
from studies.kim_2021.maxima import AS_PAPER, MECHANISMS, POSITIONS, UNPRINTED, Surrogates, beside_paper, paper, speeds
from studies.kim_2021.postures import evenly
from studies.reporting import Row

TABLE, CHEATING = "Figure 8", "Equation 6 as printed, one plan of ten pieces from p4"
START, TARGET = POSITIONS["p4"], POSITIONS["p6"]
MIDDLE = 0.150  # m: x of p5
HORIZON, PERIOD = 10, 1e-3
UPWARDS = f"LOSS: ours goes up, the paper's comes down; it {UNPRINTED}"


@dataclass(frozen=True, kw_only=True, eq=False)
class Trajectory:
    """A mechanism's trajectory, the fastest path of its model, and plans of Eq. 6 as printed and as used.

    ``possible`` [s] is the trajectory's time if the tool is everywhere as fast as its directional maximum;
    ``paper_model`` is the result of the paper's own pipeline, (a, b, c) fitted to nine positions, ``paper_possible``
    [s] the same for that. Without such an ellipse on the way: None, and why in words.
    """

    mechanism: str
    surrogates: Surrogates
    run: TimeOptimalRun
    geodesic: FastestPath
    plans: dict[str, Plan]
    possible: float
    paper_model: TimeOptimalRun | None
    paper_possible: float
    paper_fault: str

    @property
    def path(self) -> Float[np.ndarray, "n 2"]:
        """The references from p4 to p6 [m]."""
        return references(self.run)


def trajectory(surrogates: Surrogates, *, period: float = PERIOD, samples: int = 200) -> Trajectory:
    """Return the trajectory by the ellipsoids fitted to the grid."""
    model = surrogates.models["ellipsoids"]
    run = time_optimal_control(model, START, TARGET, horizon=HORIZON, period=period)
    paper_model, paper_possible, fault = None, np.nan, ""
    try:
        paper_model = time_optimal_control(surrogates.models[AS_PAPER], START, TARGET, horizon=HORIZON, period=period)
        paper_possible = possible_time(surrogates.mechanism, references(paper_model), samples)
    except ParetoikError as error:
        fault = str(error)
    return Trajectory(
        mechanism=surrogates.mechanism,
        surrogates=surrogates,
        run=run,
        geodesic=fastest_path(model, START, TARGET),
        plans={"printed": fastest_plan(model, formulation="printed"), "midpoint": fastest_plan(model)},
        possible=possible_time(surrogates.mechanism, references(run), samples),
        paper_model=paper_model,
        paper_possible=paper_possible,
        paper_fault=fault,
    )


def fastest_plan(model: SpeedModel, *, formulation: Formulation = "midpoint") -> Plan:
    """Return the plan of least claimed time from p4 to p6."""
    planner = Planner(model, horizon=HORIZON, formulation=formulation)
    return planner.plan(planner.initial_points(np.array(START), np.array(TARGET)))


def references(run: TimeOptimalRun) -> Float[np.ndarray, "n 2"]:
    """Return the references of a run until it arrives [m]."""
    return run.references[: round(run.arrival / (run.times[1] - run.times[0])) + 1]


def possible_time(mechanism: str, points: Float[np.ndarray, "n 2"], samples: int) -> float:
    """Return ∫ ds / v(d, p) [s] along a path, v the exact directional maxima in the middles of as many pieces.

    Postures are free at every point, so that no motion of the arm is quicker, and none need be as quick.
    """
    even = evenly(points, samples)
    change, middle = np.diff(even, axis=0), (even[1:] + even[:-1]) / 2
    far = np.linalg.norm(change, axis=1)
    fastest = [speeds(mechanism, place, way[None])[0] for place, way in zip(middle, change, strict=True)]
    return float(np.sum(far / np.array(fastest)))


def sag(points: Float[np.ndarray, "n 2"]) -> float:
    """Return how far [mm] a path is below the straight line at the x of p5."""
    return 1e3 * float(START[1] - np.interp(MIDDLE, points[:, 0], points[:, 1]))


def figure_8(trajectories: dict[str, Trajectory]) -> list[Row]:
    """Return arrivals and sags, the oracle's, the model's errors in seconds, and the paper's own pipeline's."""
    rows = [row for one in trajectories.values() for row in _arrival_rows(one)]
    arrivals = {True: list[float](), False: list[float]()}  # by whether the model is the paper's own
    for name, one in trajectories.items():
        # polynomials (a, b, c) fitted to the paper's nine positions
        printed, run, row = paper()[TABLE, name, "arrival"], one.paper_model, f"{name}, {AS_PAPER}"
        arrivals[True].append(np.nan if run is None else run.arrival)
        arrivals[False].append(one.run.arrival)
        note = one.paper_fault
        if run is not None:
            note = (
                f"{100 * (run.arrival / printed - 1):+.1f} %, by ellipsoids on the grid {one.run.arrival:.4g} s; its "
            )
            note += f"ellipses are {100 * (run.arrival / one.paper_possible - 1):+.1f} % off on this path"
        rows.append(Row(TABLE, row, "arrival", "s", arrivals[True][-1], reference=printed, note=note))
        down, column = np.nan if run is None else sag(references(run)), "sag at x = 150 mm"
        note = UPWARDS if down < 0 else UNPRINTED
        rows.append(Row(TABLE, row, column, "mm", down, reference=paper()[TABLE, name, column], note=note))
    for is_paper, (first, second) in arrivals.items():
        row = "DAM beside JAM" + (f", {AS_PAPER}" if is_paper else "")
        printed, note = paper()[TABLE, "DAM beside JAM", "arrival"], f"who is sooner, and by how much, {UNPRINTED}"
        rows.append(Row(TABLE, row, "arrival", "%", 100 * (second / first - 1), reference=printed, note=note))
    first, second = (trajectories[mechanism].possible for mechanism in MECHANISMS)
    place, note = (TABLE, "DAM beside JAM", "arrival, exact maxima"), "along each one's trajectory, not by ellipses"
    return [*rows, beside_paper(place, "%", 100 * (second / first - 1), note)]


def _arrival_rows(one: Trajectory) -> list[Row]:
    name, arrival, down = one.mechanism, one.run.arrival, sag(one.path)
    later = 100 * (arrival / paper()[TABLE, name, "arrival"] - 1)
    exact = f"ellipses are {100 * (arrival / one.possible - 1):+.1f} % off on this path; postures free to jump"
    entries = [
        ("arrival", "s", arrival, f"{later:+.1f} %; its plant is the model: it keeps to the reference"),
        ("sag at x = 150 mm", "mm", down, UNPRINTED if down > 0 else UPWARDS),
        ("fastest path, 100 pieces", "s", one.geodesic.duration, f"sag {sag(one.geodesic.points):.2f} mm"),
        ("trajectory, by exact maxima", "s", one.possible, exact),
    ]
    return [beside_paper((TABLE, name, column), unit, value, note) for column, unit, value, note in entries]


def cheating(trajectories: dict[str, Trajectory]) -> list[Row]:
    """Return the claim of a plan of Eq. 6 and the time of its path, as printed and with a common interval."""
    rows = []
    for one in trajectories.values():
        model, least = one.surrogates.models["ellipsoids"], one.geodesic.duration
        for name, plan in one.plans.items():
            true = path_time(model, plan.points)
            note = f"fastest path {least:.4f} s"
            if plan.time_to_go < least:
                note = f"claims {100 * (1 - plan.time_to_go / least):.2f} % less than is possible; {note}"
            pieces = np.linalg.norm(np.diff(plan.points, axis=0), axis=1)
            longest = f"its longest piece is {1e3 * pieces.max():.0f} mm, its shortest {1e3 * pieces.min():.2g} mm"
            row = f"{one.mechanism}, {name}"
            rows.append(beside_paper((CHEATING, row, "claimed"), "s", plan.time_to_go, note))
            rows.append(beside_paper((CHEATING, row, "re-timed"), "s", true, longest))
    return rows
