"""URDFs against Pinocchio: equal quantities are compared, and a wrong arm is detected."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

import paretoik as pk
from studies.benchmarks import urdf

ROOT = Path(__file__).parents[3]
PANDA = ROOT / "problems" / "robots" / "panda.urdf"
TEXT = PANDA.read_text()
BASE, TIP = "panda_link2", "panda_hand"


def errors_of(arm: pk.Arm) -> dict[str, float]:
    errors, links = urdf.compare_chain(TEXT, arm, BASE, {}, np.random.default_rng(0))
    assert links == 13
    return errors


def test_a_right_arm_has_no_errors_and_a_wrong_one_is_detected():
    arm = pk.Arm.from_urdf(PANDA, base=BASE, tip=TIP)
    assert max(errors_of(arm).values()) < 1e-13
    light = replace(arm, bodies=(*arm.bodies[:-1], replace(arm.bodies[-1], mass=0.9 * arm.bodies[-1].mass)))
    swapped = replace(arm, frames={**arm.frames, "panda_link5": arm.frames["panda_link7"]})
    wrong = {
        "gravity": (replace(arm, gravity=np.array([0.0, 0.0, -9.81])), {"gravity torque", "inverse dynamics"}),
        "mass": (light, {"gravity torque", "inverse dynamics"}),
        "frame": (swapped, {"position", "rotation"}),
    }
    for name, (other, seen) in wrong.items():
        assert {quantity for quantity, error in errors_of(other).items() if error > 1e-3} == seen, name
