"""Names of array shapes, and read-only arrays.

The batch comes first: ``*batch`` is any number of leading axes, possibly zero. ``time`` counts samples, ``dof``
joints, ``points`` the members of a front. ``Inexact`` shapes are real or complex: the robot kernels run on both.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from jaxtyping import Bool, Float, Inexact, Int

Vector3: TypeAlias = Float[np.ndarray, "3"]
Matrix3: TypeAlias = Float[np.ndarray, "3 3"]
Quaternion: TypeAlias = Float[np.ndarray, "4"]

Joints: TypeAlias = Inexact[np.ndarray, "*batch dof"]
Positions: TypeAlias = Inexact[np.ndarray, "*batch 3"]
Rotations: TypeAlias = Inexact[np.ndarray, "*batch 3 3"]
Jacobians: TypeAlias = Inexact[np.ndarray, "*batch 6 dof"]
InertiaMatrices: TypeAlias = Inexact[np.ndarray, "*batch dof dof"]
Values: TypeAlias = Inexact[np.ndarray, "*batch"]

Times: TypeAlias = Float[np.ndarray, "time"]
Series: TypeAlias = Float[np.ndarray, "*batch time"]
JointPaths: TypeAlias = Float[np.ndarray, "*batch time dof"]

Genes: TypeAlias = Float[np.ndarray, "points genes"]
Objectives: TypeAlias = Float[np.ndarray, "points n_obj"]
Constraints: TypeAlias = Float[np.ndarray, "points n_constr"]
Ids: TypeAlias = Int[np.ndarray, "points"]
Mask: TypeAlias = Bool[np.ndarray, "points"]

Point: TypeAlias = Float[np.ndarray, "*point"]
Points: TypeAlias = Float[np.ndarray, "points *point"]


def read_only(array: np.ndarray) -> np.ndarray:
    """Return the same array, made read-only."""
    array.setflags(write=False)
    return array
