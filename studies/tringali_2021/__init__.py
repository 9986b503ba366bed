"""Tringali & Cocuzza 2021, looking ahead: ``python -m studies.tringali_2021``.

Table 5, the speeds that section 3.2 tells and Figure 8 as rows, ours beside the paper's, and Figures 3 to 12 as
pictures. Every number comes twice, as in the study of 2020: with the masses of Table 1 *as printed*, with which
energies come out 27 % low, and with *fitted* ones, with which most are within 1 %; looking ahead comes out 4 % low on
the circle, whose sense the paper does not tell, and 8 % low on trajectory 3, for no reason that we know. The paper's
global optimum of trajectory 4 is one of ours, but not the best: that costs 24 % less, and a bound from below on all
motions is near it. Then what an update takes, beside one by SciPy's SLSQP in the same run.

============== ========================================================================================================
trajectories   the four trajectories by the three methods: Table 5, speeds, spectral radii
real_time      an update's seconds, ours and SLSQP's
pictures       Figures 3 to 12
============== ========================================================================================================
"""
