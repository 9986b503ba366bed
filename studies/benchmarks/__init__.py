"""Our numbers compared with our peers' and our goals; each module is a command with ``--quick`` and ``--json``.

===================================================  =================================================================
``python -m studies.benchmarks.kinematics``          robot kernels and a Python loop over Pinocchio, and the time to
                                                     evaluate 200 motions
``python -m studies.benchmarks.maximin``             MaxiMin and pymoo's algorithms on test problems, by statistics
``python -m studies.benchmarks.reference_front``     the ``energy_torque`` front by ε-constraints with CasADi and IPOPT
``python -m studies.benchmarks.energy_torque``       the search at its defaults against that front, seed by seed
``python -m studies.benchmarks.limits_kept``         a resolver that keeps limits, and pink
===================================================  =================================================================
"""
