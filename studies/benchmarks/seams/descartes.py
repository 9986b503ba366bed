"""Tesseract's Descartes on the industrial arm, in a process of its own: ``python -m …seams.descartes IN.npz OUT.npz``.

It uses its own arm file, closed-form postures and ladder graph, on one core. A motion costs the sum of ‖Δq‖, without
speed limits and collisions. Memory is capped at 16 GB. Needs the package ``tesseract-robotics``.
"""

from __future__ import annotations

import json
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np

from studies.benchmarks.seams.cells import IRB_2400

MEMORY = 16_000_000_000  # bytes


class DescartesResult(NamedTuple):
    """Postures ``q`` (samples, dof), None without a motion; seconds, peak memory [GB], and its last message."""

    q: np.ndarray | None
    seconds: float
    gigabytes: float
    message: str


def plan_seam(frames: np.ndarray, resolution: float, *, turns: bool) -> DescartesResult:
    """Return Descartes' result over tool angles ``resolution`` [rad] apart, at frames (samples, 4, 4).

    ``turns``: whether postures that differ by whole turns of joints count as different (some paths need that).
    """
    with tempfile.TemporaryDirectory() as folder:
        source, target = Path(folder) / "frames.npz", Path(folder) / "motion.npz"
        np.savez(source, frames=frames, resolution=resolution, turns=turns)
        process = subprocess.run(
            [sys.executable, "-m", __name__, str(source), str(target)], capture_output=True, text=True, check=False
        )
        if not target.exists():
            lines = (process.stderr.strip() or process.stdout.strip() or f"exit {process.returncode}").splitlines()
            return DescartesResult(q=None, seconds=np.nan, gigabytes=np.nan, message=lines[-1])
        with np.load(target) as arrays:
            return DescartesResult(
                q=arrays["q"] if len(arrays["q"]) else None,
                seconds=float(arrays["seconds"]),
                gigabytes=float(arrays["gigabytes"]),
                message=str(arrays["message"]),
            )


def _solve(frames: np.ndarray, resolution: float, turns: bool, folder: Path) -> tuple[np.ndarray, float, str]:
    """Return postures (samples, 6), empty if it fails, the seconds of Descartes itself, and its message."""
    from tesseract_robotics import tesseract_command_language as language
    from tesseract_robotics import tesseract_common as common
    from tesseract_robotics import tesseract_motion_planners_descartes as descartes
    from tesseract_robotics.tesseract_environment import Environment
    from tesseract_robotics.tesseract_motion_planners import PlannerRequest

    environment = Environment()
    assert environment.init(_urdf(), _srdf(folder), common.GeneralResourceLocator())
    arm = common.ManipulatorInfo()
    arm.manipulator, arm.manipulator_ik_solver = "manipulator", "OPWInvKin"
    arm.working_frame, arm.tcp_frame = "link0", "link7"
    program = language.CompositeInstruction("DEFAULT")
    program.setManipulatorInfo(arm)
    for frame in frames:
        waypoint = language.CartesianWaypointPoly_wrap_CartesianWaypoint(
            language.CartesianWaypoint(common.Isometry3d(np.asfortranarray(frame)))
        )
        move = language.MoveInstruction(waypoint, language.MoveInstructionType_LINEAR, "DEFAULT")
        program.appendMoveInstruction(language.MoveInstructionPoly_wrap_MoveInstruction(move))
    profile = descartes.DescartesDefaultPlanProfileD()
    profile.target_pose_fixed = False
    profile.target_pose_sample_axis = np.array([0.0, 0.0, 1.0])
    profile.target_pose_sample_resolution = resolution
    profile.target_pose_sample_min, profile.target_pose_sample_max = -np.pi, np.pi - resolution
    profile.allow_collision, profile.enable_collision, profile.enable_edge_collision = True, False, False
    profile.use_redundant_joint_solutions = turns
    profiles, name = language.ProfileDictionary(), "DescartesMotionPlannerTask"
    profiles.addProfile(name, "DEFAULT", descartes.cast_DescartesPlanProfileD(profile))
    request = PlannerRequest()
    request.instructions, request.env, request.profiles = program, environment, profiles
    begin = time.perf_counter()
    response = descartes.DescartesMotionPlannerD(name).solve(request)
    seconds = time.perf_counter() - begin
    if not response.successful:
        return np.zeros((0, 6)), seconds, response.message
    moves = [language.InstructionPoly_as_MoveInstructionPoly(each) for each in response.results]
    states = [language.WaypointPoly_as_StateWaypointPoly(move.getWaypoint()) for move in moves]
    return np.stack([np.asarray(state.getPosition()).ravel() for state in states]), seconds, response.message


def _urdf() -> str:
    """Return the IRB 2400 as URDF, without shapes: axes and offsets [m] of its joints, limits of its data sheet."""
    offsets = ["0 0 0", "0.1 0 0.615", "0 0 0.705", "0.258 0 0.135", "0.497 0 0", "0.085 0 0"]
    axes = ["0 0 1", "0 1 0", "0 1 0", "1 0 0", "0 1 0", "1 0 0"]
    degrees = [(-180, 180, 150), (-100, 110, 150), (-60, 65, 150), (-200, 200, 360), (-120, 120, 360), (-400, 400, 450)]
    links = "".join(f'<link name="link{i}"/>' for i in range(8))
    joints = "".join(
        f'<joint name="joint{i + 1}" type="revolute"><parent link="link{i}"/><child link="link{i + 1}"/>'
        f'<origin xyz="{offsets[i]}" rpy="0 0 0"/><axis xyz="{axes[i]}"/>'
        f'<limit lower="{low:.15f}" upper="{high:.15f}" velocity="{speed:.15f}" effort="0"/></joint>'
        for i, (low, high, speed) in enumerate(np.deg2rad(degrees))
    )
    flange = f'<origin xyz="0 0 0" rpy="0 {np.pi / 2:.15f} 0"/>'
    tool = f'<joint name="tool" type="fixed"><parent link="link6"/><child link="link7"/>{flange}</joint>'
    return f'<robot name="irb_2400">{links}{joints}{tool}</robot>'


def _srdf(folder: Path) -> str:
    """Return the semantic description; a file in ``folder`` names its closed-form kinematics."""
    import tesseract_robotics

    libraries = Path(tesseract_robotics.__file__).parent.parent / "tesseract_robotics.libs"
    names = [next(libraries.glob(f"libtesseract_kinematics_{kind}.so")) for kind in ("opw_factory*", "kdl_factories*")]
    chain = {"base_link": "link0", "tip_link": "link7"}
    params = {name: getattr(IRB_2400, name) for name in ("a1", "a2", "b", "c1", "c2", "c3", "c4")}
    params |= {"offsets": list(IRB_2400.offsets), "sign_corrections": [1] * 6}

    def plugin(name: str, config: dict[str, object]) -> dict[str, object]:
        entry = {name: {"class": f"{name}Factory", "config": config}}
        return {"manipulator": {"default": name, "plugins": entry}}

    plugins = {
        "search_paths": [str(libraries)],
        "search_libraries": [library.name.removeprefix("lib").removesuffix(".so") for library in names],
        "fwd_kin_plugins": plugin("KDLFwdKinChain", {**chain}),
        "inv_kin_plugins": plugin("OPWInvKin", {**chain, "params": params}),
    }
    file = folder / "plugins.yaml"
    file.write_text(json.dumps({"kinematic_plugins": plugins}))  # JSON is YAML
    group = '<group name="manipulator"><chain base_link="link0" tip_link="link7"/></group>'
    return f'<robot name="irb_2400">{group}<kinematics_plugin_config filename="{file.as_uri()}"/></robot>'


def main(source: str, target: str) -> None:
    """Solve the seam in a file, and write the result."""
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    with np.load(source) as asked:
        q, seconds, message = _solve(
            asked["frames"], float(asked["resolution"]), bool(asked["turns"]), Path(target).parent
        )
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e9
    np.savez(target, q=q, seconds=seconds, gigabytes=peak, message=message)


if __name__ == "__main__":
    main(*sys.argv[1:])
