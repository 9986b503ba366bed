# %% [markdown]
# # A pymoo user's day
#
# Every formulation is a pymoo problem and MaxiMin is a survival for any of pymoo's genetic algorithms: each works
# without the other.

# %%
import numpy as np
from pymoo.algorithms.moo.nsga2 import NSGA2
from pymoo.indicators.hv import HV
from pymoo.optimize import minimize
from pymoo.problems import get_problem

import paretoik as pk

for name, survival in (("MaxiMin", pk.MaxiMin()), ("rank and crowding", None)):
    algorithm = NSGA2(pop_size=60, survival=survival) if survival else NSGA2(pop_size=60)
    result = minimize(get_problem("zdt3"), algorithm, ("n_gen", 100), seed=1)
    print(f"zdt3 by NSGA2 with {name}: hypervolume {HV(ref_point=[1.0, 1.1])(result.F):.4f}")

# %% [markdown]
# A problem of ours in `minimize`: genes are decoded into motions that all follow the path.

# %%
path = pk.line([0.4678, 0.0], [0.0983, 0.1526], duration=1.0, samples=41)
limits = pk.Limits(position=np.deg2rad([90, 120, 120]), velocity=3.8)
problem = pk.Tracking(pk.arms.tringali_3r(), path, objectives=[pk.kinetic_energy, pk.torque_norm], limits=limits)
result = minimize(problem, pk.MaxiMinNSGA2(pop_size=60), ("n_gen", 60), seed=1)
motions = problem.decode(result.X)
print(
    f"minimize: {len(result.F)} points, motions {motions.q.shape}, off the path by {motions.tracking_error.max():.0e} m"
)

# %% [markdown]
# Ask and tell, if you evaluate yourself: on another machine, or on a robot. Failed evaluations are told as NaN.

# %%
search = pk.Search(problem, population=60, seed=1)
while search.generation < 60:
    asked = search.ask()
    evaluated = problem.evaluate(asked.X, return_values_of=["F", "G"])
    search.tell(asked.ids, *evaluated)
print(f"ask and tell: {search.front}")

# %% [markdown]
# A search for parameters: damping, and the singular value below which it acts, against error and distance from limits.

# %%
tuning = pk.Tuning(
    pk.arms.wan_7r(),
    pk.line([0.45, -0.2, 0.5], [0.45, 0.2, 0.5], duration=2.0, samples=41),
    pk.methods.WeightedGradientProjection(criteria=pk.joint_limit_nearness),
    judged_starts=3,
)
result = minimize(tuning, NSGA2(pop_size=20, survival=pk.MaxiMin()), ("n_gen", 10), seed=1)
print(f"tuning of {', '.join(each.name for each in tuning.parameters)}: {len(result.F)} settings")
best = tuning.values(np.atleast_2d(result.X)[np.argmin(result.F[:, 0])][None])
print("follows best with", ", ".join(f"{name} {value[0]:.3g}" for name, value in best.items()))
