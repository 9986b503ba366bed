"""The reference of CasADi and IPOPT, which shares nothing with paretoik, agrees with it."""

from __future__ import annotations

import ast
from pathlib import Path

import numpy as np
import pytest

from paretoik.robot.arms import tringali_3r
from paretoik.task.motion import Motion
from paretoik.task.objectives import kinetic_energy, torque_norm
from problems.tringali_2020 import straight

casadi = pytest.importorskip("casadi", reason="CasADi comes with the extra bench")

from studies.benchmarks import reference_front as study  # noqa: E402  it imports CasADi itself
from studies.benchmarks import reference_program as model  # noqa: E402


def test_it_imports_nothing_of_paretoik():
    tree = ast.parse(Path(model.__file__).read_text(encoding="utf-8"))
    named = [alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names]
    named += [node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
    assert "casadi" in named
    assert not [name for name in named if name.split(".")[0] in ("paretoik", "problems")]


def test_its_path_is_the_problem_s():
    np.testing.assert_allclose(model.tool_path(101), straight().positions[:, :2], atol=1e-15)


def test_its_objectives_are_ours_on_any_motion():
    q = np.cumsum(np.random.default_rng(0).normal(0.0, 0.1, size=(21, 3)), axis=0)
    time = np.linspace(0.0, 1.0, len(q))
    symbol = casadi.SX.sym("q", 3, len(q))
    integrals = casadi.Function("F", [symbol], [model.integrals(symbol, model.PRINTED, time[1])])
    motion = Motion(arm=tringali_3r(), time=time, q=q[None], differences="backward")
    expected = np.concatenate([kinetic_energy(motion), torque_norm(motion)])
    np.testing.assert_allclose(np.asarray(integrals(q.T)).ravel(), expected, rtol=1e-11)


def test_its_jacobian_is_the_slope_of_the_tool_and_its_postures_start_on_the_path():
    q = study.start_postures(np.linspace(-0.5, 0.5, 9))
    x, J = model.kinematics(q)
    np.testing.assert_allclose(x, np.broadcast_to(model.BEGIN, x.shape), atol=1e-12)
    step = 1e-6 * np.eye(3)[:, None]
    slope = (model.kinematics(q + step)[0] - model.kinematics(q - step)[0]) / 2e-6
    np.testing.assert_allclose(J, np.moveaxis(slope, 0, -1), atol=1e-9)


def test_an_optimum_follows_the_path_within_its_limits_and_beats_where_it_started():
    program = model.build(13)
    start = min(study.candidates(program, 12, np.random.default_rng(0)), key=lambda q: np.max(np.abs(q)))
    best = model.optimise(program, start, study.ENERGY)
    assert best is not None
    np.testing.assert_allclose(model.kinematics(best.q)[0], program.tool, atol=1e-7)
    assert (np.abs(best.q) <= model.POSITION + 1e-9).all()
    assert (np.abs(np.diff(best.q, axis=0)) * 12 <= model.VELOCITY + 1e-7).all()
    motion = Motion(
        arm=tringali_3r(), time=np.linspace(0.0, 1.0, 13), q=np.stack([start, best.q]), differences="backward"
    )
    assert np.diff(kinetic_energy(motion)) < 0
    assert best.F[study.ENERGY] == pytest.approx(kinetic_energy(motion)[1], rel=1e-9)
