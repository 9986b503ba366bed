"""Wan et al. 2018, weighted gradient projection: ``python -m studies.wan_2018``.

Tables 2 and 3 compare ours with the paper's, over starts from the whole self-motion of the first pose, which the paper
does not print; nor durations, Euler angles, and units of its criteria's gradients (``problems/wan_2018.py`` has ours).
Velocity limits are not avoided without vibration: that gradient is not stable unless its gain is small.
"""
