"""Tringali & Cocuzza 2020, the Global Kinematic Planner: ``python -m studies.tringali_2020``.

Every number comes twice: with the masses of Table 1 *as printed*, with which kinetic energies come out 27 % low and
torque norms half, though joint speeds are within 5 %; and with *fitted* ones, an inference that brings nearly
everything within 2 %. Nothing else is fitted.
"""
