# %% [markdown]
# # Tasks: what the tool must do, and what it need not
#
# A path of points fixes the position, a path of poses all six; `pk.Task(path, axes=...)` fixes anything between. The
# rest is redundancy, and every degree of it makes the front better.

# %%
from pathlib import Path

import numpy as np

import paretoik as pk

HERE = Path(__file__).parent if "__file__" in globals() else Path.cwd()  # a notebook has no file
panda = pk.Arm.from_urdf(HERE.parent / "robots" / "panda.urdf", base="panda_link0", tip="panda_hand_tcp")

# %% [markdown]
# A seam half around a pipe, written as poses of a nozzle that turns with it. A nozzle may turn freely about its own
# axis: position and that axis are five equations of the Panda's seven joints; a pose is six.

# %%
times = np.linspace(0.0, 2.0, 21)  # s
turns = 0.5 * np.pi * (1.0 - np.cos(np.pi * times / 2.0))  # from 0 to half a turn, at rest at both ends
places = np.stack([0.45 + 0.12 * np.sin(turns), -0.12 * np.cos(turns), np.full(21, 0.3)], axis=1)  # m
seam = pk.poses(times, [pk.Pose.from_rpy(p, (np.pi, 0.0, yaw)) for p, yaw in zip(places, turns, strict=True)])

hand_down = pk.Task(seam, axes="xyz+z-axis")  # the hand points down and turns freely
print(f"hand down: {pk.Tracking(panda, hand_down, objectives=[pk.joint_travel]).task.redundancy} redundant")

best = {}
for axes in ("pose", "xyz+z-axis"):
    problem = pk.Tracking(panda, pk.Task(seam, axes=axes), objectives=[pk.joint_travel])
    best[axes] = pk.plan(problem, starts=4).best
    rotation = best[axes].motion.tool_rotation
    yaw = np.unwrap(np.arctan2(rotation[:, 1, 0], rotation[:, 0, 0]))
    print(
        f"{axes}: {problem.task.redundancy} redundant, joints travel {best[axes].objective:.3f} rad, "
        f"the nozzle turns {np.rad2deg(np.ptp(yaw)):.0f} degrees, "
        f"its axis is off by {np.abs(rotation[..., 2] - [0, 0, -1]).max():.0e}"
    )

# %% [markdown]
# Onto the robot: the motion is sampled at the controller's rate, and every sample is compared with its published
# limits. A motion that does not start from rest is refused, with what would help.

# %%
Path("runs").mkdir(exist_ok=True)
try:
    pk.export(best["pose"].motion, "runs/posed.csv", controller="franka")
except pk.Infeasible as error:
    print(f"refused: {error}")
trajectory = pk.export(
    best["xyz+z-axis"].motion, "runs/seam.csv", controller="franka", ramp=0.2, slow_down=True, overwrite=True
)
print(f"exported: {trajectory}")

# %% [markdown]
# Several tasks at once, each for a frame of its own: the tool of a planar arm with five joints follows a line while its
# third joint stays on another one.

# %%
snake = pk.Arm.planar(lengths=[0.3] * 5, masses=[1.0] * 5, centers=[0.15] * 5, inertias=[0.01] * 5)
tool = pk.line([0.9, 0.2], [0.9, 0.5], duration=1.0, samples=31)
elbow = pk.line([0.45, 0.25], [0.45, 0.3], duration=1.0, samples=31)
both = pk.Tracking(snake, [tool, pk.Task(elbow, frame="joint3")], objectives=[pk.kinetic_energy, pk.torque_norm])
front = pk.solve(both, population=24, generations=15, seed=1)
print(f"tool and third joint: {both.task.redundancy} redundant, {front}")

# %% [markdown]
# `cyclic=True` asks for a motion that ends as it starts, `end_velocity=0` for one that stops.

# %%
loop = pk.circle([0.4178, 0.0], 0.05, duration=1.0, samples=41)
closed = pk.plan(pk.Tracking(pk.arms.tringali_3r(), loop, objectives=[pk.kinetic_energy], cyclic=True), starts=12).best
print(f"once round: ends {np.abs(closed.motion.q[-1] - closed.motion.q[0]).max():.0e} rad from where it began")
