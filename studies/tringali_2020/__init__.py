"""Tringali & Cocuzza 2020, the Global Kinematic Planner: ``python -m studies.tringali_2020``.

Tables 4, 5 and 6, Figures 1 and 14 are rows that compare ours with the paper's; Figures 1 and 3 to 14 are pictures.
Every number comes twice: with the masses of Table 1 *as printed*, and with *fitted* ones. With printed masses, kinetic
energies come out 27 % low and torque norms half, though joint speeds are within 5 %; no setting of the method changes
that. Fitted masses, an inference that is not in the paper, bring nearly everything within 2 %. Nothing else is fitted.
If a number is not reproduced, its row shows it, with the reason if it is known.

The line between the printed ends is 0.39977 m long, the text says 0.40 m: both are computed. So are the search and the
sweep of ε as the paper has them. With the printed weight of Eq. 14, 0.01, the candidates ranked best by torques are
where limits cannot be satisfied; ten times that weight finds the optima of our plans.

============== ========================================================================================================
simulations    the five problems with either arm, planned; Tables 5 and 6, section 4.2; the paper's numbers
validation     the calculus of variations against the planner; Table 4
extremals      the calculus of variations, from given postures
published      the search as published; Eqs. 9 to 14 and 17
candidates     the value of more candidates; Figure 1
trade_off      kinetic energy against torque norm; Figure 14; the front as published; Eqs. 21 and 22
pictures       Figures 1 and 3 to 14
============== ========================================================================================================
"""
