"""Tringali & Cocuzza 2021, looking ahead: ``python -m studies.tringali_2021``.

Table 5 with its times, the speeds of section 3.2 and Figure 8 are rows that compare ours with the paper's and give a
reason for each difference; Figures 3 to 12 are pictures. Every number comes twice, as in the study of 2020: with the
masses of Table 1 *as printed*, with which energies come out 27 % low, and with *fitted* ones, with which most are
within 1 %. Looking ahead comes out 4 % low on the circle, and 8 % low on trajectory 3, for no known reason: other
readings of the paper, one row each, do not give both. One of them explains trajectory 4: if the window at 5 s is solved
from the current posture, another minimum is found, with the printed speed and spectral radius. The three energies of
trajectory 1 are printed with an exponent of -3 and read as -4. Speeds are read as those before a singularity, along
trajectories 2 and 3 as the forward ones; that of joint 1 by least squares on the circle fits no circle that has the
other numbers. The paper's global optimum of trajectory 4 is one of ours, but not the best: ours costs 24 % less, and is
near a lower bound on all motions.

Further rows: the spline through more than two samples ahead, which the paper leaves open; the time of an update, and
that of SciPy's SLSQP; the time of its window, and that of CasADi's SQP and FATROP, in the same run.

============== ========================================================================================================
trajectories   the four trajectories by the three methods: Table 5, speeds, spectral radii; why ours differ
readings       looking ahead by other readings of the paper, trajectory 2 along other circles
splines        quartic splines through three or more samples ahead
real_time      an update's seconds, ours and SLSQP's
peers          a window's seconds, ours and CasADi's solvers'
pictures       Figures 3 to 12
============== ========================================================================================================
"""
