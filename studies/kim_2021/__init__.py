"""Kim, Choi & Jang 2021, maximum performance and time-optimal motion: ``python -m studies.kim_2021``.

Figures 5, 6, 8 and 9 and Table 4, ours beside the paper's, and what becomes of them where the paper is silent: masses
(0.5 kg a link here), the base's angle, joint ranges, the least angle of a rod. In which directions sliders are faster
hangs on what is assumed; energies hang on how postures are chosen, which the paper does not say. And the sliders'
speeds ask for postures that jump: what becomes of them where postures may not is here too. README has the figures.

============== ========================================================================================================
setting        the nine positions, both mechanisms, the printed numbers
polygons       Figures 5 and 6
sensitivity    what the gain of sliders hangs on
surrogates     Equation 5: ellipses, and their errors
trajectories   Figure 8, and Equation 6 as printed
profiles       postures along a path, and how long they take
continuous     those that are soonest without a jump
without_jumps  who is sooner under other assumptions, postures not jumping
energies       Figure 9 and Table 4
full_program   Equation 1 for IPOPT, one direction at a time
looking_ahead  Equation 6 for IPOPT, one step
fronts         time against energy, postures and sliders without jumps, beside IPOPT
motion_program a motion from point to point for IPOPT
exactness      whether maxima and fastest paths are what they are said to be
racing         what maxima and steps take, beside IPOPT
pictures       Figures 5, 6, 8 and 9
============== ========================================================================================================
"""
