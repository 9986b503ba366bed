"""Tringali & Cocuzza 2021, looking ahead: ``python -m studies.tringali_2021``.

Table 5 with its times, the speeds that section 3.2 tells and Figure 8 as rows, ours beside the paper's, the reason of
each difference beside it, and Figures 3 to 12 as pictures. Every number comes twice, as in the study of 2020: with the
masses of Table 1 *as printed*, with which energies come out 27 % low, and with *fitted* ones, with which most are
within 1 %; looking ahead comes out 4 % low on the circle, and 8 % low on trajectory 3, for no reason that we know:
other readings of the paper, a row each, do not give both. One of them explains trajectory 4: with the window at 5 s
solved from the posture held, another minimum is found, and with it the speed and the spectral radius that are printed.
The three energies of trajectory 1 are printed with an exponent of -3 and read as -4. Speeds are read as those before a
singularity, along trajectories 2 and 3 as the forward ones; that of joint 1 by least squares on the circle belongs to
no circle that has the other numbers. The paper's global optimum of trajectory 4 is one of ours, but not the best: that
costs 24 % less, and a bound from below on all motions is near it.

Then what the paper leaves open: the spline through more than two samples ahead. And what an update takes, beside one
by SciPy's SLSQP, and its window alone beside CasADi's SQP and FATROP, in the same run.

============== ========================================================================================================
trajectories   the four trajectories by the three methods: Table 5, speeds, spectral radii
reasons        why ours are not the paper's
readings       looking ahead by other readings of the paper
circles        trajectory 2 along other circles
splines        quartic splines through three samples ahead or more
real_time      an update's seconds, ours and SLSQP's
peers          a window's seconds, ours and CasADi's solvers'
pictures       Figures 3 to 12
============== ========================================================================================================
"""
