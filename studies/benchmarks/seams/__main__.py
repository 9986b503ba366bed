"""Seams with a free tool axis, against a ladder graph over tool angles; losses first.

    python -m studies.benchmarks.seams [--quick] [--cells NAME ...] [--alone] [--json FILE]

Ours is ``pk.plan`` at its defaults, in a process of its own, after a plan of a coarser seam. One peer is the shortest
path through all postures over a grid of tool angles (and of the rail's positions, and of swivel angles), on the same
cost. The other is tesseract's Descartes on the industrial arm, with at most 16 GB, on its own cost (Σ‖Δq‖, nearly the
same path). All are judged by their samples: joint travel Σ|Δq| and ∫q̇² dt = ΣΔq²/Δt, within position and speed limits;
the graphs' motions may exceed the limits of joints that can turn a whole turn.

Goals: never above a graph; from 401 samples on 10 % less travel and 20 % less ∫q̇² than the finest graph that Descartes
can store; 401 samples in 1 s and 0.4 GB, 1,401 in 3 s.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from importlib.util import find_spec

import numpy as np

from studies.benchmarks.seams import descartes, ladder_graph
from studies.benchmarks.seams.cells import CELLS, SEAMS
from studies.benchmarks.seams.ladder_graph import Cost
from studies.reporting import Row, goal_row, losses_first, report, study_parser, tell, versus

COSTS: tuple[Cost, ...] = ("joint rates", "joint travel")
UNITS = {"joint travel": "rad", "joint rates": "rad²/s"}
RESOLUTIONS = {"6R": (0.1, 0.03, 0.01), "rail": (0.2, 0.1), "7R": (0.4, 0.3)}  # rad, and m of the rail
SHARES = {"joint travel": 0.9, "joint rates": 0.8}  # goals from 401 samples on
SECONDS = {401: 1.0, 1401: 3.0}
NO_WORSE = 1 + 1e-9


def cost_of(q: np.ndarray | None, times: np.ndarray, cost: Cost) -> float:
    """Return the cost of a motion by its samples (samples, dof); inf without a motion."""
    if q is None:
        return np.inf
    steps = np.diff(q, axis=0)
    return float(np.abs(steps).sum() if cost == "joint travel" else (steps**2 / np.diff(times)[:, None]).sum())


def seam_rows(cell: str, seam: str, samples: int, resolutions: Sequence[float]) -> list[Row]:
    """Return the rows of a seam: both costs against graphs of all resolutions, time and memory."""
    times, frames = SEAMS[seam](samples, cell)
    name, rows, fits = f"{cell}, {seam}, {samples} samples", list[Row](), next(iter(resolutions), np.nan)
    if cell == "6R" and find_spec("tesseract_robotics"):
        speed = np.asarray(CELLS[cell]().arm.velocity_limits) * np.diff(times)[0] * (1 + 1e-9)
        for resolution in resolutions:
            tell(f"{name}: Descartes, {resolution:g} rad")
            peer = descartes.plan_seam(frames, resolution, turns=False)
            if peer.q is not None and (np.abs(np.diff(peer.q, axis=0)) > speed).any():  # it leaps without whole turns
                peer = descartes.plan_seam(frames, resolution, turns=True)
            if peer.q is None:
                rows.append(Row("Descartes", name, f"{resolution:g} rad", "", np.nan, note=peer.message))
                break
            fits, steps = resolution, float((np.abs(np.diff(peer.q, axis=0)) / speed).max())
            note = f"{peer.seconds:.3g} s, {peer.gigabytes:.2f} GB, {steps:.2f} of speed limits"
            for cost in COSTS:
                column, value = f"{cost}, {resolution:g} rad", cost_of(peer.q, times, cost)
                rows.append(Row("Descartes", name, column, UNITS[cost], value, note=note))
    for cost in COSTS:
        tell(f"{name}: {cost}, ours")
        plan = ladder_graph.plan_seam(cell, seam, samples, cost)
        value = cost_of(plan.q, times, cost)
        for resolution in resolutions:
            tell(f"{name}: {cost}, graph, {resolution:g}")
            begin = time.perf_counter()
            graph = ladder_graph.shortest_path(CELLS[cell](), times, frames, resolution, cost)
            seconds = time.perf_counter() - begin
            goal = SHARES[cost] if samples >= 401 and resolution == fits else NO_WORSE
            note, column = (
                f"graph {seconds:.3g} s; {plan.message}".removesuffix("; "),
                f"{cost}, graph of {resolution:g}",
            )
            theirs = cost_of(graph.q, times, cost)
            place = "cost beside a ladder graph", name, column, UNITS[cost]
            rows.append(versus(*place, value, theirs, source="ladder graph", goal=goal, note=note))
        for what, unit, used, most in (
            ("time", "s", plan.seconds, SECONDS.get(samples)),
            ("memory", "GB", plan.gigabytes, 0.4 if samples == 401 else None),
        ):
            place = "time and memory", name, f"{cost}, {what}", unit
            rows.append(Row(*place, used) if most is None else goal_row(*place, used, most))
    return rows


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the benchmark."""
    parser = study_parser(__doc__, quick="51 samples, the coarsest graphs")
    parser.add_argument("--cells", nargs="+", choices=sorted(CELLS), default=list(CELLS), metavar="NAME")
    parser.add_argument("--alone", action="store_true", help="no graphs: time and memory of ours on a quiet machine")
    options = parser.parse_args(arguments)
    rows = []
    for cell in options.cells:
        for seam in SEAMS:
            for samples in (51,) if options.quick else (51, 101, 401, 1401):
                chosen = RESOLUTIONS[cell][:1] if options.quick else RESOLUTIONS[cell]
                rows += seam_rows(cell, seam, samples, () if options.alone else chosen)
    report(losses_first(rows), json_file=options.json)


if __name__ == "__main__":
    main()
