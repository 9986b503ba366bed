"""The papers' arms: ``tringali_3r``, ``marcos_nr``, ``wan_7r`` and ``kim_3r``."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np

from paretoik.inputs import check_choice
from paretoik.robot.arm import Arm

__all__ = ["TRINGALI_MASSES", "kim_3r", "marcos_nr", "tringali_3r", "wan_7r"]


def __dir__() -> list[str]:
    return __all__


TRINGALI_MASSES = {"printed": (0.615, 0.615, 0.307), "fitted": (0.619, 0.821, 0.503)}


def tringali_3r(masses: Literal["printed", "fitted"] = "printed") -> Arm:
    """Return the planar 3R prototype of Tringali & Cocuzza 2020 and 2021.

    The data are from Table 1 of the paper of 2020.

    masses: "printed" for the masses in the papers, or "fitted"

    The printed masses reproduce the kinematics of both papers, but give energies that are 27 % too low. The fitted
    masses are not in the papers: they were fitted to eleven published energies and reproduce these within 0.85 %. The
    arm has no limits, because the limits of 2020, Table 2, differ between simulations. Raises InvalidInput for
    other words.

    >>> tringali_3r("fitted").bodies[2].mass
    0.503
    """
    check_choice("masses", masses, TRINGALI_MASSES)
    return Arm.planar(
        lengths=[0.176, 0.176, 0.1375],
        masses=TRINGALI_MASSES[masses],
        centers=[0.0950, 0.0717, 0.0526],
        inertias=[0.001811, 0.003173, 0.002103],
        name=f"Tringali 3R, {masses} masses",
    )


def marcos_nr(links: Literal[3, 4] = 3) -> Arm:
    """Return the planar arm with unit links of Marcos et al. 2012, section 5.1.

    links: number of links, 3 or 4

    The arm has kinematics only, and no limits. The paper says that links are identical; a length of 1 m is assumed and
    agrees with its figures. Raises InvalidInput for another number of links.

    >>> marcos_nr(4).dof
    4
    """
    check_choice("links", links, (3, 4))
    return Arm.planar(lengths=[1.0] * links, name=f"Marcos {links}R")


def wan_7r() -> Arm:
    """Return the 7R arm of Wan et al. 2018, Table 1.

    The table has modified DH parameters, and position and velocity limits. The paper prints no masses, so this arm has
    kinematics only.

    >>> wan_7r().velocity_limits[0].round(4)
    np.float64(0.9599)
    """
    degrees = [(-160, 160), (-33, 150), (-165, 80), (-180, 40), (-150, 150), (-180, 180), (-180, 180)]
    lower, upper = np.deg2rad(np.array(degrees, dtype=float)).T
    return Arm.from_dh(
        a=[0.0, 0.0, 0.0, 0.45, 0.4, 0.0, 0.0],
        alpha=np.deg2rad([0.0, 90.0, 90.0, 0.0, 0.0, 90.0, 90.0]).tolist(),
        d=[0.0, -0.2975, -0.3555, -0.293, 0.255, 0.197, 0.104],
        theta=[0.0] * 7,
        convention="modified",
        position_limits=(lower, upper),
        velocity_limits=np.deg2rad([55.0, 55.0, 55.0, 55.0, 65.0, 65.0, 65.0]),
        name="Wan 7R",
    )


def kim_3r(masses: Sequence[float] = (0.5, 0.5, 0.5)) -> Arm:
    """Return the planar 3R arm of Kim, Choi & Jang 2021, Table 2.

    Gravity is (0, −9.81).

    masses: mass of each link [kg], at its midpoint

    The paper prints neither masses nor limits: 0.5 kg per link and no limits are assumptions.

    >>> kim_3r().dof
    3
    """
    lengths = np.array([0.114, 0.114, 0.129])
    return Arm.planar(lengths=lengths, masses=masses, centers=lengths / 2, inertias=[0.0] * 3, name="Kim 3R").mounted(
        gravity=[0.0, -9.81, 0.0]
    )
