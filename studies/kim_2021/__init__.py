"""Kim, Choi & Jang 2021, maximum performance and time-optimal motion: ``python -m studies.kim_2021``.

The package regenerates Figures 5, 6, 8 and 9 and Table 4 and compares ours with the paper's. The paper prints no masses
(0.5 kg per link here), no angle of the base, and not how postures follow a path: speeds and energies depend on them.
The sliders' speeds need postures that jump; results without jumps are here too. README has the figures.

============== ========================================================================================================
maxima         the nine positions, both mechanisms, Figures 5 and 6; Equation 5: ellipses, and their errors
trajectories   Figure 8, and Equation 6 as printed
postures       postures along a path and their durations, the soonest ones without a jump
energies       Figure 9 and Table 4
ipopt_programs Equation 1 one direction at a time, one posture for two, Equation 6 one step, a motion: for IPOPT
racing         IPOPT from many starts; times of maxima and steps, and of IPOPT
one_posture    one posture for two directions
fronts         time against energy, postures and sliders without jumps, and by IPOPT
pictures       Figures 5, 6, 8 and 9
============== ========================================================================================================
"""
