"""Tringali & Cocuzza 2021, looking ahead: ``python -m studies.tringali_2021``.

Every number comes twice, as in the study of 2020: with the masses of Table 1 *as printed*, and with *fitted* ones; rows
say why ours differ. The energies of trajectory 1 are printed with an exponent of -3 and read as -4. Speeds are read as
those before a singularity, along trajectories 2 and 3 as the forward ones.
"""
