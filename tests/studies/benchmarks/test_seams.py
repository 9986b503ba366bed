import itertools

import numpy as np
import pytest

from paretoik.robot.kinematics import forward_kinematics
from studies.benchmarks.seams import ladder_graph
from studies.benchmarks.seams.__main__ import cost_of
from studies.benchmarks.seams.cells import CELLS, SEAMS


@pytest.mark.parametrize("seam", SEAMS)
@pytest.mark.parametrize("cell", CELLS)
def test_closed_forms_put_the_tool_at_its_frame(cell, seam):
    frames, chosen = SEAMS[seam](9, cell)[1], CELLS[cell]()
    values = chosen.grid(0.4)
    q = chosen.postures(frames, float(values[len(values) // 2]))
    reached = ~np.isnan(q).any(axis=-1)
    assert reached.all()
    rotation, position = forward_kinematics(chosen.arm, q)
    np.testing.assert_allclose(position, np.broadcast_to(frames[:, None, :3, 3], position.shape), atol=1e-12)
    np.testing.assert_allclose(rotation, np.broadcast_to(frames[:, None, :3, :3], rotation.shape), atol=1e-12)


@pytest.mark.parametrize("cell", CELLS)
def test_closed_forms_have_the_posture_that_a_frame_was_taken_from(cell):
    chosen, rng = CELLS[cell](), np.random.default_rng(0)
    q = rng.uniform(-1.0, 1.0, chosen.arm.dof)
    if cell == "rail":
        q[0] = 0.3
    rotation, position = forward_kinematics(chosen.arm, q)
    frame = np.eye(4)
    frame[:3, :3], frame[:3, 3] = rotation, position
    values = [0.3] if cell == "rail" else np.linspace(-np.pi, np.pi, 2001) if cell == "7R" else [0.0]
    postures = np.concatenate([chosen.postures(frame[None], float(value))[0] for value in values])
    difference = (postures - q + np.pi) % (2 * np.pi) - np.pi
    assert np.abs(difference).max(axis=1).min() <= (1e-9 if cell != "7R" else 1e-2)


@pytest.mark.parametrize("cost", ["joint travel", "joint rates"])
def test_the_shortest_path_is_that_of_brute_force(cost):
    cell = CELLS["6R"]()
    times, frames = SEAMS["fillet"](3, "6R")
    shortest = ladder_graph.shortest_path(cell, times, frames, 2.0, cost)
    rungs = [ladder_graph.postures_at(cell, frame, 2.0) for frame in frames]
    best = np.inf
    for choice in itertools.product(*rungs):
        q = np.unwrap(np.stack(choice), axis=0)
        if (np.abs(np.diff(q, axis=0)) <= cell.arm.velocity_limits * times[1]).all():
            best = min(best, cost_of(q, times, cost))
    assert shortest.cost == pytest.approx(best, rel=1e-12)
    assert cost_of(shortest.q, times, cost) == pytest.approx(best, rel=1e-12)
