# %% [markdown]
# # A first front, and how to read it
#
# A planar arm with three joints follows a straight line: two equations, so one degree of redundancy is left. Moving
# with little kinetic energy needs another motion than moving with little torque. No motion is better in both than a
# motion on the front.

# %%
import numpy as np

import paretoik as pk

arm = pk.Arm.planar(
    lengths=[0.176, 0.176, 0.1375],  # m
    masses=[0.615, 0.615, 0.307],  # kg
    centers=[0.0950, 0.0717, 0.0526],  # m from the link's own joint
    inertias=[0.001811, 0.003173, 0.002103],  # kg m² about the centre
)
path = pk.line([0.4678, 0.0], [0.0983, 0.1526], duration=1.0, samples=51)
limits = pk.Limits(position=np.deg2rad([90, 120, 120]), velocity=3.8)  # rad, rad/s, symmetric

problem = pk.Tracking(arm, path, objectives=[pk.kinetic_energy, pk.torque_norm], limits=limits)
front = pk.solve(problem, population=60, generations=60, seed=1, out="runs/first_front", overwrite=True)
print(front)

# %% [markdown]
# A front is a set of arrays, one row per point, sorted by the first objective. Values have the user's own sign and the
# unit of each objective; an id names a point for good, in every picture and file.

# %%
for name, unit, values in zip(front.names, front.units, front.objectives.T, strict=True):
    print(f"{name}: {values.min():.4g} to {values.max():.4g} {unit}")
print(f"ids of the two ends: {front.ids[0]} and {front.ids[-1]}")

# %% [markdown]
# Every point is a whole motion. All of them follow the path exactly at its samples, and satisfy the limits there.

# %%
motions = front.motions
print(f"joint positions (points, time, dof): {motions.q.shape}")
print(f"farthest from the path: {motions.tracking_error.max():.1e} m")
print(f"fastest joint: {np.abs(motions.dq).max():.4f} of {limits.velocity} rad/s")

# %% [markdown]
# The run folder keeps the front without pickle, a picture of it (`front.png`) and a recording of all generations:
# `paretoik show runs/first_front`. `load_front` opens it again.

# %%
again = pk.load_front("runs/first_front", problem)
print(f"opened again: {len(again)} points, equal: {np.array_equal(again.objectives, front.objectives)}")
