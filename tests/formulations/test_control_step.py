"""One control step: equal to the compiled engine's and Pinocchio's in space; any pymoo algorithm solves it."""

import numpy as np
import pinocchio
import pytest

import paretoik as pk
from paretoik.closed_loop.admissible_steps import clearance_at_start, find_inadmissible
from paretoik.closed_loop.control_step import OPTIONS
from paretoik.closed_loop.step_search_kernels import _configure, _evaluate_objectives
from problems import marcos_2012
from tests.closed_loop.postures import near_obstacle, posture
from tests.formulations.problems import PANDA, panda

COUNT = 200


@pk.objective(unit="rad/s³", form="peak")
def sway(motion):
    return np.abs(motion.jerk).max(axis=-1) + np.abs(motion.ddq[..., 0])


@pk.objective(unit="m", form="peak")
def reach(motion):
    return np.abs(motion.tool[..., 1]) + 0.1 * motion.links[..., 2, 0]


@pk.step_objective(unit="m")
def height(step):
    return step.motion.tool[..., 1] - step.position_error[..., 0]


def paper_loop(links, **settings):
    return marcos_2012.loop(links, 0.7, start=posture(links), steps=6, population=COUNT, **settings)


def own_objectives():
    path = marcos_2012.round_trip(0.7, 6)
    objectives = [pk.joint_displacement, sway, height, reach]
    return pk.ClosedLoop(pk.arms.marcos_nr(4), path, start=posture(4), objectives=objectives, population=COUNT)


LOOPS = {
    "3R of any length": lambda: paper_loop(3, as_printed=True),
    "4R, bounded": lambda: paper_loop(4),
    "3R, obstacles": lambda: near_obstacle(population=COUNT),
    "4R, obstacles at the end": lambda: paper_loop(4, blocked=True, as_printed=True),
    "three objectives with a history": own_objectives,
}


@pytest.mark.parametrize("name", LOOPS)
def test_genes_give_the_same_steps_as_the_compiled_engine(name):
    loop = LOOPS[name]()
    rng = np.random.default_rng(0)
    history = loop.start + 1e-3 * rng.normal(size=(3, len(loop.start)))
    history[-1] = loop.start
    step, state = loop.control_step(2, history), loop.step_state(2, history)
    genes = rng.uniform(-1, 1, size=(COUNT, step.n_var))
    search = loop.step_evolution()
    search.generations = 1
    search(state)  # writes the inputs that all candidates share
    (start, constraints), w = search.start_and_constraints(state), search.workspace
    w.children[:] = genes.T
    _configure(w.children, w.inputs, COUNT, start, constraints, w)
    q = w.inputs[: len(loop.start)].T.copy()
    size = 1.0 + np.abs(q - loop.start).max(axis=1, keepdims=True)  # the error of a step grows with its length
    _evaluate_objectives(start, search._objectives, COUNT, w)
    expected = w.F[: loop.n_obj, len(w.order) :].T
    F, G = step.evaluate(genes, return_values_of=["F", "G"])
    assert (np.abs(step.positions(genes) - q) <= 1e-12 * size).all()
    np.testing.assert_allclose(F[:, 0], expected[:, 0], rtol=2e-12)
    np.testing.assert_allclose(F[:, 1:], expected[:, 1:], rtol=1e-12, atol=1e-9 if loop.n_obj > 2 else 2e-12)
    w.inputs[: len(loop.start)], w.pending[:] = step.positions(genes).T, np.arange(COUNT)
    rejected = find_inadmissible(COUNT, start, constraints, clearance_at_start(start, constraints, w), OPTIONS, w)
    assert sorted(w.pending[:rejected]) == np.flatnonzero((G > 0).any(axis=1)).tolist()
    np.testing.assert_array_equal(step.decode(genes).q[:, -1], step.positions(genes))
    np.testing.assert_array_equal(step.decode(genes).q[:, :-1], np.tile(history, (COUNT, 1, 1)))


@pytest.mark.parametrize("seed", range(2))
def test_steps_of_a_spatial_arm_are_those_of_pinocchio(seed):
    rng = np.random.default_rng(seed)
    model = pinocchio.buildModelFromUrdf(str(PANDA))
    data, frame = model.createData(), model.getFrameId("panda_hand_tcp")

    def tool(joints):
        pinocchio.framesForwardKinematics(model, data, np.append(joints, np.zeros(model.nq - 7)))
        return data.oMf[frame].translation.copy()

    home, q = np.array([0.1, -0.5, 0.2, -2.0, 0.3, 1.8, 0.4]) + rng.normal(0.0, 0.2, (2, 7))
    target, dt = tool(q) + rng.normal(0.0, 3e-3, 3), 0.01
    path = pk.line(tool(q), 2 * target - tool(q), duration=2 * dt, samples=3, timing="uniform")
    step = pk.ControlStep(panda(), path, q, home=home, longest_step=np.inf, limits=pk.Limits(velocity=np.inf))
    genes = rng.uniform(-1, 1, (50, step.n_var))
    rows = genes.reshape(50, 4, 8)
    full = np.append(q, np.zeros(model.nq - 7))
    pinocchio.computeJointJacobians(model, data, full)
    pinocchio.updateFramePlacements(model, data)
    jacobian = pinocchio.getFrameJacobian(model, data, frame, pinocchio.LOCAL_WORLD_ALIGNED)[:3, :7]
    square = np.concatenate([np.tile(jacobian, (50, 1, 1)), rows[..., :7]], axis=1)  # Eq. 7
    moved = np.linalg.solve(
        square, np.concatenate([np.tile(target - tool(q), (50, 1)), rows[..., 7]], axis=1)[..., None]
    )
    after = q + moved[..., 0]
    lower, upper = step.task.arm.position_limits.T
    usable = ((after > lower) & (after < upper)).all(axis=1)  # others are shortened
    assert usable.sum() > 5, usable.sum()
    scale = np.linalg.cond(square)[usable, None]
    F = step.evaluate(genes, return_values_of=["F"])[usable]
    np.testing.assert_allclose(
        step.positions(genes)[usable] / scale[:, None], after[usable] / scale[:, None], atol=1e-14
    )
    displacement = ((after - q) ** 2 + (after - home) ** 2).sum(axis=1)[usable] / dt**2  # Eq. 17
    error = [np.linalg.norm(tool(each) - target) for each in after[usable]]  # Eq. 18
    np.testing.assert_allclose(F[:, 0], displacement, rtol=1e-10)
    np.testing.assert_allclose(F[:, 1], error, rtol=1e-10, atol=1e-12)


def test_solve_finds_the_front_that_the_compiled_search_finds():
    loop = paper_loop(3, generations=40)
    front = pk.solve(loop.control_step(1), population=60, generations=40, stagnation=False, observe=False)
    F = loop.step_evolution()(loop.step_state(1)).F
    np.testing.assert_allclose(front.objectives.min(axis=0), F.min(axis=0), rtol=2e-3)
    q = front.motions.q[:, -1]
    tool = np.exp(1j * np.cumsum(q, axis=1)).sum(axis=1)
    target = complex(*loop.task.targets[1])
    np.testing.assert_allclose(np.abs(tool - target), front.objectives[:, 1], rtol=1e-9, atol=1e-15)
    choice = front.select(pk.Weights(joint_displacement=0.5, position_error=0.5))
    assert choice.motion.q.shape == (4, 3)


@pk.step_objective(unit="rad")
def total(step):
    return step.motion.q.sum()


ELBOW = [np.cos(posture(3)[0]), np.sin(posture(3)[0])]  # m, the end of the first link
NOT_OF_A_STEP = {
    "sample must be at most 6, the path's last, got 7": {"sample": 7},
    "q must be clear of obstacles, got a posture ": {"obstacles": [pk.obstacles.Circle(ELBOW, 0.1)]},
    "q must be at most 1e.* rad or m, got 1e": {"q": [[1e308, 0.0, 0.0], posture(3)]},
    "limits in a control step must be on position, velocity and clearance, got torque": {
        "limits": pk.Limits(torque=1.0)
    },
    r"objective total must return one value per step and sample, shape \(1, 4\), got \(\)": {"objectives": [total]},
}


@pytest.mark.parametrize("words", NOT_OF_A_STEP)
def test_what_cannot_be_used_is_named(words):
    with pytest.raises(pk.InvalidInput, match=words):
        pk.ControlStep(
            **{
                "arm": pk.arms.marcos_nr(3),
                "path": marcos_2012.round_trip(0.7, 6),
                "q": posture(3),
                **NOT_OF_A_STEP[words],
            }
        )


def test_a_target_that_is_too_far_for_joints_is_refused_at_once():
    with pytest.raises(pk.Infeasible, match=r"step 1 .*joints would have to move at least .* times as far as allowed"):
        pk.ControlStep(pk.arms.marcos_nr(3), marcos_2012.round_trip(0.7, 6), posture(3), longest_step=1e-4)
