# %% [markdown]
# # One's own arm
#
# Any URDF works; here it is the Panda that comes with paretoik. First the whole file is checked and every fault is
# named (`paretoik check-robot FILE` does the same). Meshes are never opened.

# %%
from pathlib import Path

import numpy as np

import paretoik as pk

HERE = Path(__file__).parent if "__file__" in globals() else Path.cwd()  # a notebook has no file
URDF = HERE.parent / "robots" / "panda.urdf"

report = pk.check_robot(URDF, base="panda_link0", tip="panda_hand_tcp")
print(*report.summary, sep="\n")

broken = Path("runs/broken.urdf")
broken.parent.mkdir(exist_ok=True)
broken.write_text(URDF.read_text().replace('<mass value="', '<mass value="-').replace('lower="-2', 'lower="2'))
print(f"{len(pk.check_robot(broken).faults)} faults in {broken}, the first: {pk.check_robot(broken).faults[0]}")

# %% [markdown]
# An arm is data and never changes: every method returns another arm. Here the hand is left out. The flange gets a
# screwdriver, whose tip is the new tool, and a screw as payload. The arm hangs from a ceiling 1.2 m up; gravity stays
# that of the world.

# %%
bare = pk.Arm.from_urdf(URDF, base="panda_link0", tip="panda_link8")
arm = (
    bare.with_tool(pk.Pose([0.0, 0.0, 0.18]), mass=0.9, center=[0.0, 0.0, 0.08])
    .with_payload(0.05)
    .mounted(base=pk.Pose.from_rpy([0.0, 0.0, 1.2], [np.pi, 0.0, 0.0]), gravity=[0.0, 0.0, -9.81])
)
print(arm, "- masses [kg]:", [round(body.mass, 2) for body in arm.bodies])

# %% [markdown]
# One motion of it, by the pseudoinverse, to look at torques: the weight of the tool is felt in every joint.

# %%
path = pk.line([0.45, -0.2, 0.45], [0.45, 0.2, 0.45], duration=2.0, samples=51)
motion = pk.resolve(arm, path, pk.methods.PseudoInverse())
unloaded = pk.Motion(arm=bare.mounted(base=arm.base), time=motion.time, q=motion.q, differences=motion.differences)
for joint, with_tool, without in zip(
    arm.joint_names, *np.abs([motion.torque, unloaded.torque]).max(axis=1), strict=True
):
    print(f"{joint}: at most {with_tool:5.1f} N m, without the tool {without:5.1f} N m")

# %% [markdown]
# A joint that is blocked, or not to be used, is fixed at a value. Six joints are left, and position needs three.

# %%
blocked = arm.fixed(panda_joint3=0.0)
problem = pk.Tracking(blocked, path, objectives=[pk.kinetic_energy, pk.torque_norm])
front = pk.solve(problem, population=24, generations=10, seed=1)
print(f"with panda_joint3 fixed: {front}")
