"""Wan et al. 2018, weighted gradient projection: ``python -m studies.wan_2018``.

Tables 2 and 3, ours beside the paper's, over starts from all over the self-motion of the first pose: the paper prints
neither its start, nor durations, nor which Euler angles, nor the units of its criteria's gradients. What is stated in
``problems/wan_2018.py`` is assumed, and rows tell medians and quartiles over starts. What can be told, then, is not
whether the paper's errors come out (they hang on the start), but which method errs less from the same starts, which
frees joint 4 from its limit, and how fast the motions are made.
"""
