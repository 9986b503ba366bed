"""Wan et al. 2018, weighted gradient projection: ``python -m studies.wan_2018``.

Tables 2 and 3, ours beside the paper's, over starts from all over the self-motion of the first pose: the paper prints
neither its start, nor durations, nor which Euler angles, nor the units of its criteria's gradients. What is stated in
``problems/wan_2018.py`` is assumed, and rows tell medians and quartiles over starts.

What reproduces: weighted gradient projection keeps joint 4 from its limit, or frees it, where weighted least norm
leaves it there; the time at which the arm becomes singular by weighted least norm; most of the time that it saves
beside gradient projection, which has a criterion more. What does not:

- the sizes of the errors: they hang on the start, and medians over starts are mostly larger;
- smaller errors than weighted least norm's and gradient projection's: from the same start they are mostly larger;
- the avoidance of velocity limits without vibration: a gradient that depends on the velocity being solved for is not
  stable where its gain is not small, and in six to eight of ten cases a joint were to turn by more than 1 rad in some
  step, which is cut short;
- when weighted gradient projection is singular, later than weighted least norm in the paper: a joint that is in its
  buffer at the start lowers the clamped Jacobian's singular values from there on;
- the saving of time beside weighted least norm: both take as long.

Beside them stands a quadratic program in every step, ``ConstrainedQP``, with the same numbers of the task: it keeps
all limits from all starts, and says where they leave no way on. Figures 6, 7, 10 and 11, and the same of the program,
are drawn from the start from which the compared method's errors are nearest to those printed.

Then what 200 parameter sets take, and the fronts of both methods' numbers, searched for.

============== ========================================================================================================
methods        the methods of both tables, and their motions from all starts
tables         Tables 2 and 3, what becomes of limits, and seconds
events         what the text tells of the figures: times of singularities, of jumps, and of limits
pictures       Figures 6, 7, 10 and 11
fronts         the fronts of either method's numbers, 31 seeds
============== ========================================================================================================
"""
