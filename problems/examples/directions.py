# %% [markdown]
# # What an arm can do: directional maxima, and point to point
#
# Kim, Choi & Jang (2021) ask how fast a tool can move along each direction from its position, with motors at the joints
# or with sliders along the links, under gravity.

# %%
import numpy as np

import paretoik as pk

arm, place = pk.arms.kim_3r(), [0.2, -0.15]
motors, sliders = pk.capability.kim_joint_motors(), pk.capability.kim_sliders()
polygons = {"motors": pk.directional_maxima(arm, motors, place), "sliders": pk.directional_maxima(arm, sliders, place)}
for name, polygon in polygons.items():
    print(f"{name}: {polygon.values.min():.3f} to {polygon.values.max():.3f} m/s over {len(polygon)} directions")
faster = polygons["sliders"].values > polygons["motors"].values
print(f"sliders are faster along {faster.sum()} of {len(faster)}")

# %% [markdown]
# Each of these maxima has a posture of its own. Fast along several directions from *one* posture is a trade-off, and
# power is a third objective.

# %%
ahead, upwards = [1.0, 0.0], [0.0, 1.0]
front = pk.solve(pk.DirectionalMaxima(arm, motors, place, [ahead, upwards]), population=60, generations=40, seed=1)
print(front)

# %% [markdown]
# Point to point trades the least time in which motors can follow against the work that they do. Every motion of the
# front has times of its own.

# %%
to_there = pk.PointToPoint(arm, motors, [0.1, -0.15], [0.2, -0.15])
times = pk.solve(to_there, population=40, generations=40, seed=1, points=10)
print(times)
refined = pk.refine(times)
print(f"refined: {refined}, {', '.join(sorted(set(refined.certificates.status)))}")
quickest = refined.motions[int(np.argmin(refined.objectives[:, 0]))]
miss = np.linalg.norm(quickest.tool[-1] - place)
print(f"the quickest motion ends after {quickest.time[-1]:.4f} s, {miss:.0e} m from its target")
