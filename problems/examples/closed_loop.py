# %% [markdown]
# # A closed loop: searched at every step
#
# Marcos, Machado & Azevedo-Perdicoúlis (2012) search at every control step: a population of next postures, their front
# of joint displacement against tool error, and a choice by weights. The more the displacement counts, the less the arm
# drifts, and the less exactly it follows.

# %%
import numpy as np

import paretoik as pk

RATE, STEP, STEPS = 7.0, 1e-3, 300  # rad/s, s
angle = RATE * STEP * STEPS
path = pk.circle([0.7, 0.0], 0.5, duration=STEP * STEPS, samples=STEPS + 1, turns=angle / (2 * np.pi), timing="uniform")
loop = pk.ClosedLoop(pk.arms.marcos_nr(3), path, weights=[0.5, 0.5], population=60, generations=40, seed=0)
run = loop.run()
print(f"{len(run.q) - 1} steps: mean error {run.position_error * 1e6:.1f} µm, drift {run.drift:.4f} rad")

# %% [markdown]
# `solve` runs the same loop and returns a front of one motion. It keeps the steps in `record_steps`, generation by
# generation, with the arm of every individual: `paretoik show runs/closed_loop` replays them.

# %%
front = pk.solve(loop, out="runs/closed_loop", overwrite=True, record_steps=[100, 200])
for name, unit, value in zip(front.names, front.units, front.objectives[0], strict=True):
    print(f"{name}: {value:.3g} {unit} in the mean over the steps")

# %% [markdown]
# Other weights give another loop: `select` runs it from the start, because every step differs. It is not the loop
# in the run folder, so the choice is not kept there.

# %%
choice = front.select(pk.Weights(joint_displacement=0.1, position_error=0.9))
print(choice.reason)
