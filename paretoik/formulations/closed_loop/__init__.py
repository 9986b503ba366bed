"""CLMOGA: an evolutionary search in every step of a control loop (Marcos, Machado & Azevedo-Perdicoúlis 2012)."""
