"""Tringali & Cocuzza 2021, looking ahead: ``python -m studies.tringali_2021``.

Every number comes twice, as in the study of 2020: with the masses of Table 1 *as printed*, with which energies come out
27 % low, and with *fitted* ones, with which most are within 1 %. Looking ahead comes out 4 % low on the circle, and 8 %
low on trajectory 3, for no known reason: other readings do not give both. If the window at 5 s of trajectory 4 is
solved from the current posture, another minimum is found, with the printed speed and spectral radius. The energies of
trajectory 1 are printed with an exponent of -3 and read as -4. Speeds are read as those before a singularity, along
trajectories 2 and 3 as the forward ones. The paper's global optimum of trajectory 4 is one of ours, but not the best.
"""
