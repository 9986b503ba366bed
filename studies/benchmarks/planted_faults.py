"""Mathematical faults planted in the library.

    python -m studies.benchmarks.planted_faults [--quick] [--tested] [--json FILE]

Each fault changes one expression of a copy of this checkout. The default tests of the fault's own folder must then
fail. Every folder is first tested without a fault; ``--tested`` leaves this out if the default tests have just passed.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from studies.benchmarks.checkouts import ROOT
from studies.reporting import goal_row, report, study_parser, tell


class Fault(NamedTuple):
    """A fault: the ``file`` of the library, the expression there, its replacement, and the tests to catch it."""

    file: str
    before: str
    after: str
    tests: str


FAULTS = (
    Fault("robot/dynamics.py", "times(2.0, dot(velocity, cross(", "times(1.0, dot(velocity, cross(", "robot"),
    Fault("robot/dynamics.py", "(0.0, 0.0, dq[i])), 2.0)", "(0.0, 0.0, dq[i])), 1.0)", "robot"),
    Fault("robot/kinematics.py", "arm.placements[1:], arm.tool", "arm.placements[1:]", "robot"),
    Fault("task/differences.py", "+= 4 * sixth", "+= 3 * sixth", "task"),
    Fault("task/limits.py", "lower - values) / limit", "values - lower) / limit", "task"),
    Fault("task/objectives.py", "np.sum(motion.torque**2, axis=-1)", "np.sum(motion.torque**2, axis=-1) / 2", "task"),
    Fault("task/objectives.py", "/ (2 * motion.arm.dof) / motion", "/ motion.arm.dof / motion", "task"),
    Fault("task/self_motion.py", "(left @ right)", "(right.swapaxes(-1, -2) @ left)", "task"),
    Fault("autodiff/differentiation.py", "(a, b), (b, a)", "(a, b), (b, b)", "autodiff"),
    Fault("autodiff/differentiation.py", "1.0 if op is Op.ARC_SINE else -1.0", "1.0", "autodiff"),
    Fault("nlp/banded/interior_point.py", "length * (-slope) ** 2.3", "length * (-slope) ** 1.3", "nlp"),
    Fault("nlp/criticality.py", "* scale / norms[active]", "/ norms[active]", "nlp"),
    Fault("nlp/linear_algebra.py", "x[j] -= total * v[j]", "x[j] += total * v[j]", "nlp"),
    Fault("pareto/certificates.py", "* natural[None, None, :] /", "* abs(natural)[None, None, :] /", "pareto"),
    Fault("pareto/placement.py", "shares[i] + POINT_TOLERANCE", "shares[i] + 1e3 * POINT_TOLERANCE", "pareto"),
    Fault("search/maximin.py", "np.minimum(nearest, row, out=nearest)", "np.add(nearest, row, out=nearest)", "search"),
    Fault("search/operators.py", "np.arange(len(pop), 0, -1)", "np.arange(1, len(pop) + 1)", "search"),
    Fault("search/archive.py", "np.abs(points[:, axis] - new", "(points[:, axis] - new", "search"),
    Fault("front/hypervolume.py", "<= near).all(axis=1)", "<= near).any(axis=1)", "front"),
    Fault("front/preferences/knee_and_compromise.py", "columns.max(axis=0) +", "columns.min(axis=0) +", "front"),
    Fault("front/geometry.py", "shares[:, 0] - PREFERENCE_OPTIONS.hull", "shares[:, 0]", "front"),
    Fault("resolution/step_kernels.py", "1.0 / (1.0 - d) - 1.0 / d", "1.0 / (1.0 - d) - 2.0 / d", "resolution"),
    Fault("resolution/step_kernels.py", "s * s * (3.0 - 2.0 * s)", "s * s", "resolution"),
    Fault(
        "closed_loop/objectives.py", "step.motion.q - step.home) / step.dt", "step.motion.q - step.home)", "closed_loop"
    ),
    Fault("capability/actuator_kernels.py", "1.0 - abs(share))", "1.0 - share * share)", "capability"),
    Fault("capability/actuator_kernels.py", "min(stall / abs(a), back", "max(stall / abs(a), back", "capability"),
    Fault("trajectory/grid_oracle.py", "largest / 8 + 3 / 8", "largest / 80 + 3 / 80", "trajectory"),
    Fault(
        "trajectory/motion_kernel.py",
        "(1.0 - dual * argument / length)",
        "(1.0 + dual * argument / length)",
        "trajectory",
    ),
    Fault(
        "joint_trajectory/trajectory.py", "self.ramp * x**4 * (2.5 +", "self.ramp * x**4 * (2.0 +", "joint_trajectory"
    ),
    Fault("formulations/encoding.py", "q) / self.radius[which][..., None]", "q)", "formulations"),
)


def plant(copy: Path, fault: Fault) -> None:
    """Write a fault into the copy; raise ValueError unless its expression is there."""
    file = copy / "paretoik" / fault.file
    text = file.read_text(encoding="utf-8")
    if fault.before not in text:
        raise ValueError(f"{fault.file} must have {fault.before!r}: plant the fault elsewhere")
    file.write_text(text.replace(fault.before, fault.after, 1), encoding="utf-8")


def run_tests(copy: Path, folder: str) -> tuple[bool, str]:
    """Return whether the default tests of a folder pass in the copy, and the first test that does not."""
    for index in copy.rglob("*.nbi"):  # otherwise callers in other files keep the compiled code
        index.unlink()
    command = [sys.executable, "-m", "pytest", "-q", "-x", "-n", "2", f"tests/{folder}"]
    finished = subprocess.run(command, cwd=copy, capture_output=True, text=True, check=False)
    failed = [line.split(" ")[1] for line in finished.stdout.splitlines() if line.startswith(("FAILED", "ERROR"))]
    return finished.returncode == 0, failed[0] if failed else finished.stdout.strip().rpartition("\n")[2]


def main(arguments: Sequence[str] | None = None) -> None:
    """Plant every fault, run the tests of its folder, and report which are caught."""
    parser = study_parser("Planted mathematical faults.", quick="six faults instead of all")
    parser.add_argument("--tested", action="store_true", help="the default tests have just passed without a fault")
    options = parser.parse_args(arguments)
    faults = FAULTS[::5] if options.quick else FAULTS
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "copy"
        shutil.copytree(
            ROOT,
            copy,
            ignore=lambda place, names: {"__pycache__"} | ({".git", "runs"} if place == str(ROOT) else set()),
        )
        for tests in () if options.tested else sorted({fault.tests for fault in faults}):
            tell(f"tests/{tests} without a fault")
            passes, which = run_tests(copy, tests)
            if not passes:
                raise SystemExit(f"tests/{tests} must pass without a fault, got {which}")
        for number, fault in enumerate(faults, start=1):
            tell(f"fault {number} of {len(faults)}: {fault.file}")
            file = copy / "paretoik" / fault.file
            whole = file.read_text(encoding="utf-8")
            plant(copy, fault)
            passes, which = run_tests(copy, fault.tests)
            file.write_text(whole, encoding="utf-8")
            tell(f"{'LOST' if passes else 'caught'}: {which}")
            name = f"{fault.file}: {fault.before.strip()} → {fault.after.strip() or 'nothing'}"
            table = "planted faults, caught by the default tests of their own folder"
            rows.append(goal_row(table, name, "caught", "", float(not passes), 1.0, which, least=True))
    report(rows, json_file=options.json)
    print(f"{int(sum(row.ours for row in rows))} of {len(rows)} caught")


if __name__ == "__main__":
    main()
