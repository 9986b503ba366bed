"""Tringali & Cocuzza 2020, the Global Kinematic Planner: ``python -m studies.tringali_2020``.

Tables 4, 5 and 6, Figures 1 and 14 as rows, ours beside the paper's, and Figures 1 and 3 to 14 as pictures. Every number
comes twice. With the masses *as printed* in Table 1 speeds and postures agree with the paper, but energies come out
27 % low, whatever is minimised; with *fitted* masses, an inference that is not in the paper, nearly all agree. No number
is tuned beyond those masses; where one is not reproduced, its row shows it.

============== ========================================================================================================
simulations    the five problems with either arm, planned; Tables 5 and 6 and what section 4.2 says of them
validation     the calculus of variations beside the planner; Table 4
candidates     what more candidates are worth; Figure 1
trade_off      kinetic energy against torque norm; Figure 14
pictures       Figures 1 and 3 to 14
reported       the paper's numbers
============== ========================================================================================================
"""
