"""Kim, Choi & Jang 2021, maximum performance and time-optimal motion: ``python -m studies.kim_2021``.

The package regenerates Figures 5, 6, 8 and 9 and Table 4 and compares ours with the paper's. It also varies what the
paper does not print: masses (0.5 kg per link here), the base's angle, joint ranges, the least angle of a rod. The
directions in which sliders are faster depend on these assumptions; energies depend on the choice of postures, which the
paper does not state. The sliders' speeds need postures that jump; results without jumps are here too. README has the
figures.

============== ========================================================================================================
setting        the nine positions, both mechanisms, the printed numbers
polygons       Figures 5 and 6
sensitivity    the assumptions that the gain of sliders depends on
surrogates     Equation 5: ellipses, and their errors
trajectories   Figure 8, and Equation 6 as printed
profiles       postures along a path, and their durations
continuous     the soonest ones without a jump
without_jumps  which mechanism is sooner under other assumptions, without jumps
energies       Figure 9 and Table 4
full_program   Equation 1 for IPOPT, one direction at a time
looking_ahead  Equation 6 for IPOPT, one step
fronts         time against energy, postures and sliders without jumps, and by IPOPT
motion_program a motion from point to point for IPOPT
exactness      tests that maxima and fastest paths are exact
racing         times of maxima and steps, and of IPOPT
pictures       Figures 5, 6, 8 and 9
============== ========================================================================================================
"""
