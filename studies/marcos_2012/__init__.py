"""Marcos, Machado & Azevedo-Perdicoúlis 2012, CLMOGA: ``python -m studies.marcos_2012``.

Tables 1 to 4, a closed loop for every cell, ours beside the paper's and beside the oracle, which takes the exactly best
step every time; Figures 2 to 9 as pictures. What was read into the paper:

- the blocks of Tables 1 and 3 stand under each other's caption in the text at hand: without obstacles comes first;
- 2.71E-00 in Table 3 (4R, r = 0.7, w = 0.2) is taken for 2.71E-06;
- w weighs the displacement; in Eq. 13 q₀ is the configuration before the step, in Eq. 17 the first one;
- obstacles are looked at where a step ends, and nothing bounds a step: so the tables. By default a step is bounded;
  what that changes is told in rows of its own;
- where the arm begins is chance (OLGA) and not printed: cells that depend on it differ by that, ours beside the
  paper's, and the oracle begins where ours does.

============== ========================================================================================================
loops          every closed loop, searched and exact: on all cores, or on a Dask cluster
tables         Tables 1 to 4 and what they say
collisions     whether the arm meets an obstacle between steps, on a grid
pictures       Figures 2 to 9
============== ========================================================================================================
"""
