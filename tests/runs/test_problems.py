""""""

from __future__ import annotations

import shutil
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from pymoo.core.problem import Problem
from pymoo.problems import get_problem

import paretoik as pk
from paretoik.runs.fingerprint import SCHEME, check_fingerprint, fingerprint
from tests.closed_loop.postures import posture
from tests.runs.variants import variants

ROOT = Path(__file__).parents[2]
PANDA = ROOT / "problems" / "robots" / "panda.urdf"
LINE = pk.line((0.4678, 0.0), (0.0983, 0.1526), duration=1.0, samples=11)


@pk.objective(unit="rad", form="general")
def last(motion):
    return motion.q[..., -1, 0] - 0.25


@pk.constraint(unit="rad", upper=9.0)
def low(motion):
    return motion.q[..., 0]


class Plain(Problem):
    def __init__(self, width=2.0):
        super().__init__(n_var=3, n_obj=2, n_ieq_constr=1, xl=0.0, xu=1.0)
        self.width, self.name, self.table = width, "plain", {"a": [1.0, 2.0], "b": None}

    def _evaluate(self, x, out, *args, **kwargs):
        out["F"] = np.stack([x[:, 0], 1 - x[:, 1] * self.width], axis=1)
        out["G"] = x[:, 2] - self.width


def planar() -> pk.Tracking:
    limits = pk.Limits(velocity=9.0, clearance=0.01)
    return pk.Tracking(
        pk.arms.tringali_3r(), LINE, objectives=[pk.kinetic_energy, last], constraints=[low], limits=limits,
        obstacles=[pk.obstacles.Circle([1.5, 1.5], 0.1)], link_radius=0.02, coefficients=4, bases=2,
    )  # fmt: skip


def panda(file: Path = PANDA) -> pk.Tracking:
    arm = pk.Arm.from_urdf(file, base="panda_link0", tip="panda_hand_tcp")
    path = pk.line([0.45, -0.1, 0.3], [0.45, 0.1, 0.3], duration=1.0, samples=9)
    obstacles = [
        pk.obstacles.Sphere([2.0, 0.0, 0.5], 0.1),
        pk.obstacles.Box([2.0, 1.0, 0.5], [0.1, 0.1, 0.1]),
        pk.obstacles.Capsule([2.0, 2.0, 0.0], [2.0, 2.0, 1.0], 0.1),
    ]
    return pk.Tracking(arm, path, objectives=[pk.kinetic_energy, last], obstacles=obstacles, coefficients=4, bases=1)


def loop() -> pk.ClosedLoop:
    path = pk.circle((0.7, 0.0), 0.5, duration=0.01, samples=11, turns=0.011, timing="uniform")
    return pk.ClosedLoop(pk.arms.marcos_nr(3), path, start=posture(3), population=20, generations=5)


def tuning() -> pk.Tuning:
    return pk.Tuning(pk.arms.tringali_3r(), LINE, pk.methods.DampedLeastSquares(), constraints=[low])


def two_ways() -> pk.DirectionalMaxima:
    motors = pk.capability.kim_sliders()
    return pk.DirectionalMaxima(pk.arms.kim_3r(), motors, [0.2, -0.15], np.eye(2), constraints=[low], starts=40)


def reach() -> pk.PointToPoint:
    ends = [0.1, -0.15], [0.2, -0.15]
    motors = pk.capability.kim_joint_motors()
    return pk.PointToPoint(pk.arms.kim_3r(), motors, *ends, samples=7, coefficients=4, bases=2)


def standing() -> pk.Posture:
    return pk.Posture(pk.arms.tringali_3r(), LINE, constraints=[low], link_radius=0.01)


def control_step() -> pk.ControlStep:
    return loop().control_step(1)


KINDS = {
    "planar": planar,
    "URDF": panda,
    "closed loop": loop,
    "tuning": tuning,
    "posture": standing,
    "control step": control_step,
    "directional maxima": two_ways,
    "point to point": reach,
    "plain": Plain,
    "pymoo's": lambda: get_problem("bnh"),
}


@pytest.fixture(scope="module", params=KINDS)
def problem(request):
    return KINDS[request.param]()


def is_obstacle_name(path):
    """Return whether a path leads to an obstacle's name, which changes no motion."""
    return ".obstacles[" in path and path.endswith("].name")


def test_any_one_number_word_or_truth_that_changes_makes_another_problem(problem):
    before, rng = fingerprint(problem), np.random.default_rng()
    every = [(path, changed) for path, changed in variants(problem, rng) if not is_obstacle_name(path)]
    assert len(every) > 8
    some = every[rng.integers(4) :: 4]  # another quarter in each run
    assert [path for path, changed in some if fingerprint(changed) == before] == []
    assert fingerprint(problem) == before
    assert all(fingerprint(changed) == before for path, changed in variants(problem, rng) if is_obstacle_name(path))


def test_a_problem_that_is_made_again_is_the_same(problem, request):
    make = KINDS[request.node.callspec.params["problem"]]
    assert fingerprint(make()) == fingerprint(problem)
    assert fingerprint(problem).startswith(f"{SCHEME}:")


@pytest.mark.filterwarnings("ignore:objective .* must vary:RuntimeWarning")  # with so few individuals
def test_solving_leaves_a_problem_the_same(problem):
    before = fingerprint(problem)
    with suppress(pk.Infeasible):  # few generations may find no feasible individual
        pk.solve(problem, **({} if isinstance(problem, pk.ClosedLoop) else {"population": 8, "generations": 2}))
    assert fingerprint(problem) == before


def test_planning_and_refining_leave_a_problem_the_same():
    problem = planar()
    before = fingerprint(problem)
    assert pk.epsilon_front(problem, points=2, starts=2).provenance["fingerprint"] == before
    assert fingerprint(problem) == before


def test_a_loop_with_other_weights_or_search_is_the_same_problem():
    usual = loop()
    other = usual.changed(weights=[1.0, 0.0], start=[0.8, -1.0, -1.0], population=30, generations=6, seed=3)
    assert fingerprint(other) == fingerprint(usual)


def test_a_urdf_counts_by_its_bytes_wherever_it_is(tmp_path):
    (tmp_path / "elsewhere").mkdir()
    moved = shutil.copy(PANDA, tmp_path / "elsewhere")
    edited = tmp_path / "panda.urdf"
    edited.write_bytes(PANDA.read_bytes() + b"<!-- edited -->\n")
    assert fingerprint(panda(Path(moved))) == fingerprint(panda())
    assert fingerprint(panda(edited)) != fingerprint(panda())


def test_what_processors_differ_in_is_the_same_problem():
    problem, other = planar(), planar()
    radius = np.array(other.encoding.radius)
    object.__setattr__(other.encoding, "radius", np.nextafter(radius, np.inf))
    assert fingerprint(other) == fingerprint(problem)


@pytest.mark.parametrize("stored", [None, "", "c0ffee" * 10, 5])
def test_fingerprints_of_another_version_are_not_compared(stored):
    with pytest.raises(pk.InvalidInput, match="run must be of it, got a run of another version of paretoik"):
        check_fingerprint(Plain(), stored, wish="run must be of it")


def test_another_problem_is_said_to_be_another():
    check_fingerprint(Plain(), fingerprint(Plain()), wish="")
    with pytest.raises(pk.InvalidInput, match="run must be of it, got one with another fingerprint"):
        check_fingerprint(Plain(3.0), fingerprint(Plain()), wish="run must be of it")
