# %% [markdown]
# # Resolvers compared
#
# A resolver steps along the path once, and knows only the current step. It is quick, and its motion is one point. Here
# are four of them from one posture, and the front of whole motions from the same posture.

# %%
import numpy as np

import paretoik as pk

arm, start = pk.arms.tringali_3r(), np.array([0.0, 0.327, -0.754])  # rad
angles = np.cumsum(start)
begin = np.array([0.176, 0.176, 0.1375]) @ np.stack([np.cos(angles), np.sin(angles)], axis=1)
path = pk.line(begin, begin + np.array([-0.2, 0.1]), duration=2.0, samples=201)

manipulability = pk.methods.Criterion(objective=pk.manipulability, gain=5.0)
methods = {
    "pseudoinverse": pk.methods.PseudoInverse(),
    "gradient projection": pk.methods.GradientProjection(criteria=manipulability),
    "predictive": pk.methods.PredictiveKineticEnergy(),
    "Nedungadi": pk.methods.Nedungadi(),
}
for name, method in methods.items():
    motion = pk.resolve(arm, path, method, start=start)
    energy, torque = pk.kinetic_energy(motion), pk.torque_norm(motion)
    print(f"{name}: {energy:.4g} J s, {torque:.4g} N²m²s, off the path by {motion.tracking_error.max():.0e} m")

whole = pk.Tracking(arm, path, objectives=[pk.kinetic_energy, pk.torque_norm], start=start)
front = pk.epsilon_front(whole, points=4, starts=8)
print(f"whole motions: {front}")

# %% [markdown]
# `ConstrainedQP` takes the step nearest to the desired one that satisfies limits and clearance; `traces.active` says
# which limit each joint is at.

# %%
limits = pk.Limits(velocity=1.6, acceleration=20.0, clearance=0.01)  # rad/s, rad/s², m
motion = pk.resolve(arm, path, pk.methods.ConstrainedQP(), start=start, limits=limits)
rates = np.abs(np.diff(motion.q, axis=0)) / 0.01
at_limit = motion.traces.active != ""
print(f"constrained: fastest joint {rates.max():.4f} of 1.6 rad/s, at a limit in {at_limit.any(axis=1).sum()} steps")

# %% [markdown]
# A step cannot look ahead. If no step satisfies the limits, the error says which and when. A planned motion goes
# around the obstacle.

# %%
post = pk.obstacles.Circle([0.2, 0.2], 0.04)
try:
    pk.resolve(arm, path, pk.methods.ConstrainedQP(), start=start, limits=limits, obstacles=[post])
except pk.Infeasible as error:
    print(f"refused: {error}")
around = pk.Tracking(arm, path, objectives=[pk.kinetic_energy], start=start, limits=limits, obstacles=[post])
best = pk.plan(around, starts=6).best
print(f"around the post: {best.objective:.4g} J s, {best.motion.clearance.min() * 1e3:.1f} mm clear of it")

# %% [markdown]
# Many starts, or many values of a method's parameter, are followed at once: a batch of motions.

# %%
damping = pk.methods.DampedLeastSquares(region=0.2, damping=np.array([0.01, 0.1, 0.2]))
many = pk.resolve(arm, path, damping, start=start, tolerance=0.1)
print("more damping, farther off:", ", ".join(f"{error:.0e} m" for error in many.tracking_error.max(axis=-1)))
