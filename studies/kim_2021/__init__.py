"""Kim, Choi & Jang 2021, maximum performance and time-optimal motion: ``python -m studies.kim_2021``.

Figures 5, 6, 8 and 9 and Table 4, ours beside the paper's, and what becomes of them where the paper is silent: masses
(0.5 kg a link here), the base's angle, joint ranges, the least angle of a rod. Ellipses are 20 % off for motors at the
joints and 6 % for sliders; by them joint motors arrive 12 % later than the paper's, sliders 2 %. In which directions
sliders are faster hangs on what is assumed, and no combination tried agrees with both of the paper's statements about
p6. Its energies do not come out, by either of two ways to choose postures. And the sliders' speeds ask for postures
that jump: where they may not, joint motors, 36 % later by ellipses, are there first, and the sliders 65 % later; with
lighter links, or the base turned by 30°, both are about as soon.

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
fronts         time against energy, postures and sliders without jumps
exactness      whether maxima and fastest paths are what they are said to be
racing         what maxima and steps take, beside IPOPT
pictures       Figures 5, 6, 8 and 9
============== ========================================================================================================
"""
