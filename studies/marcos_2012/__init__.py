"""Marcos, Machado & Azevedo-Perdicoúlis 2012, CLMOGA: ``python -m studies.marcos_2012``.

Tables 1 to 4 have a closed loop for every cell, compared with the paper and with the oracle, which takes the exactly
best step every time; Figures 2 to 9 are pictures. The paper is read as follows:

- Tables 1 and 3 are under each other's caption in the text at hand: without obstacles comes first;
- 2.71E-00 in Table 3 (4R, r = 0.7, w = 0.2) is taken for 2.71E-06;
- w weights the displacement; in Eq. 13 q₀ is the configuration before the step, in Eq. 17 the first one;
- in the tables obstacles are checked only at the end of a step, and steps are not bounded;
- the arm's start is random (OLGA) and not printed: cells that depend on it differ from the paper's by that; the oracle
  begins at our start.

============== ========================================================================================================
exact_loop     the oracle, of planar arms with 3 or 4 links; compiled in exact_step, null_space_steps, step_cells and
               obstacle_cuts
starts         the influence of the start on the exact loop
tables         every closed loop, searched and exact, on all cores or on a Dask cluster; Tables 1 to 4
pictures       Figures 2 to 9
============== ========================================================================================================
"""
