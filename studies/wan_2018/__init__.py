"""Wan et al. 2018, weighted gradient projection: ``python -m studies.wan_2018``.

Tables 2 and 3 compare ours with the paper's, over starts from the whole self-motion of the first pose. The paper prints
neither its start, nor durations, nor which Euler angles, nor the units of its criteria's gradients. Our assumptions are
in ``problems/wan_2018.py``; rows have medians and quartiles over starts.

These results agree: weighted gradient projection keeps joint 4 from its limit, or frees it, and weighted least norm
leaves it there; the time at which the arm becomes singular by weighted least norm; most of the time saved compared with
gradient projection, which has one more criterion. These do not:

- the sizes of the errors: they depend on the start, and medians over starts are mostly larger;
- smaller errors than weighted least norm's and gradient projection's: from the same start they are mostly larger;
- the avoidance of velocity limits without vibration: a gradient that depends on the unknown velocity is not stable
  unless its gain is small, and in six to eight of ten cases a joint would turn by more than 1 rad in some step, which
  is cut short;
- the time at which weighted gradient projection is singular, later than weighted least norm in the paper: a joint that
  is in its buffer at the start lowers the clamped Jacobian's singular values from there on;
- the time saved compared with weighted least norm: both take as long.

A further method is a quadratic program in every step, ``ConstrainedQP``, with the same parameters of the task: it
satisfies all limits from all starts, and says if they leave no way on. Figures 6, 7, 10 and 11, and the same of the
program, are drawn from the start with the compared method's errors nearest to print.

Further rows: the fronts of both methods' parameters by search.

============== ========================================================================================================
methods        the methods of both tables, and their motions from all starts
tables         Tables 2 and 3, limits, seconds; the text's statements on the figures: times of their events
pictures       Figures 6, 7, 10 and 11
fronts         the fronts of either method's parameters, 31 seeds
============== ========================================================================================================
"""
