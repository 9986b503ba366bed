"""Wan et al. 2018, weighted gradient projection: ``python -m studies.wan_2018``.

Tables 2 and 3, ours beside the paper's, over starts from all over the self-motion of the first pose: the paper prints
neither its start, nor durations, nor which Euler angles, nor the units of its criteria's gradients. What is stated in
``problems/wan_2018.py`` is assumed, and rows tell medians and quartiles over starts.

What reproduces: weighted gradient projection keeps joint 4 from its limit, or frees it, where weighted least norm
leaves it there. What does not:

- the sizes of the errors: they hang on the start, and medians over starts are mostly larger;
- smaller errors than weighted least norm's and gradient projection's: from the same start they are mostly larger;
- the avoidance of velocity limits without vibration: a gradient that depends on the velocity being solved for is not
  stable where its gain is not small, and in six to eight of ten cases a joint were to turn by more than 1 rad in some
  step, which is cut short;
- the saving of time: all methods take as long.

Then what 200 parameter sets take, and the fronts of both methods' numbers, searched for.

============== ========================================================================================================
methods        Tables 2 and 3, joint 4, and seconds
fronts         the fronts of either method's numbers, 31 seeds
============== ========================================================================================================
"""
