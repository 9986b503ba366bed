# %% [markdown]
# # Refining: certificates and exchange rates
#
# A search comes near the front. Gradients bring every point onto it; each point then has a certificate of how far it is
# from critical and what one objective costs of another there. "Optimal" is meant locally.

# %%
import numpy as np

import paretoik as pk

arm, limits = pk.arms.tringali_3r(), pk.Limits(position=np.deg2rad([90, 120, 120]), velocity=3.8)
path = pk.line([0.4678, 0.0], [0.0983, 0.1526], duration=1.0, samples=51)
problem = pk.Tracking(arm, path, objectives=[pk.kinetic_energy, pk.torque_norm], limits=limits)

rough = pk.solve(problem, population=40, generations=30, seed=1, points=12)
front = pk.refine(rough)
print(f"searched: {rough}")
print(f"refined: {front}")

# %% [markdown]
# The criticality (Nocedal & Wright's KKT residual, scaled) is the improvement that all objectives can still gain at
# once, as a share of their ranges; a minimum has positive curvature too.

# %%
certificates = front.certificates
print(f"statuses: {', '.join(sorted(set(certificates.status)))}; worst residual {certificates.criticality.max():.1e}")
print(
    f"worst violation at samples {certificates.violation.max():.1e}, between {certificates.violation_between.max():.1e}"
)

# %% [markdown]
# `exchange_rates[p, i, j]` is the change of objective j per unit of objective i, along the front. At the ends one
# objective has no weight left and the rate means nothing.

# %%
for row in np.flatnonzero(np.isfinite(certificates.exchange_rates[:, 0, 1]))[::3]:
    energy, torque = front.objectives[row]
    rate = certificates.exchange_rates[row, 0, 1]
    print(
        f"point {front.ids[row]} ({energy:.4g} J s, {torque:.4g} N²m²s): 0.001 J s more saves {-rate / 1e3:.2g} N²m²s"
    )

# %% [markdown]
# `epsilon_front` needs no search before it: it sweeps bounds from one objective's optimum to the other's. `jumps` are
# neighbours between which the optimum changes its branch, `missing_hypervolume` is what more points could still add.

# %%
swept = pk.epsilon_front(problem, points=12, starts=12)
print(f"swept: {swept}")
print(f"jumps between ids: {swept.jumps}; could still be added: {swept.missing_hypervolume:.2%} of the hypervolume")

# %% [markdown]
# Three fronts compared, by the share that each has of the merged front's hypervolume.

# %%
comparison = pk.compare(rough, front, swept, labels=["searched", "refined", "swept"])
print(repr(comparison))  # print(comparison) has the tables

# %% [markdown]
# One objective alone has distinct optima, best first, each with the label of its branch.

# %%
plan = pk.plan(pk.Tracking(arm, path, objectives=[pk.torque_norm], limits=limits), starts=24)
print("optima of the torque norm:", ", ".join(f"{each.objective:.4g} ({each.label})" for each in plan.optima))
