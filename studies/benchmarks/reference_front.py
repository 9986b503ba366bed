"""The stored front of ``energy_torque``: ε-constraints followed along every branch by CasADi and IPOPT, 101 samples."""

from __future__ import annotations

import numpy as np

from studies.reporting import REPORTED

REFERENCE_POINT = np.array([0.065, 0.10])


def reference_front() -> np.ndarray:
    """Return the stored reference (points, 2): kinetic energy [J s], torque norm [N²m²s]."""
    return np.loadtxt(REPORTED / "energy_torque_reference.csv", delimiter=",", skiprows=1)
