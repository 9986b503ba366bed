from __future__ import annotations

import paretoik as pk

PATH = pk.line((0.4678, 0.0), (0.0983, 0.1526), duration=1.0, samples=21)
QUICK = {"population": 12, "generations": 6}


def tracking(*objectives, **limits) -> pk.Tracking:
    return pk.Tracking(
        pk.arms.tringali_3r(),
        PATH,
        objectives=objectives or (pk.kinetic_energy, pk.torque_norm),
        limits=pk.Limits(**limits),
        coefficients=4,
        bases=2,
        differences="backward",
    )
