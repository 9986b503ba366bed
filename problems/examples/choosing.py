# %% [markdown]
# # Choosing one motion
#
# A preference picks one point of a front, says why, and stays with the run. Objectives may have any units: preferences
# measure what each gives up as a share of its range on the front.

# %%
import numpy as np

import paretoik as pk

arm, limits = pk.arms.tringali_3r(), pk.Limits(position=np.deg2rad([90, 120, 120]), velocity=3.8)
path = pk.line([0.4678, 0.0], [0.0983, 0.1526], duration=1.0, samples=41)
problem = pk.Tracking(arm, path, objectives=[pk.kinetic_energy, pk.torque_norm], limits=limits)
front = pk.solve(
    problem, population=60, generations=40, seed=1, refine=True, points=25, out="runs/choosing", overwrite=True
)
print(front)

# %% [markdown]
# Weights are the oldest preference, a knee needs no numbers, an aspiration is a set of values to aim for. Every choice
# has its motion, what it gives up, and a reason in words.

# %%
for preference in (
    pk.Weights(kinetic_energy=0.3, torque_norm=0.7),
    pk.Knee(),
    pk.Aspiration(kinetic_energy=0.04, torque_norm=0.06),
):
    choice = front.select(preference)
    print(f"{preference}: point {choice.id}, {choice.objectives}")
print(choice.reason)

# %% [markdown]
# Requirements come first: bounds, then any preference among the rest; an order of importance with tolerances; weights
# that are only roughly known; or, seen from the last choice, which objectives should improve and which may get worse.

# %%
cheap = front.select(pk.Bounds(kinetic_energy=(None, 0.041), then=pk.Weights(torque_norm=1)))
first = front.select(pk.Lexicographic("torque_norm", "kinetic_energy", tolerance_shares={"torque_norm": 0.1}))
robust = front.select(pk.Robust(kinetic_energy=0.3, torque_norm=0.7, uncertainty=0.3))
better = front.select(pk.Classify(robust, improve=["kinetic_energy"], relax_to={"torque_norm": 0.075}))
for name, one in {"bounds": cheap, "order": first, "robust": robust, "classes": better}.items():
    print(f"{name}: point {one.id}, {one.objectives}")

# %% [markdown]
# All choices are kept in the run folder as a tree; `undo` goes back, and `paretoik show runs/choosing` opens on the
# present one. On the command line: `paretoik select runs/choosing --knee`.

# %%
front.undo()
print(front.choices)


# %% [markdown]
# Your own preference is any object that returns `front.choice(row, verdict)`: here the gentlest start.


# %%
class GentleStart:
    """The motion whose joints accelerate the least in the first tenth of a second."""

    def choose(self, front):
        """Return that point."""
        early = np.abs(front.motions.ddq[:, front.motions.time[0] <= 0.1]).max(axis=(1, 2))
        row = int(np.argmin(early))
        return front.choice(row, f"Point {front.ids[row]} accelerates its joints by at most {early[row]:.3g} rad/s².")


own = front.select(GentleStart())
print(own.verdict)

# %% [markdown]
# The report is one page that loads nothing: the front with its ids, the choices, every motion's curves and an arm that
# moves.

# %%
page = pk.report(front, "runs/choosing/report.html")
print(f"{page}: {page.stat().st_size / 1e6:.1f} MB")
