"""Formulations: each method as a pymoo problem, one method a file; ``protocol`` says what verbs ask of them."""
