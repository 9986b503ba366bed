# %% [markdown]
# # Obstacles
#
# Links are capsules of `link_radius`, one number or one per link; obstacles are circles, spheres, capsules, boxes and
# half-spaces. The clearance of the links is a limit, `pk.Limits(clearance=)`, and can be an objective too: the front
# then says what each millimetre costs.

# %%
import warnings

import numpy as np

import paretoik as pk

arm = pk.arms.tringali_3r()
path = pk.line([0.4678, 0.0], [0.0983, 0.1526], duration=1.0, samples=31)
post = pk.obstacles.Circle([0.33, -0.1], 0.04)  # m
limits = pk.Limits(position=np.deg2rad([90, 120, 120]), clearance=0.005)  # rad, m

free = pk.plan(pk.Tracking(arm, path, objectives=[pk.kinetic_energy], limits=limits), starts=12).best
seen = pk.Motion(arm=arm, time=free.motion.time, q=free.motion.q, obstacles=(post,), link_radius=0.015)
print(f"without the post: {free.objective:.4g} J s, links {seen.clearance.min() * 1e3:.1f} mm from where it will be")

# %% [markdown]
# With the post, the front begins with links that pass it at the least allowed distance, and ends with links that stay
# away as far as they can.

# %%
problem = pk.Tracking(
    arm,
    path,
    objectives=[pk.kinetic_energy, pk.obstacle_clearance],
    obstacles=[post],
    link_radius=0.015,
    limits=limits,
)
front = pk.epsilon_front(problem, points=6, starts=6)
for energy, clearance in front.objectives:
    print(f"{energy:.4g} J s keeps {clearance * 1e3:.1f} mm")

# %% [markdown]
# In space obstacles are balls, boxes and capsules; a rotated box is centred on a pose. A half-space is all points
# behind a plane, such as a table. Messages use the name of an obstacle, if it has one.

# %%
table = pk.obstacles.HalfSpace([0.0, 0.0, -0.02], normal=[0.0, 0.0, 1.0], name="table")
tilted = pk.obstacles.Box(pk.Pose.from_rpy([0.4, 0.3, 0.2], [0.0, 0.3, 0.0]), [0.1, 0.1, 0.1])
print(table, tilted, pk.obstacles.Sphere([0.4, 0.3, 0.4], 0.1), sep="\n")

# %% [markdown]
# An obstacle on the path itself is reported at once. If there is no way past, the error says which link meets which
# obstacle, and when.

# %%
on_the_path = pk.obstacles.Circle([0.283, 0.0763], 0.03)
with warnings.catch_warnings(record=True) as said:
    warnings.simplefilter("always")
    blocked = pk.Tracking(arm, path, objectives=[pk.kinetic_energy], obstacles=[on_the_path])
print(said[0].message)
try:
    pk.plan(blocked)
except pk.Infeasible as error:
    print(f"refused: {error}")
