"""Wan et al. 2018, weighted gradient projection: ``python -m studies.wan_2018``.

Tables 2 and 3 compare ours with the paper's, over starts from the whole self-motion of the first pose, which the paper
does not print; nor durations, Euler angles, and units of its criteria's gradients (``problems/wan_2018.py`` has ours).
Agreed: weighted gradient projection frees joint 4 from its limit, weighted least norm does not; the time of the
latter's singularity; most of the time saved compared with gradient projection. Not: the sizes of the errors, and that
they are smaller; velocity limits avoided without vibration (that gradient is not stable unless its gain is small); a
later singularity; the time saved compared with weighted least norm. ``ConstrainedQP`` satisfies all limits from all
starts.
"""
