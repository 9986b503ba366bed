# %% [markdown]
# # One's own objectives and constraints
#
# An objective is a NumPy function of a `Motion`, whose arrays begin with the batch axes: (..., time, dof). `form` says
# what it returns: "integral" and "peak" one value per sample (..., time), whose integral or worst value counts;
# "terminal" and "general" one value per motion (...). Derivatives are taken from the same function.

# %%
import numpy as np

import paretoik as pk


@pk.objective(unit="rad²/s", form="integral")
def shoulder_effort(motion):
    """Return the squared velocity of the first joint, which carries the others."""
    return motion.dq[..., 0] ** 2


@pk.objective(unit="m", form="peak", maximise=True)
def elbow_height(motion):
    """Return the height of the second joint; if a peak is maximised, its lowest value counts."""
    return motion.links[..., 2, 1]


@pk.constraint(unit="N m", upper=0.05, form="peak")
def wrist_torque(motion):
    """Return the size of the last joint's torque, which is bounded at every sample."""
    return np.abs(motion.torque[..., 2])


# %% [markdown]
# The library's own objectives are functions of the same kind, and all can be combined. Maximised ones are shown in
# their own sign. `refine=True` brings every point to a local optimum by exact derivatives, those of your functions too.

# %%
arm, limits = pk.arms.tringali_3r(), pk.Limits(position=np.deg2rad([90, 120, 120]), velocity=3.8)
path = pk.line([0.4678, 0.0], [0.0983, 0.1526], duration=1.0, samples=31)
problem = pk.Tracking(
    arm,
    path,
    objectives=[pk.kinetic_energy, shoulder_effort, elbow_height],
    limits=limits,
    constraints=[wrist_torque],
)
front = pk.solve(problem, population=60, generations=60, seed=1, refine=True, points=20)
print(front)
print(f"worst wrist torque: {np.abs(front.motions.torque[..., 2]).max():.4f} of 0.05 N m")

# %% [markdown]
# One objective alone is planned by exact derivatives: all distinct optima, best first.

# %%
alone = pk.Tracking(arm, path, objectives=[shoulder_effort], limits=limits, constraints=[wrist_torque])
plan = pk.plan(alone, starts=12)
print(f"least shoulder effort: {plan.best.objective:.4g} {shoulder_effort.unit}, {plan.best.status}")

# %% [markdown]
# The values of your function are checked, and an error says what they must be.

# %%
try:
    pk.objective(unit="rad", form="peak")(lambda motion: motion.q)(plan.best.motion)
except pk.InvalidInput as error:
    print(f"refused: {error}")
