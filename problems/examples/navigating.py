# %% [markdown]
# # Navigating: along the front, to points that were not on it
#
# A front has as many points as you asked for. From a chosen one `navigate` moves to a new one: one objective improves,
# others pay. The new point is certified like the others and has an id of its own.

# %%
import numpy as np

import paretoik as pk

arm, limits = pk.arms.tringali_3r(), pk.Limits(position=np.deg2rad([90, 120, 120]), velocity=3.8)
path = pk.line([0.4678, 0.0], [0.0983, 0.1526], duration=1.0, samples=51)
problem = pk.Tracking(arm, path, objectives=[pk.kinetic_energy, pk.torque_norm], limits=limits)
front = pk.epsilon_front(problem, points=10, starts=12)
choice = front.select("knee")
print(f"from point {choice.id}: {choice.objectives}")

# %% [markdown]
# By default the objective improves by a twentieth of its range, and every other objective pays.

# %%
moved = front.navigate(choice, improve="kinetic_energy")
print(moved.navigated.verdict)

# %% [markdown]
# It can also improve by an amount, or to a value, in the objective's own unit; `allow` and `hold` say who pays and who
# does not. Moves follow one another: each front has the points of the one before, without those that a new one
# dominates.

# %%
moved = moved.navigate(moved.navigated, improve="torque_norm", by=0.002)
moved = moved.navigate(moved.navigated, improve="kinetic_energy", to=0.040)
now = moved.navigated
print(f"{len(front)} points became {len(moved)}; now point {now.id}: {now.objectives}")
certificate = moved.certificates[now.index : now.index + 1]
print(f"its certificate: {certificate.status[0]}, residual {certificate.criticality[0]:.0e}")

# %% [markdown]
# The result of a move is predicted in milliseconds, by the derivatives at its start: it is not certified, and no point
# of the front. In a notebook `front.view()` has a slider for every objective: a drag draws the prediction in grey, and
# on release the certified point appears, `view.choice` on `view.front`.

# %%
prediction = front.predict(choice, improve="kinetic_energy")
led = front.navigate(choice, improve="kinetic_energy").navigated
print(prediction)
print(f"it misses the certified point by {np.abs(prediction.objectives / led.objectives - 1).max():.0e} of its values")

# %% [markdown]
# Beyond the end of the front no point exists, and the error says so. `refine_around` puts more points near one that
# matters. On the command line: `paretoik navigate RUN --point 7 --improve kinetic_energy`.

# %%
try:
    front.navigate(int(front.ids[0]), improve="kinetic_energy")
except pk.ParetoikError as error:
    print(f"refused: {error}")
dense = front.refine_around(choice, points=4)
new = np.setdiff1d(dense.ids, front.ids)
print(f"around point {choice.id}: new points {', '.join(map(str, new))}; {len(front)} points became {len(dense)}")
