"""Formulations: each method as a pymoo problem; ``protocol`` lists what verbs ask of them."""
