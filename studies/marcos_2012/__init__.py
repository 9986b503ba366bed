"""Marcos, Machado & Azevedo-Perdicoúlis 2012, CLMOGA: ``python -m studies.marcos_2012``.

Readings: Tables 1 and 3 are under each other's caption in the text at hand; 2.71E-00 in Table 3 (4R, r
= 0.7, w = 0.2) is taken for 2.71E-06; w weights the displacement; in Eq. 13 q₀ is the configuration before the step, in
Eq. 17 the first one; obstacles are checked only at the end of a step, and steps are not bounded.
"""
